"""Indications as they were recorded -> as they are fitted: the unit of the fit, and the zero of each run.

A bridge is ratiometric: its output is proportional to its excitation, so that only the ratio mV/V belongs
to the cell. What a file holds may be

- mV/V: taken as it is, an excitation is only recorded;
- volts (mV, µV) with a stated excitation: mV/V = mV / V;
- a digitiser's counts with a stated scale, ``{ value, unit }`` of one count (``mV/V`` or ``mV/V/count``,
  or mV, lbf ...): value x counts, in the scale's unit; volts go on to mV/V where there is an excitation.

A column without such a statement keeps its own unit. A scale without a unit is recorded, never guessed
and never applied. The stored file stays as it was recorded: the same factors are applied when it is read
back, so that a record is refitted from the raw bytes.

With ``zero = "run"`` the zero of each run is taken off. Bridges that are not tared before every run, or that
drift between runs, leave each run with another zero. It is the run's own unknown in a plane of the
indications over the loads, the same plane for all runs:

    x_i = B load_i + zero_r,   r the run of row i

by least squares over all rows. Runs need no row at zero load for it; check loads do, since a zero that was
computed from a check load would agree with whatever it reads.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.session.session_file import Amount, CellEntries, Stated, StatedEntries
from toolkit.errors import SessionError
from toolkit.units import si_scale, unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.table import Table


RATIO = "mV/V"
COUNT_DIMENSION, RATIO_DIMENSION = "count", "bridge_ratio"
_PER_COUNT = re.compile(r"\s*/\s*counts?\s*\Z")
# Of the largest load: what a standard reads of nothing.
_UNLOADED = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Bridge:
    """What is stated of one indication's electrics.

    ``excitation_V`` [V] and ``scale`` (number, unit) of one count are None where not stated.
    """

    name: str
    where: str
    excitation_V: float | None = None
    scale: tuple[float, str] | None = None

    def unit(self, column: str) -> str:
        """Return the unit in which a column is fitted."""
        text = column
        if self.scale is not None and unit(column).dimension == COUNT_DIMENSION:
            text = self.scale[1]
        return RATIO if self.excitation_V is not None and _is_voltage(text) else text

    def factor(self, text: str, target: str, *, where: object) -> float:
        """Return the factor from one unit to another, by scale and excitation where they are needed.

        Raises
        ------
        UnitError
            nothing stated leads from the one dimension to the other
        """
        if text == target:
            return 1.0
        stated, expected = unit(text, where=where), unit(target)
        if stated.dimension != expected.dimension:
            if stated.dimension == COUNT_DIMENSION and self.scale is not None:
                # The scale first: counts x scale stays exact where the scale's unit is the target.
                return self.scale[0] * self.factor(self.scale[1], target, where=where)
            if (
                expected.dimension == RATIO_DIMENSION
                and self.excitation_V is not None
                and _is_voltage(stated.text)
            ):
                return stated.factor / expected.factor / self.excitation_V
        return si_scale(text, expected.dimension, where=where) / expected.factor

    def stated(self, entry: Stated, key: str, *, column: str, target: str) -> float:
        """Return a number in the target unit: ``{ value, unit }``, or a bare number in the column's unit.

        Raises
        ------
        UnitError
            its unit is unknown, or of a dimension that does not lead to the target
        """
        text, value = (entry.unit, entry.value) if isinstance(entry, Amount) else (column, entry)
        return value * self.factor(text, target, where=f"{self.where}: {key}")


def bridge_of(name: str, cell: CellEntries, *, where: object) -> Bridge:
    """Return what excitation and scale of ``[cells.NAME]`` say.

    Raises
    ------
    UnitError
        the scale is in a unit that a bridge cannot have
    """
    scale = _scale(cell.scale, f"{where}: cells.{name}.scale") if isinstance(cell.scale, Amount) else None
    excitation = None if cell.excitation is None else float(cell.excitation)
    return Bridge(name=name, where=str(where), excitation_V=excitation, scale=scale)


def bridges_of(entries: StatedEntries, indications: Sequence[str], *, where: object) -> dict[str, Bridge]:
    """Return the bridges of indications by name, from a session's ``[cells]``."""
    return {name: bridge_of(name, entries.cell(name), where=where) for name in indications}


