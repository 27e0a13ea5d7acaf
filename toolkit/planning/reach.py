"""How near a design comes to a demand: U of what it names, in the direction in which it is known least."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.planning.demands import PEAK, Demand

if TYPE_CHECKING:
    from toolkit.characteristics.model import Row
    from toolkit.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """The uncertainty that a design has of one demand at one load, in the direction in which it is largest.

    ``value``, ``u``, ``U`` [unit], ``dof``; ``limit`` is what was demanded; ``sources`` the budget; ``tire``
    that of a class.
    """

    demand: Demand
    load_N: float
    rotation: str
    SA_rad: float | None
    value: float
    u: float
    U: float
    dof: float
    unit: str
    limit: float
    sources: tuple[tuple[str, float], ...]
    tire: str = ""

    @property
    def ratio(self) -> float:
        """U over what was demanded."""
        return self.U / self.limit if self.limit > 0 else math.inf


def is_of(row: Row, demand: Demand, load_N: float) -> bool:
    """Tell whether a row is what a demand names, at the load of its curve [N]."""
    if row.name != demand.characteristic or row.load_N != load_N:
        return False
    return demand.SA_rad is None or (row.SA_rad is not None and abs(row.SA_rad - demand.SA_rad) < 1e-9)


def worst(demand: Demand, rows: Sequence[Row], load_N: float, otherwise: float) -> Reach | None:
    """Return the row of a demand that is furthest from it; None where there is none.

    Parameters
    ----------
    load_N : the nominal load
    otherwise : the limit of a demand that states none
    """
    read = [(row, row.estimate) for row in rows if row.estimate is not None]
    if demand.name == PEAK:
        read = _peaks(read)
    reaches = [
        Reach(
            demand=demand, load_N=load_N, rotation=row.rotation, SA_rad=row.SA_rad, value=estimate.value,
            u=estimate.u, U=estimate.expanded()[0], dof=estimate.dof, unit=estimate.unit,
            limit=otherwise if demand.open else demand.limit(estimate.value), sources=row.number.by_source(),
        )
        for row, estimate in read
    ]  # fmt: skip
    return max(reaches, key=lambda reach: (reach.ratio, reach.U), default=None)


def _peaks(read: Sequence[tuple[Row, Estimate]]) -> list[tuple[Row, Estimate]]:
    """Return of each direction and side of zero the row with the largest force."""
    peaks: dict[tuple[str, bool], tuple[Row, Estimate]] = {}
    for row, estimate in read:
        key = (row.rotation, (row.SA_rad or 0.0) > 0)
        if row.SA_rad and (key not in peaks or abs(estimate.value) > abs(peaks[key][1].value)):
            peaks[key] = (row, estimate)
    return list(peaks.values())
