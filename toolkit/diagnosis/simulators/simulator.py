"""What every kind of simulation offers to the search, and an effect that is switched on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from toolkit.effects.effect import Effect, EffectParameter

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import CaseParameter, Run

    Arrays = dict[str, NDArray[np.float64]]
    # Positions of shape (n,) to force-like terms of shape (n, forces)
    Pattern = Callable[[NDArray[np.float64]], NDArray[np.float64]]


# Effects that are there or not: nothing of them is fitted.
DISCRETE = frozenset(("channel_sign", "channel_swap", "unit_error", "rectification", "wrong_calibration"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A channel that is judged: name, unit, and its stated total sensor noise."""

    name: str
    unit: str
    sd: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Active:
    """An effect that is switched on: where it acts, with which values, in which runs.

    ``channel`` is the channel or state that it acts on, ``source`` the other channel that it takes,
    ``runs`` the names of the runs in which it acts, None for all.
    """

    effect: Effect
    channel: str | None = None
    source: str | None = None
    runs: frozenset[str] | None = None
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def searched(self) -> tuple[EffectParameter, ...]:
        """Parameters that a fit moves: none of an effect that is there or not."""
        return () if self.effect.name in DISCRETE else self.effect.parameters

    def acts_in(self, run: Run) -> bool:
        """Tell whether the effect acts in a run."""
        return self.runs is None or run.name in self.runs


class Model(Protocol):
    """A simulation that can be run with effects in it.

    ``places`` says for an effect where it could act: pairs of channel and source. An effect without a
    place is not applicable to this case, and ``why_not`` says why.
    """

    outputs: tuple[Output, ...]
    parameters: tuple[CaseParameter, ...]

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output, (n,), NaN where a sample is missing."""
        ...

    def simulate(self, run: Run, p: Mapping[str, float], active: Sequence[Active]) -> Arrays:
        """Return what the simulation says of every output, (n,), free over the whole run."""
        ...

    def places(self, effect: Effect) -> Sequence[tuple[str | None, str | None]]:
        """Return where an effect could act in this case."""
        ...


@runtime_checkable
class Moving(Protocol):
    """A simulation in which something moves: what forces over a position would each do to its outputs."""

    def way(self, channel: str | None, /) -> tuple[float, float]:
        """Return the longest way of a run [position's unit] and the usual one from row to row."""
        ...

    def pushed(
        self,
        run: Run,
        p: Mapping[str, float],
        active: Sequence[Active],
        channel: str | None,
        pattern: Pattern,
        /,
    ) -> Arrays:
        """Return linear responses of every output to small forces, (rows, forces); none where none move."""
        ...