def fit_units(table: Table, bridges: Mapping[str, Bridge]) -> dict[str, str]:
    """Return the unit in which each indication of a table is fitted."""
    return {name: bridge.unit(table.unit(name)) for name, bridge in bridges.items()}


def converted(
    table: Table, bridges: Mapping[str, Bridge], units: Mapping[str, str], *, where: object
) -> Table:
    """Return the table with its indications in the given units; other columns are as they were.

    A file in another unit than the fit's data is converted by its own: check loads may be in counts where
    the fit's data are in mV.

    Raises
    ------
    UnitError
        nothing stated leads from a column's unit to the one wanted
    """
    factors = {
        name: bridge.factor(table.unit(name), units[name], where=f"{where}, column {name}")
        for name, bridge in bridges.items()
    }
    return table.scaled(factors, units)


def per(text: str, suffix: re.Pattern[str] = _PER_COUNT) -> str:
    """Return a unit without its "per count".

    >>> per("mV/V/count"), per("mV/V")
    ('mV/V', 'mV/V')
    """
    return suffix.sub("", text)


def _scale(entry: Amount, where: str) -> tuple[float, str]:
    scale = unit(per(entry.unit), where=where)
    if not (scale.dimension in (RATIO_DIMENSION, "force", "moment") or _is_voltage(scale.text)):
        si_scale(scale.text, RATIO_DIMENSION, where=where)
    return entry.value, scale.text


def _is_voltage(text: str) -> bool:
    return unit(text).dimension == "voltage"


def without_run_zeros(table: Table, indications: Sequence[str], loads: Sequence[str]) -> Table:
    """Return reference loads with the zero of each run taken off its indications."""
    run = _runs(table)
    applied = table.matrix(loads)
    size = np.abs(applied).max(axis=0)
    design = _off_means(applied / np.where(size > 0, size, 1.0), run)
    cells = table.matrix(indications)
    plane = np.linalg.lstsq(design, _off_means(cells, run), rcond=None)[0]
    # Of a run that loads one axis alone, the plane of all runs tells what that load makes.
    zeros = _means(cells - (applied / np.where(size > 0, size, 1.0)) @ plane, run)
    return _less(table, indications, zeros[run])


def without_read_zeros(
    check: Table, indications: Sequence[str], loads: Sequence[str], where: object
) -> Table:
    """Return check loads with the zero of each run, as its rows at zero load read it, taken off.

    Raises
    ------
    SessionError
        ``zero``: a run without a row at zero load
    """
    run = _runs(check)
    applied = check.matrix(loads)
    size = np.abs(applied).max(axis=0)
    unloaded = (np.abs(applied) <= _UNLOADED * size).all(axis=1)
    missing = sorted(set(run.tolist()) - set(run[unloaded].tolist()))
    if missing:
        run_text = "" if check.run is None else f" of run {np.unique(check.run)[missing[0]]:g}"
        raise SessionError(
            f'the check loads{run_text} have no zero, and with zero = "run" each run has its own',
            where=where, got="no row with every load at zero",
            expected="at least one row at zero load in each run of the check file",
            next_step="read the unloaded cells with the check loads and add that row; nothing was written",
            rule="zero",
        )  # fmt: skip
    cells = check.matrix(indications)
    return _less(check, indications, _means(cells[unloaded], run[unloaded])[run])


def _runs(table: Table) -> NDArray[np.int64]:
    run = np.zeros(table.rows) if table.run is None else table.run
    return np.asarray(np.unique(run, return_inverse=True)[1].ravel(), dtype=np.int64)


def _means(values: Array, run: NDArray[np.int64]) -> Array:
    count = np.bincount(run)[:, None]
    return np.stack([np.bincount(run, weights=column) for column in values.T], axis=1) / count


def _off_means(values: Array, run: NDArray[np.int64]) -> Array:
    return np.asarray(values - _means(values, run)[run])


def _less(table: Table, names: Sequence[str], zeros: Array) -> Table:
    values = table.values.copy()
    values[:, [table.names.index(name) for name in names]] -= zeros
    return dataclasses.replace(table, values=values)
