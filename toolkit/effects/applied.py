"""An effect that is applied: which one, where, how large, in which runs; and what identifies it.

Simulation switches applied effects on, diagnosis searches for them, a model file and a machine's correction
carry them; all of them mean the same by one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, NamedTuple, NotRequired, Protocol, TypedDict

from toolkit.effects.effect import STAGES, Effect, EffectParameter, Stage

if TYPE_CHECKING:
    from toolkit.effects.surroundings import Surroundings

ORIGIN, SOURCE_ORIGIN = "_origin", "_origin_from"
"""Among the values: from where a channel's values are counted, and those of its source; else from zero.

An effect that acts about zero has it where the scale's zero is one of convention (degC): so it does the same
whatever the unit.
"""
Condition = tuple[str, tuple[str, ...]]
"""A condition's key, and its values in the runs in which an effect acts."""


class EffectKey(NamedTuple):
    """What tells effects of one hypothesis apart: name, place, and the names of the runs, None for all."""

    name: str
    channel: str | None = None
    source: str | None = None
    runs: frozenset[str] | None = None

    @property
    def label(self) -> str:
        """Name and place, as people read it.

        >>> EffectKey("crosstalk", "FY", "FZ").label, EffectKey("creep", "D51").label
        ('crosstalk FZ to FY', 'creep on D51')
        """
        if self.channel and self.source:
            return f"{self.name} {self.source} to {self.channel}"
        return self.name + (f" on {self.channel}" if self.channel else "")

    @property
    def dotted(self) -> str:
        """Name and place, as a plan and the name of a parameter have it: ``crosstalk.FZ.FY``, ``law.FY``."""
        name = self.name.partition(" ")[0]  # a law's is followed by its formula
        return ".".join(part for part in (name, self.source, self.channel) if part)


class Conditioned(Protocol):
    """A run: its name and its conditions."""

    @property
    def name(self) -> str:
        """Name of the recording."""
        ...

    @property
    def conditions(self) -> Mapping[str, str]:
        """Value of each condition by its key."""
        ...


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


