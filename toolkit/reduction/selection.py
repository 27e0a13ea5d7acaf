"""Which rows of a measurement make one curve: those alike in all that its model does not read.

A model declares what it reads beside slip angle and load (`reads`). What else was recorded, longitudinal
slip, inclination, pressure, speed and temperature, moves a tire's forces too: rows in which it differs beyond
its scatter are rows of another curve, and no mean of two curves is a curve of the tire. They are parted here,
the one gate of reduced tests, of every model and every reader: the rows of one condition are kept, free
rolling, the most upright, at the pressure, the speed and the temperature of most rows; the others are left
out and named.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.errors import FitError
from toolkit.findings import Finding
from toolkit.units import from_si


@dataclass(frozen=True, slots=True, kw_only=True)
class _Variable:
    # ``gap``: no smaller step parts two levels; ``room``: how far rows of one level lie from its middle, None
    # where drift is part of every test. Both are parts of the value where ``relative``.
    gap: float
    room: float | None
    unit: str
    relative: bool = False
    zero: bool = False  # the level nearest zero is the condition that is meant, else that of most rows


_VARIABLES = {
    "KAPPA": _Variable(gap=0.005, room=0.01, unit="1", zero=True),
    "IA": _Variable(gap=np.radians(0.2), room=np.radians(0.5), unit="deg", zero=True),
    "P": _Variable(gap=0.02, room=0.05, unit="kPa", relative=True),
    "V": _Variable(gap=0.05, room=0.10, unit="km/h", relative=True),
    "T": _Variable(gap=5.0, room=None, unit="degC"),
}
CONDITIONS = tuple(_VARIABLES)
_CONTRAST = 2.5  # between the smallest gap that parts levels and the largest within one
_RESOLVED = 0.2  # of a gap: what is smaller is all alike
_LISTED = 6  # levels that are named each by itself


def parted(
    values: Array, *, gap: float, resolved: float, relative: bool = False
) -> tuple[NDArray[np.intp], ...]:
    """Return the rows of each level of a column (rows,), ascending in value, rows in their order.

    The sorted values' gaps fall into large ones (between levels) and small ones (within); the cut is where
    the ratio of neighbouring gaps is largest. Without a clear cut there is one level.

    Parameters
    ----------
    gap : a smaller one never parts two levels
    resolved : gaps below this are all alike
    relative : gaps are taken as parts of the value above them, which must not be negative

    >>> [rows.tolist() for rows in parted(np.array([0.0, 2.0, 0.1, 4.0]), gap=0.5, resolved=0.1)]
    [[0, 2], [1], [3]]
    """
    order = np.argsort(values, kind="stable")
    rising = values[order]
    if len(values) < 2 or (relative and rising[-1] <= 0):
        return (np.arange(len(values)),)
    gaps = np.diff(rising)
    if relative:
        gaps = gaps / np.maximum(rising[1:], 1e-9 * rising[-1])
    falling = np.sort(gaps)[::-1]
    following = np.maximum(np.append(falling[1:], 0.0), resolved)
    contrast = np.where(falling >= gap, falling / following, 0.0)
    best = int(np.argmax(contrast))
    if contrast[best] < _CONTRAST:
        return (np.arange(len(values)),)
    cuts = np.flatnonzero(gaps >= falling[best]) + 1
    return tuple(np.sort(rows) for rows in np.split(order, cuts))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Selection:
    """The rows of one condition: ``rows`` (rows,) a mask; ``apart`` says in words what the others have.

    ``stands`` says at what a recorded variable stands that all rows share, though a tire's curve is commonly
    stated without it: an inclination.
    """

    rows: NDArray[np.bool_]
    apart: tuple[str, ...] = ()
    stands: tuple[str, ...] = ()

    @property
    def left_out(self) -> int:
        """How many rows are at other conditions."""
        return int(np.count_nonzero(~self.rows))

    def findings(self, *, models: Collection[str], where: str) -> tuple[Finding, ...]:
        """Return what a fit of these rows must say: the rows that it leaves out, and where the kept stand."""
        names = ", ".join(models)
        findings = []
        if self.left_out:
            text = (
                f"{names}: fitted to {int(self.rows.sum())} of {len(self.rows)} rows, {self.left_out} are at "
                f"other conditions, which the model does not read: {'; '.join(self.apart)}"
            )
            findings.append(Finding(rule="other-conditions", where=where, message=text))
        if self.stands:
            text = f"{names}: {'; '.join(self.stands)} in every row that is fitted: the curves are of that"
            findings.append(Finding(rule="one-condition", where=where, message=text, level="note"))
        return tuple(findings)


def of_one_condition(recorded: Mapping[str, Array], reads: Collection[str], *, rows: int) -> Selection:
    """Return the rows that differ in nothing which a model does not read.

    Parameters
    ----------
    recorded : the columns that were recorded [SI], each (rows,); a speed's sign is the direction of travel
    reads : the variables that the model reads; no model reads the direction of travel
    rows : their number

    Raises
    ------
    FitError
        ``no-pure-slip``: every row has longitudinal slip, and the model does not read it
    """
    kept_rows = np.ones(rows, dtype=np.bool_)
    apart, stands = [], []
    for symbol, variable in _VARIABLES.items():
        values = recorded.get(symbol)
        if values is None or not kept_rows.any():
            continue
        if symbol in reads and not (symbol == "V" and values[kept_rows].min() < 0 < values[kept_rows].max()):
            continue
        level = _level(values[kept_rows], variable, direction_alone=symbol in reads)
        level_rows = np.flatnonzero(kept_rows)[level]
        middle = _middle(values[level_rows], variable)
        if symbol == "KAPPA" and abs(middle) > (variable.room or 0.0):
            raise _no_pure_slip(values[kept_rows])
        if len(level_rows) < int(kept_rows.sum()):
            apart_rows = np.setdiff1d(np.flatnonzero(kept_rows), level_rows)
            apart_text, kept_text = (_range_text(values[at], variable) for at in (apart_rows, level_rows))
            apart.append(f"{symbol} {apart_text}, kept {kept_text}")
            kept_rows = np.zeros(rows, dtype=np.bool_)
            kept_rows[level_rows] = True
        if variable.zero and abs(middle) > (variable.room or 0.0):
            stands.append(f"{symbol} is {_range_text(values[level_rows], variable)}")
    return Selection(rows=kept_rows, apart=tuple(apart), stands=tuple(stands))


def _level(values: Array, variable: _Variable, *, direction_alone: bool) -> NDArray[np.intp]:
    # The rows of the level that is meant, among values that may be of several.
    if variable.relative:
        backward = values < 0
        one_direction = np.flatnonzero(backward == (2 * np.count_nonzero(backward) > len(values)))
        if direction_alone:
            return one_direction
        size = np.abs(values[one_direction])
        levels = [one_direction[rows] for rows in _parted(size, variable)]
    else:
        levels = list(_parted(values, variable))
    if variable.zero:
        level = min(levels, key=lambda rows: (abs(float(np.median(values[rows]))), -len(rows)))
    else:
        median = float(np.median(values))
        level = min(levels, key=lambda rows: (-len(rows), abs(float(np.median(values[rows])) - median)))
    room = variable.room
    if room is None:
        return level
    level_values = values[level]
    if variable.relative:
        room *= abs(float(np.median(level_values)))
    if np.ptp(level_values) <= 2 * room:
        return level
    return level[np.abs(level_values - _middle(level_values, variable)) <= room]


def _parted(values: Array, variable: _Variable) -> tuple[NDArray[np.intp], ...]:
    return parted(values, gap=variable.gap, resolved=_RESOLVED * variable.gap, relative=variable.relative)


def _middle(values: Array, variable: _Variable) -> float:
    # A sweep through zero has its rows at zero; a level away from it has a middle of its own.
    if variable.zero and values.min() <= 0 <= values.max():
        return 0.0
    return float(np.median(values))


def _range_text(values: Array, variable: _Variable) -> str:
    levels = _parted(np.abs(values) if variable.relative else values, variable)
    middles = [float(np.median(values[rows])) for rows in levels]
    room = np.inf if variable.room is None else variable.room
    room *= abs(middles[0]) if variable.relative else 1.0
    one_sense = not values.min() < 0 < values.max() or not variable.relative
    listed = 1 < len(levels) <= _LISTED or (len(levels) == 1 and np.ptp(values) <= 2 * room)
    unit = "" if variable.unit == "1" else f" {variable.unit}"
    if listed and one_sense:
        return f"{', '.join(_short(middle, variable) for middle in middles)}{unit}"
    return f"{_short(values.min(), variable)} to {_short(values.max(), variable)}{unit}"


def _short(value: float, variable: _Variable) -> str:
    return f"{round(float(from_si(value, variable.unit)), 3) + 0.0:.4g}"


def _no_pure_slip(values: Array) -> FitError:
    return FitError(
        "no row rolls freely, and the model reads no longitudinal slip", where="column KAPPA",
        got=f"{len(values)} rows with KAPPA {_range_text(values, _VARIABLES['KAPPA'])}",
        expected="rows with a longitudinal slip of 0 within 0.01",
        next_step="measure a freely rolling wheel too, or fit a model that reads KAPPA to slips that vary "
        "(--model mf61)",
        rule="no-pure-slip",
    )  # fmt: skip
