"""The answer to a case: verdict, mismatch, effects, fits, and what could not have been seen.

`declared.json_value` writes it as ``diagnosis.json`` holds it, and `answer.reader` reads it back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from toolkit.declared import Entry, Keyed, OrNan, derived
from toolkit.diagnosis.fit.sensor_noise import ChannelNoise
from toolkit.effects.applied import EffectKey
from toolkit.effects.facts import Second
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Run

LAWS_STEP = "laws"
"""The step of a search, among those skipped, that looks for laws of what has no name."""
Verdict = Literal["named", "equivalent", "unknown", "nothing", "untestable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedRecording:
    """A recording of a case."""

    name: str
    sha256: str
    own: Annotated[bool, Entry("whether the virtual machine recorded it")]


@dataclass(frozen=True, slots=True, kw_only=True)
class MismatchPlace:
    """Where a channel departs from the simulation.

    A range of a channel or of time, or twice the value of a condition. ``whole`` says that the range is all
    that was recorded: the mismatch is everywhere.
    """

    variable: str
    start: Annotated[float | str | None, Entry(key="from")]
    end: Annotated[float | str | None, Entry(key="to")]
    unit: str
    runs: tuple[str, ...]
    whole: Annotated[bool, Entry(output=False)] = False

    def ends(self, number: Callable[[float], str]) -> str:
        """Return the ends of a range, each as ``number`` writes it; a condition's one value as it stands."""
        if isinstance(self.start, float) and isinstance(self.end, float):
            return f"{number(self.start)} to {number(self.end)}"
        return str(self.start)

    def over(self, channel: str) -> str:
        """Return the variable in words: of a mismatch of the channel itself the range is that simulated."""
        return f"the simulated {channel}" if self.variable == channel else self.variable


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelMismatch:
    """How far a channel departs from the simulation."""

    channel: str
    p_value: OrNan
    share_of_variance: Annotated[OrNan, Entry("of the refitted residual")]
    where: tuple[MismatchPlace, ...]

    @property
    def untested(self) -> bool:
        """Tell whether no test parts the rest from noise: it counts by its size."""
        return not self.p_value < 1


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectEstimate:
    """A parameter of an effect that a diagnosis names."""

    name: str
    value: Annotated[OrNan | str, Entry("a text where the parameter is a name")]
    unit: str
    ci95: Annotated[tuple[OrNan, OrNan] | None, Entry("interval for a coverage of 95 %")]
    runs: Annotated[tuple[str, ...] | None, Entry("in which it acts; null for all")]


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedEffect:
    """An effect that explains less."""

    name: str
    log_likelihood_less: Annotated[OrNan, Entry("at most: one that is far behind is not fitted to its end")]


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectEvidence:
    """What speaks for an effect."""

    held_out_log_score_gain: Annotated[OrNan, Entry("on runs that no fit has seen")]
    p_value: Annotated[OrNan, Entry("against the chance of the whole search")]


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedEffect:
    """An effect that a diagnosis names."""

    name: str
    stage: str
    channel: Annotated[str | None, Entry("or state that it acts on")]
    statement: str
    equation: str
    reference: str
    parameters: tuple[EffectEstimate, ...]
    equivalent_to: Annotated[
        tuple[str, ...],
        Entry("effects, last a parameter of the simulation, that this recording cannot tell from it"),
    ]
    rejected: Annotated[tuple[RejectedEffect, ...], Entry("the nearest first")]
    evidence: EffectEvidence

    def __post_init__(self) -> None:
        """Put the nearest rival first, in older answers too: whoever cuts the list drops the farthest."""
        nearest = sorted(self.rejected, key=lambda other: other.log_likelihood_less)
        object.__setattr__(self, "rejected", tuple(nearest))

    @property
    def key(self) -> EffectKey:
        """Its identity; its source and its runs stand among its parameters."""
        words = {one.name: one.value for one in self.parameters if isinstance(one.value, str)}
        runs = self.parameters[0].runs if self.parameters else None
        return EffectKey(
            name=self.name, channel=self.channel,
            source=next((words[word] for word in get_args(Second) if word in words), None),
            runs=None if runs is None else frozenset(runs),
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class LawPlace:
    """Where a law acts."""

    kind: Literal["output", "state", "input"]
    channel: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCurve:
    """A law of one signal over what was recorded."""

    x: tuple[OrNan, ...]
    y: tuple[OrNan, ...]
    band95: Annotated[
        tuple[tuple[OrNan, ...], tuple[OrNan, ...]], Entry("lower and upper ends of a 95 % band")
    ]
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ResembledEffect:
    """A known effect that a law is like."""

    name: str
    distance: Annotated[OrNan, Entry("share of the law's response that is left beside the effect's")]


@dataclass(frozen=True, slots=True, kw_only=True)
class LawEvidence:
    """What speaks for a law."""

    held_out_log_score_gain: Annotated[float | None, Entry("null of what explains and does not predict")]
    p_value: OrNan
    share_of_gap: Annotated[OrNan, Entry("of the mean square that it takes")]


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedLaw:
    """A law of what no known effect explains."""

    place: LawPlace
    form: Annotated[str, Entry("static, mode, loop, event or tone")]
    acts: Annotated[Literal["adds", "multiplies"], Entry("an output, or the rate of a state")]
    variables: tuple[str, ...]
    memory_s: float | None
    formula: Annotated[str | None, Entry("null of a curve")]
    parameters: tuple[EffectEstimate, ...]
    curve: LawCurve | None
    ranges: Annotated[
        tuple[tuple[str, tuple[OrNan, OrNan]], ...],
        Keyed(),
        Entry("recorded range of each variable", key="range"),
    ]
    resembles: tuple[ResembledEffect, ...]
    confounded_with: Annotated[tuple[str, ...], Entry("parameters that moved far because of it")]
    evidence: LawEvidence

    @property
    def sentence(self) -> str:
        """What it says, for people."""
        channel = self.place.channel
        place = f"{channel} = {channel}_model"
        law = self.formula or f"a curve of {' and '.join(self.variables)}"
        if self.place.kind == "state":
            text = f"in the equation of {channel}: d{channel}/dt = ... + {law}"
        elif self.place.kind == "input":
            text = f"{channel} of the tire * (1 + {law})"
        elif self.acts == "multiplies":
            text = f"{place} * (1 + {law})"
        else:
            text = f"{place} + {law}"
        runs = self.parameters[0].runs if self.parameters else None
        text += f", in {' and '.join(runs)} alone" if runs is not None else ""
        explains_alone = self.evidence.held_out_log_score_gain is None
        return f"{text}; it explains, not predicts" if explains_alone else text

    @property
    def likeness(self) -> str:
        """Which known effects it is like, for people; nothing where it is like none."""
        near = ", ".join(f"{each.name} ({each.distance:.2f})" for each in self.resembles)
        return f"resembles {near}: 0 is the same, 1 nothing alike" if near else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalParameter:
    """A parameter of the simulation, before and after it was fitted."""

    name: str
    before: OrNan
    after: OrNan
    unit: str
    prior_sd: float | None
    with_laws: Annotated[
        float | None, Entry("beside the laws, as in model.toml; null where none was fitted")
    ] = None

    @property
    @derived("how far it moved, in its prior's standard deviation")
    def shift_in_sd(self) -> float | None:
        """How far it moved, in its prior's standard deviation."""
        return None if not self.prior_sd else (self.after - self.before) / self.prior_sd


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutChannel:
    """How well a channel is predicted in runs that no fit has seen.

    Root mean square errors, in the unit of the channel; ``with_laws_rmse`` is None without any law.
    """

    channel: str
    unit: str
    nominal_rmse: OrNan
    refitted_rmse: OrNan
    augmented_rmse: Annotated[OrNan, Entry("with the effects that are named")]
    noise_floor: OrNan
    with_laws_rmse: Annotated[float | None, Entry("with the laws of what has no name too")] = None
    noise: Annotated[ChannelNoise | None, Entry("null where no fit was made, and in older answers")] = None
    spread: Annotated[
        float | None, Entry("standard deviation of what was recorded of it; null as of `noise`")
    ] = None

    @property
    def sensor_sd(self) -> float | None:
        """What the sensor has from row to row, or as it is stated; None where no fit was made."""
        return None if self.noise is None else self.noise.sensor_sd

    @property
    def is_slow(self) -> bool:
        """Tell whether most of what is left is slower than the sensor's noise."""
        return self.noise is not None and self.noise.process_sd > self.noise.sensor_sd


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutFit:
    """How well the channels are predicted."""

    held_out_by: str
    held_out: tuple[HeldOutChannel, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dependence:
    """What an unexplained remainder depends on; where no variable foretells it, why it is no noise."""

    channel: str
    variables: tuple[str, ...]
    reason: Annotated[str, Entry("why something is left though no variable foretells it")] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class AbsentEffect:
    """An effect that was not found, and how large it would have had to be."""

    name: str
    minimum_detectable: Annotated[
        float | None, Entry("the smallest size that this recording would have shown, 80 % power")
    ]
    unit: str
    observable: bool
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Why a simulation and a recording differ."""

    title: str
    case_sha256: str
    recordings: Annotated[
        tuple[DiagnosedRecording, ...] | None, Entry("null in an answer of a version that did not name them")
    ] = None
    verdict: Verdict
    remaining: Annotated[Literal["nothing", "unknown"], Entry("what is left unexplained")]
    complete: Annotated[bool, Entry("whether the search ended by itself")]
    skipped: tuple[str, ...]
    mismatch: tuple[ChannelMismatch, ...]
    effects: tuple[DiagnosedEffect, ...]
    laws: Annotated[tuple[DiagnosedLaw, ...], Entry("of what has no name")] = ()
    nominal_parameters: tuple[NominalParameter, ...]
    fit: HeldOutFit
    depends_on: tuple[Dependence, ...]
    not_found: tuple[AbsentEffect, ...]
    next_measurements: Annotated[tuple[str, ...], Entry("what to measure next")]
    findings: tuple[Finding, ...]


def cut_short(skipped: Sequence[str]) -> bool:
    """Tell whether a search ended before every known effect was tried; what comes later leaves names."""
    return any(step not in ("swaps", "predictions", LAWS_STEP) for step in skipped)


def untested(skipped: Sequence[str]) -> tuple[str, ...]:
    """Return the steps skipped that may still take a name away; predictions do not."""
    return tuple(step for step in skipped if step != "predictions")


def only_runs_differ(diagnosis: Diagnosis) -> bool:
    """Tell whether all that is left without a name are zeros and gains of the runs."""
    bare = diagnosis.verdict == "unknown" and not diagnosis.laws and not diagnosis.skipped
    return (
        bare and bool(diagnosis.depends_on) and all(by.variables == ("run",) for by in diagnosis.depends_on)
    )


def recorded(runs: Iterable[Run]) -> tuple[DiagnosedRecording, ...]:
    """Return what an answer says of the recordings of a case."""
    return tuple(DiagnosedRecording(name=run.name, sha256=run.sha256, own=run.own) for run in runs)
