"""Answers on simulations and plans, as types: `simulate`, `diagnose` and the planners."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NotRequired, TypedDict

from toolkit.declared.answers import merged
from toolkit.findings import FindingEntry
from toolkit.lab.document_answer_types import DeliveredDocument, Timed
from toolkit.lab.tire_answer_types import DraftKeys
from toolkit.planning.interval import IntervalPlan
from toolkit.planning.next_run_plan import NextRunPlan
from toolkit.planning.protocol_plan import ProtocolPlan
from toolkit.planning.session_plan import SessionPlan


class EffectParameterValue(TypedDict):
    """A parameter of an effect that was simulated."""

    name: str
    value: float
    unit: str


SimulatedEffect = TypedDict(
    "SimulatedEffect",
    {
        "name": str,
        "stage": str,
        "channel": str | None,
        "parameters": list[EffectParameterValue],
        "record": NotRequired[Annotated[str, "of another calibration"]],
        "with": NotRequired[Annotated[str, "the other channel of an exchange"]],
        "from": NotRequired[Annotated[str, "where a leak comes from"]],
        "only": NotRequired[Annotated[Mapping[str, list[str]], "condition under which it acts"]],
    },
)
SimulatedEffect.__doc__ = "An effect that was simulated."


class SimulatedFiles(TypedDict):
    """What the virtual machine wrote."""

    out: Path
    simulated: Annotated[bool, "always true"]
    kind: Annotated[str, "test, session, table or model"]
    files: list[str]
    findings: list[FindingEntry]


class PlannedSimulation(SimulatedFiles):
    """What a plan was simulated with."""

    machine: str
    date: str
    seed: int
    effects: list[SimulatedEffect]


class AcquisitionProgram(TypedDict):
    """What the machine's own program computed by."""

    record: str | None
    negated: Annotated[list[str], "indications that it takes with the wrong sign"]


class SimulatedTest(PlannedSimulation):
    """A simulated test."""

    record: Annotated[str, "means or continuous"]
    recordings: list[str]
    truth: Annotated[str, "file of what was simulated"]
    acquisition_program: AcquisitionProgram
    csv: NotRequired[list[str]]
    case: NotRequired[Annotated[str, "case that `diagnose` reads"]]


class SimulatedSession(PlannedSimulation):
    """A simulated reference-load session."""

    session: str
    truth: Annotated[str, "file of what was simulated"]
    points: int
    check_points: int


class SimulatedTable(PlannedSimulation):
    """A maker's flat-surface table, simulated."""

    table: str
    axes: str


class SimulatedModel(SimulatedFiles):
    """Outputs of a diagnosis's model on inputs."""

    model_sha256: str
    case_sha256: str
    effects: Annotated[list[str], "effects in the model"]


SimulateForms = SimulatedTest | SimulatedSession | SimulatedTable | SimulatedModel


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
    log_likelihood_less: float | None


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


class DiagnoseAnswer(DraftKeys, Timed):
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
    model: Annotated[str | None, "file of the simulation with these effects in it"]
    document: NotRequired[DeliveredDocument]
    out: str


class _Sheet(Timed):
    document: NotRequired[DeliveredDocument]


class _SessionFiles(_Sheet):
    fixtures_refused: Annotated[Any, "fixtures that cannot be used, and why"]
    files: list[str]


class _IntervalKeys(_Sheet):
    instrument: str
    record: str
    in_use: Annotated[str | None, "interval, as its approval states it"]
    next: Annotated[str, "day of the next session"]
    method_2_days: Annotated[int | None, "what drift alone recommends"]
    assumptions: Annotated[list[str], "what it rests on"]
    findings: list[FindingEntry]


class _RunFiles(_Sheet):
    out: Path | None
    files: list[Path]
    findings: list[FindingEntry]


class _ProtocolFiles(_Sheet):
    out: Path | None
    files: Annotated[Mapping[str, Path], "by what they are for"]
    findings: list[FindingEntry]


PlanSessionAnswer = merged(SessionPlan, _SessionFiles)
PlanIntervalAnswer = merged(IntervalPlan, _IntervalKeys)
PlanNextAnswer = merged(NextRunPlan, _RunFiles)
PlanTestAnswer = merged(ProtocolPlan, _ProtocolFiles)
