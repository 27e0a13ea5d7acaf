"""The summary of a test: its characteristics at one load, for the first page of a report or a workbook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import summary

if TYPE_CHECKING:
    from toolkit.characteristics.model import Characteristics
    from toolkit.estimate import Estimate

_SAME_LOAD = 0.04  # loads within this part of a summary's load are its load


def summary_load(characteristics: Characteristics, rated_load_N: float | None) -> float | None:
    """Return the load of the summary [N]: the one nearest the rated load, else the middle one."""
    loads = characteristics.loads_N
    if not loads:
        return None
    if rated_load_N:
        return min(loads, key=lambda load: abs(load - rated_load_N))
    return loads[len(loads) // 2]


def summary_estimates(
    characteristics: Characteristics, rated_load_N: float | None
) -> dict[str, Estimate | None]:
    """Return the values of the summary by their names, in printed units; of directions the forward run."""
    load = summary_load(characteristics, rated_load_N)
    estimates: dict[str, Estimate | None] = {}
    for characteristic in summary():
        rotation = "forward" if characteristic.scope == "direction" else None
        rows = characteristics.of(characteristic.name, rotation=rotation)
        near = (row for row in rows if load is not None and abs(row.load_N - load) <= _SAME_LOAD * load)
        row = next(near, None)
        estimate = None if row is None else row.estimate
        estimates[str(characteristic.summary)] = (
            None if estimate is None else estimate.scaled(characteristic.factor, "")
        )
    return estimates