@dataclass(frozen=True, slots=True, kw_only=True)
class AppliedEffect:
    """One effect of the catalogue at one place.

    ``channel`` is the signal or the state that it acts on, None for the whole machine; ``source`` the other
    signal that it takes, or the id of the record that replaces the named one. ``values`` are its parameters
    in their own units, with numbers of the computation that no fit moves among them; ``units`` is given where
    values are told in stated units. It acts in the runs of a ``condition``, else in those with the names
    ``runs``, None for all. One that is ``sized_as`` another of its form has that one's values.
    """

    effect: Effect
    channel: str | None = None
    source: str | None = None
    runs: frozenset[str] | None = None
    values: Mapping[str, float] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    condition: Condition | None = None
    sized_as: EffectKey | None = None

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def key(self) -> EffectKey:
        """What tells it from other effects: by this it is compared and looked up."""
        return EffectKey(self.effect.name, self.channel, self.source, self.runs)

    @property
    def searched(self) -> tuple[EffectParameter, ...]:
        """Parameters that a fit moves: none of an effect that is there or not, or is read off elsewhere."""
        fixed = self.effect.discrete or self.effect.from_digits or self.sized_as is not None
        return () if fixed else self.effect.parameters

    def form_uncertainty(self, parameter: EffectParameter) -> float:
        """Return the standard uncertainty of a size whose law may be off by a share of what it does.

        The share is a limit to both sides and nothing is known between them: GUM (JCGM 100) 4.3.7. A level
        that a sensor cannot pass is as certain as the clipped rows are. One that a state cannot pass has no
        bound here: the likelihood has a kink at every row that reaches it, and intervals of its curvature
        held the truth in 29 of 40 simulated tanks, where 95 % were promised.
        """
        if parameter.off is None:
            return 0.0
        if not math.isfinite(parameter.off):
            return 0.0 if self.effect.term is None else math.inf
        size = abs(self.values[parameter.name] - parameter.off)
        share = self.effect.form_error if self.effect.size_error is None else self.effect.size_error
        return share * size / math.sqrt(3)

    def log_prior(self, case: Surroundings) -> float:
        """Return how likely its size is before the recording speaks; 0 of an effect that is there or not."""
        return max(self._sizes(case), default=(0.0, 0.0))[1]

    def is_unusual(self, case: Surroundings, *, log_density: float) -> bool:
        """Tell whether it is larger than usual, and its density so far below that of its usual size."""
        largest = max(self._sizes(case), default=(0.0, 0.0, 0.0))
        return largest[0] > 1 and largest[1] < largest[2] - log_density

    def _sizes(self, case: Surroundings) -> list[tuple[float, float, float]]:
        """Return its sizes over the end of their usual range, their densities, and those of usual sizes.

        Of several the largest counts: the others may be absent.
        """
        sizes = []
        for parameter in self.searched:
            if parameter.off is None:
                continue
            low, high = parameter.typical
            ratio = self.values[parameter.name] / (1.0 if parameter.scale is None else parameter.scale(case))
            usual = math.sqrt(low * high) if low * high > 0 else high
            sizes.append(
                (
                    abs(ratio) / max(abs(low), abs(high)),
                    parameter.log_density(ratio),
                    parameter.log_density(usual),
                )
            )
        return sizes

    @property
    def numerics(self) -> dict[str, float]:
        """Numbers of the computation among the values."""
        return {name: value for name, value in self.values.items() if name not in self.effect.names}

    def acts_in(self, run: Conditioned) -> bool:
        """Tell whether it acts in a run."""
        return self.acts_under(run.conditions, run.name)

    def acts_under(self, conditions: Mapping[str, str], run: str | None = None) -> bool:
        """Tell whether it acts under the conditions of a run, or in the run of a name."""
        if self.condition is not None:
            return conditions.get(self.condition[0]) in self.condition[1]
        return self.runs is None or run in self.runs

    @property
    def history(self) -> str:
        """The words for what was before the first row, nothing for an uneventful past."""
        return next(
            (
                past.text
                for past in self.effect.histories
                if all(self.values.get(name) == value for name, value in past.values.items())
            ),
            "",
        )

    def as_text(self) -> str:
        """Return it in one line for people: name and place, values, where it acts."""
        parts = [f"{name} = {self.values[name]:g} {self.units[name]}" for name in self.effect.names]
        if self.effect.replaces_record:
            parts.append(f"record {self.source}")
        if self.condition is not None:
            parts.append(f"where {self.condition[0]} is {' or '.join(self.condition[1])}")
        return self.key.label + (f": {', '.join(parts)}" if parts else "")

    def as_dict(self) -> SimulatedEffect:
        """Return it as JSON values."""
        entry: SimulatedEffect = {
            "name": self.effect.name,
            "stage": self.effect.stage,
            "channel": self.channel,
            "parameters": [
                {"name": name, "value": self.values[name], "unit": self.units[name]}
                for name in self.effect.names
            ],
        }
        if self.source is not None:
            channel = self.effect.on_channel
            entry[(channel and channel.second) or "from"] = self.source
        if self.condition is not None:
            entry["only"] = {self.condition[0]: list(self.condition[1])}
        return entry


def in_order(effects: Iterable[AppliedEffect], stage: Stage | None = None) -> Sequence[AppliedEffect]:
    """Return effects in the order of the stages, of one ``stage`` or of all.

    Within a stage they act in the order in which they were given.
    """
    chosen = [applied for applied in effects if stage in (None, applied.effect.stage)]
    return sorted(chosen, key=lambda applied: STAGES.index(applied.effect.stage))


def acting(
    effects: Iterable[AppliedEffect], conditions: Mapping[str, str], stage: Stage | None = None
) -> Sequence[AppliedEffect]:
    """Return the effects that act under some conditions, in the order of the stages."""
    return in_order((applied for applied in effects if applied.acts_under(conditions)), stage)
