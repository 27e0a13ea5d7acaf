"""What every kind of simulation offers to the search."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import CaseParameter, Run
    from toolkit.effects.applied import AppliedEffect
    from toolkit.effects.effect import Effect

    Arrays = dict[str, NDArray[np.float64]]
    # Positions of shape (n,) to force-like terms of shape (n, forces)
    Pattern = Callable[[NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """A channel that is judged: name, unit, and its stated total sensor noise."""

    name: str
    unit: str
    sd: float | None


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

    def simulate(self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> Arrays:
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
        active: Sequence[AppliedEffect],
        channel: str | None,
        pattern: Pattern,
        /,
    ) -> Arrays:
        """Return linear responses of every output to small forces, (rows, forces); none where none move."""
        ...
