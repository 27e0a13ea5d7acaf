"""The answer to a case: verdict, mismatch, effects, fits, and what could not have been seen."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.fit.sensor_noise import NoiseParts
    from toolkit.effects.applied import EffectKey

LAWS_STEP = "laws"
"""The step of a search, among those skipped, that looks for laws of what has no name."""
Verdict = Literal["named", "equivalent", "unknown", "nothing", "untestable"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where a mismatch is: a range of a channel, of time, or the value of a condition.

    ``whole`` says that the range is all that was recorded: the mismatch is everywhere.
    """

    variable: str
    start: float | str | None
    end: float | str | None
    unit: str
    runs: tuple[str, ...]
    whole: bool = False

    def ends(self, number: Callable[[float], str]) -> str:
        """Return the ends of a range, each as ``number`` writes it; a condition's one value as it stands."""
        if isinstance(self.start, float) and isinstance(self.end, float):
            return f"{number(self.start)} to {number(self.end)}"
        return str(self.start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mismatch:
    """One output that the refitted simulation does not explain; share of the refitted residual's variance."""

    channel: str
    p_value: float
    share_of_variance: float
    where: tuple[Place, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundParameter:
    """A fitted parameter with its 95 % interval; a text where the parameter is a name."""

    name: str
    value: float | str
    unit: str
    ci95: tuple[float, float] | None
    runs: tuple[str, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundEffect:
    """An effect that explains a mismatch, and the names that explain it as well."""

    key: EffectKey
    stage: str
    statement: str
    equation: str
    reference: str
    parameters: tuple[FoundParameter, ...]
    equivalent_to: tuple[str, ...]
    rejected: tuple[tuple[str, float], ...]
    held_out_log_score_gain: float
    p_value: float

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.key.name

    @property
    def channel(self) -> str | None:
        """Channel or state that it acts on."""
        return self.key.channel


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCurve:
    """A law of one signal as it runs over what was recorded, with its 95 % band; lists of one length."""

    x: tuple[float, ...]
    y: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundLaw:
    """What structure without a name is answered by: where it acts, on what it depends, and how.

    ``kind`` is that of its place, an output or the equation of a state. ``formula`` is None of a curve that
    no formula fits; ``held_out_log_score_gain`` None of what explains and does not predict.
    ``confounded_with`` are nominal parameters that moved far because of it; ``resembles`` known effects like
    it, with the share of its response that is left beside each.
    """

    kind: Literal["output", "state"]
    channel: str
    form: str
    acts: Literal["adds", "multiplies"]
    variables: tuple[str, ...]
    memory_s: float | None
    formula: str | None
    parameters: tuple[FoundParameter, ...]
    curve: LawCurve | None
    ranges: tuple[tuple[str, float, float], ...]
    resembles: tuple[tuple[str, float], ...]
    confounded_with: tuple[str, ...]
    held_out_log_score_gain: float | None
    p_value: float
    share_of_gap: float

    @property
    def sentence(self) -> str:
        """What it says, for people."""
        place = f"{self.channel} = {self.channel}_model"
        law = self.formula or f"a curve of {' and '.join(self.variables)}"
        if self.kind == "state":
            text = f"in the equation of {self.channel}: d{self.channel}/dt = ... - ({law})"
        elif self.acts == "multiplies":
            text = f"{place} * (1 + {law})"
        else:
            text = f"{place} + {law}"
        runs = self.parameters[0].runs if self.parameters else None
        text += f", in {' and '.join(runs)} alone" if runs is not None else ""
        return text if self.held_out_log_score_gain is not None else f"{text}; it explains, not predicts"


@dataclass(frozen=True, slots=True, kw_only=True)
class NominalParameter:
    """A parameter of the simulation before and after the fit."""

    name: str
    before: float
    after: float
    unit: str
    prior_sd: float | None

    @property
    def shift_in_sd(self) -> float | None:
        """How far it moved, in its prior's standard deviation."""
        return None if not self.prior_sd else (self.after - self.before) / self.prior_sd


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOutFit:
    """Root mean square errors of an output on rows that no fit has seen, in its unit.

    ``with_laws_rmse`` has the laws of what has no name in it, None without any. ``noise`` parts the sensor's
    noise from the process's; None where no fit was made, and in older answers.
    """

    channel: str
    unit: str
    nominal_rmse: float
    refitted_rmse: float
    augmented_rmse: float
    noise_floor: float
    noise: NoiseParts | None = None
    with_laws_rmse: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NotFound:
    """An effect that was not found: the smallest size that this recording would have shown, 80 % power."""

    name: str
    minimum_detectable: float | None
    unit: str
    observable: bool
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recording that the answer rests on: its file's name and SHA-256.

    ``own`` tells a file as the machine's acquisition program wrote it from a table made for the case.
    """

    name: str
    sha256: str
    own: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """The whole answer; ``recordings`` is None in one of a version that did not write them down."""

    title: str
    case_sha256: str
    verdict: Verdict
    remaining: Literal["nothing", "unknown"]
    mismatch: tuple[Mismatch, ...]
    effects: tuple[FoundEffect, ...]
    nominal_parameters: tuple[NominalParameter, ...]
    held_out: tuple[HeldOutFit, ...]
    held_out_by: str
    depends_on: tuple[tuple[str, tuple[str, ...]], ...]
    not_found: tuple[NotFound, ...]
    next_measurements: tuple[str, ...]
    findings: tuple[Finding, ...]
    complete: bool
    skipped: tuple[str, ...]
    recordings: tuple[Recorded, ...] | None = None
    laws: tuple[FoundLaw, ...] = ()


def cut_short(skipped: Sequence[str]) -> bool:
    """Tell whether a search ended before every known effect was tried; what comes later leaves names."""
    return any(step not in ("swaps", "predictions", LAWS_STEP) for step in skipped)


def only_runs_differ(diagnosis: Diagnosis) -> bool:
    """Tell whether all that is left without a name are zeros and gains of the runs."""
    bare = diagnosis.verdict == "unknown" and not diagnosis.laws and not diagnosis.skipped
    return bare and bool(diagnosis.depends_on) and all(by == ("run",) for _, by in diagnosis.depends_on)


def recorded(runs: Iterable[Run]) -> tuple[Recorded, ...]:
    """Return what an answer says of the recordings of a case."""
    return tuple(Recorded(name=run.name, sha256=run.sha256, own=run.own) for run in runs)
