"""The answer as the contract's JSON: what is no finite number is null."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, TypedDict, cast

from toolkit.declared.answers import entry_of
from toolkit.declared.text import json_value
from toolkit.findings import FindingEntry

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis, FoundEffect, FoundLaw, Mismatch, Place


class DiagnosedRecording(TypedDict):
    """A recording of a case."""

    name: str
    sha256: str
    own: Annotated[bool, "whether the virtual machine recorded it"]


MismatchPlace = TypedDict(
    "MismatchPlace",
    {
        "variable": str,
        "from": float | None,
        "to": float | None,
        "unit": str,
        "runs": list[str],
    },
)
MismatchPlace.__doc__ = "Where a channel departs from the simulation."


class ChannelMismatch(TypedDict):
    """How far a channel departs from the simulation."""

    channel: str
    p_value: float | None
    share_of_variance: float | None
    where: list[MismatchPlace]


class EffectEstimate(TypedDict):
    """A parameter of an effect that a diagnosis names."""

    name: str
    value: float | None
    unit: str
    ci95: Annotated[list[float | None] | None, "interval for a coverage of 95 %"]
    runs: Annotated[list[Any] | None, "values of single runs, where they differ"]


class RejectedEffect(TypedDict):
    """An effect that explains less."""

    name: str
    log_likelihood_less: Annotated[float | None, "at most: one that is far behind is not fitted to its end"]


class EffectEvidence(TypedDict):
    """What speaks for an effect."""

    held_out_log_score_gain: Annotated[float | None, "on runs that no fit has seen"]
    p_value: Annotated[float | None, "against the chance of the whole search"]


class DiagnosedEffect(TypedDict):
    """An effect that a diagnosis names."""

    name: str
    stage: str
    channel: str | None
    statement: str
    equation: str
    reference: str
    parameters: list[EffectEstimate]
    equivalent_to: Annotated[list[str], "effects that this recording cannot tell from it"]
    rejected: list[RejectedEffect]
    evidence: EffectEvidence


class LawPlace(TypedDict):
    """Where a law acts."""

    kind: Annotated[str, "output or state"]
    channel: str


class LawCurve(TypedDict):
    """A law of one signal over what was recorded."""

    x: list[float]
    y: list[float]
    band95: Annotated[list[list[float]], "lower and upper ends of a 95 % band"]
    unit: str


class ResembledEffect(TypedDict):
    """A known effect that a law is like."""

    name: str
    distance: Annotated[float, "share of the law's response that is left beside the effect's"]


class LawEvidence(TypedDict):
    """What speaks for a law."""

    held_out_log_score_gain: Annotated[float | None, "null of what explains and does not predict"]
    p_value: float
    share_of_gap: Annotated[float, "of the mean square that it takes"]


class DiagnosedLaw(TypedDict):
    """A law of what no known effect explains."""

    place: LawPlace
    form: Annotated[str, "static, mode, loop, event or tone"]
    acts: Annotated[str, "adds or multiplies"]
    variables: list[str]
    memory_s: float | None
    formula: Annotated[str | None, "null of a curve"]
    parameters: list[EffectEstimate]
    curve: LawCurve | None
    range: Annotated[dict[str, list[float]], "recorded range of each variable"]
    resembles: list[ResembledEffect]
    confounded_with: Annotated[list[str], "parameters that moved far because of it"]
    evidence: LawEvidence


class NominalParameter(TypedDict):
    """A parameter of the simulation, before and after it was fitted."""

    name: str
    before: float | None
    after: float | None
    unit: str
    prior_sd: float | None
    shift_in_sd: float | None


class ChannelNoise(TypedDict):
    """The noise of a channel, divided."""

    sensor_sd: float | None
    process_sd: float | None
    how: str


class HeldOutChannel(TypedDict):
    """How well a channel is predicted in runs that no fit has seen."""

    channel: str
    unit: str
    nominal_rmse: float | None
    refitted_rmse: float | None
    augmented_rmse: Annotated[float | None, "with the effects that are named"]
    noise_floor: float | None
    with_laws_rmse: Annotated[float | None, "with the laws of what has no name too"]
    noise: ChannelNoise | None


class HeldOutFit(TypedDict):
    """How well the channels are predicted."""

    held_out_by: str | None
    held_out: list[HeldOutChannel]


class Dependence(TypedDict):
    """What an unexplained remainder depends on."""

    channel: str
    variables: list[str]


class AbsentEffect(TypedDict):
    """An effect that was not found, and how large it would have had to be."""

    name: str
    minimum_detectable: float | None
    unit: str
    observable: bool
    why: str


class DiagnosisEntries(TypedDict):
    """Why a simulation and a recording differ."""

    title: str
    case_sha256: str
    recordings: list[DiagnosedRecording] | None
    verdict: Annotated[str, "named, equivalent, unknown, nothing or untestable"]
    remaining: Annotated[str, "what is left unexplained"]
    complete: Annotated[bool, "whether the search ended by itself"]
    skipped: list[str]
    mismatch: list[ChannelMismatch]
    effects: list[DiagnosedEffect]
    laws: Annotated[list[DiagnosedLaw], "of what has no name"]
    nominal_parameters: list[NominalParameter]
    fit: HeldOutFit
    depends_on: list[Dependence]
    not_found: list[AbsentEffect]
    next_measurements: Annotated[list[str], "what to measure next"]
    findings: list[FindingEntry]


def as_json(diagnosis: Diagnosis) -> DiagnosisEntries:
    """Return the answer as the contract has it, without ``schema`` and ``timing``."""
    entries = entry_of(
        DiagnosisEntries, diagnosis,
        mismatch=[_mismatch(mismatch) for mismatch in diagnosis.mismatch],
        effects=[_effect(effect) for effect in diagnosis.effects],
        laws=[_law(law) for law in diagnosis.laws],
        fit=entry_of(HeldOutFit, diagnosis),
        depends_on=[{"channel": channel, "variables": names} for channel, names in diagnosis.depends_on],
    )  # fmt: skip
    return cast("DiagnosisEntries", json_value(entries))


def _mismatch(mismatch: Mismatch) -> ChannelMismatch:
    return entry_of(ChannelMismatch, mismatch, where=[_place(place) for place in mismatch.where])


def _place(place: Place) -> MismatchPlace:
    return entry_of(MismatchPlace, place, **{"from": place.start, "to": place.end})


def _effect(effect: FoundEffect) -> DiagnosedEffect:
    return entry_of(
        DiagnosedEffect, effect,
        rejected=[{"name": name, "log_likelihood_less": -value} for name, value in effect.rejected],
        evidence=entry_of(EffectEvidence, effect),
    )  # fmt: skip


def _law(law: FoundLaw) -> DiagnosedLaw:
    curve = law.curve
    return entry_of(
        DiagnosedLaw, law,
        place=entry_of(LawPlace, law),
        curve=None if curve is None else entry_of(LawCurve, curve, band95=[curve.low, curve.high]),
        range={name: [start, end] for name, start, end in law.ranges},
        resembles=[{"name": name, "distance": distance} for name, distance in law.resembles],
        evidence=entry_of(LawEvidence, law),
    )  # fmt: skip
