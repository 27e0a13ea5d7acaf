"""What computed a file that no record explains: its coefficients, what its digits prove, the nearest record.

The rows that no candidate fits give a linear equation by least squares, and a linear programme bounds every
coefficient. A recording's channels are nearly collinear (one tire, five loads), so such coefficients name a
version; they never calibrate.

Every row says |y - sum c_i x_i - c_0| <= h_y + sum |c_i| h_i, with h half a last printed place. For given
signs of the coefficients that is linear, so a linear programme bounds each coefficient, and the union over
the signs is all that the file allows: a sign is proven, not estimated.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from toolkit.arrays import Array
from toolkit.declared import Entry, Keyed, OrNan
from toolkit.units import si_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.audit.model import Columns, Segment
    from toolkit.audit.screen import Screen


_STEPS = 200
_TIGHT = 1e-11
_MANY = 1 << 15  # rows; so many are looked at together
_SPREAD = 1 << 11  # rows of a longer file to begin with
_ROUNDS = 60
_SPARE = 1e-6  # of what a row allows: round-off of large loads in small digits
_MARGIN = 2  # rows beyond the unknowns


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """What a file allows for one coefficient, in the file's units; ``low`` or ``high`` may be infinite."""

    load: str
    name: str
    low: float
    high: float

    @property
    def sign(self) -> int:
        """Return +1 or -1 where the sign is proven, else 0."""
        return 1 if self.low > 0 else -1 if self.high < 0 else 0


def coefficient_intervals(columns: Columns, load: str) -> tuple[Interval, ...]:
    """Return the interval of every coefficient of a linear equation, the constant last.

    Empty where no linear equation of the columns gives the file's values within their printed digits.

    Examples
    --------
    A column whose values are exact and an own FY of two decimals:

    >>> import numpy as np
    >>> from toolkit.audit.model import Columns
    >>> x = np.array([[1.0], [2.0], [3.0]])
    >>> y = np.array([3.01, 5.01, 7.01])
    >>> columns = Columns(names=("A",), units=("N",), x=x, half_x=0 * x, y={"FY": y},
    ...                   half_y={"FY": np.full(3, 0.005)}, y_units={"FY": "N"})
    >>> [(i.name, round(i.low, 4), round(i.high, 4), i.sign) for i in coefficient_intervals(columns, "FY")]
    [('A', 1.995, 2.005, 1), ('constant', 1.0, 1.02, 1)]
    """
    bounds = interval_bounds(
        columns.x,
        columns.y[load],
        half_x=columns.half_x,
        half_y=columns.half_y[load] + 1e-9 * np.abs(columns.y[load]),
    )
    if bounds is None:
        return ()
    names = (*columns.names, "constant")
    return tuple(
        Interval(load=load, name=name, low=float(low), high=float(high))
        for name, (low, high) in zip(names, bounds, strict=True)
    )


def interval_bounds(x: Array, y: Array, *, half_x: Array, half_y: Array) -> Array | None:
    """Return (channels + 1, 2) lowest and highest coefficients, the constant last; None where none fits.

    Parameters
    ----------
    x, half_x : (rows, channels) values and their half last places
    y, half_y : (rows,) the same of the load

    Notes
    -----
    Of a long file a few thousand rows are taken, and with them whichever rows their answers break, until they
    break none: the answer is that of all rows, at the cost of a few passes over them.
    """
    if len(x) <= _MANY:
        return _bounds_of(x, y, half_x=half_x, half_y=half_y)[0]
    active = _first_rows(x, y)
    for _ in range(_ROUNDS):
        bounds, points = _bounds_of(x[active], y[active], half_x=half_x[active], half_y=half_y[active])
        if bounds is None:
            return None  # a part of the rows that nothing fits
        if not np.isfinite(bounds).all():
            break  # so few rows bound too little
        broken = _broken(points, x, y, half_x, half_y)
        if not len(broken):
            return bounds
        active = np.union1d(active, broken)
    return _bounds_of(x, y, half_x=half_x, half_y=half_y)[0]


def _first_rows(x: Array, y: Array) -> NDArray[np.int64]:
    # Spread over the file, and the ends of every column.
    columns = [*x.T, y]
    ends = [int(at) for column in columns for at in (np.argmin(column), np.argmax(column))]
    spread = np.linspace(0, len(y) - 1, _SPREAD).round().astype(np.int64)
    return np.union1d(spread, np.array(ends, dtype=np.int64))


def _broken(points: Sequence[Array], x: Array, y: Array, half_x: Array, half_y: Array) -> NDArray[np.int64]:
    """Return the rows that coefficients (channels + 1,) break worst, a part of the file at a time."""
    rows: set[int] = set()
    for start in range(0, len(y), _MANY):
        part = slice(start, start + _MANY)
        for point in points:
            allowed = half_y[part] + half_x[part] @ np.abs(point[:-1])
            over = np.abs(y[part] - x[part] @ point[:-1] - point[-1]) - allowed * (1 + _SPARE)
            worst = int(np.argmax(over))
            if over[worst] > 0:
                rows.add(start + worst)
    return np.array(sorted(rows), dtype=np.int64)


def _bounds_of(x: Array, y: Array, *, half_x: Array, half_y: Array) -> tuple[Array | None, list[Array]]:
    # `interval_bounds`, and the coefficients at which each end is reached.
    n = x.shape[1]
    rounding = np.maximum(half_y, 1e-12 * max(float(np.abs(y).max()), np.finfo(float).tiny))
    # In the directions of a QR factorisation, about the least-squares solution and in units of the rounding,
    # every unknown is of order one, however collinear the columns are.
    scale = np.maximum(np.abs(np.column_stack([x, np.ones(len(x))])).max(axis=0), np.finfo(float).tiny)
    q, r = np.linalg.qr(np.column_stack([x, np.ones(len(x))]) / scale / rounding[:, None])
    if np.abs(np.diag(r)).min() <= 1e-10 * np.abs(np.diag(r)).max():
        return np.tile([-np.inf, np.inf], (n + 1, 1)), []  # a dead channel, or one that is another's multiple
    back = np.linalg.inv(r) / scale[:, None]
    target = y / rounding
    centre, residual = back @ (q.T @ target), target - q @ (q.T @ target)
    low, high = np.full(n + 1, np.inf), np.full(n + 1, -np.inf)
    points: list[Array] = []
    with np.errstate(over="ignore"):
        size = np.linalg.norm(back, axis=1)
    if not np.isfinite(size).all():
        return np.tile([-np.inf, np.inf], (n + 1, 1)), []  # numbers that no double precision can compare
    for signs in itertools.product(*_possible_signs(q, back, centre, half_x, half_y, rounding)):
        turned = np.array(signs)
        allowed = half_x / rounding[:, None] * turned  # |c| half_x for these signs
        moving, fixed = allowed @ back[:n], half_y / rounding + allowed @ centre[:n]
        area = np.vstack([q - moving, -q - moving, -turned[:, None] * back[:n] / size[:n, None]])
        right = np.concatenate([fixed + residual, fixed - residual, turned * centre[:n] / size[:n]])
        polytope = _Polytope(area, right)
        for i in range(n + 1):
            ends = [polytope.lowest(turn * back[i] / size[i]) for turn in (1.0, -1.0)]
            if polytope.empty:
                break  # no solution has these signs
            low[i] = min(low[i], -np.inf if ends[0] is None else centre[i] + ends[0] * size[i])
            high[i] = max(high[i], np.inf if ends[1] is None else centre[i] - ends[1] * size[i])
        points += [centre + back @ point for point in polytope.points]
    return (np.column_stack([low, high]) if np.all(low <= high) else None), points


def _possible_signs(
    q: Array, back: Array, centre: Array, half_x: Array, half_y: Array, rounding: Array
) -> list[tuple[float, ...]]:
    # A solution c gives residuals e with |e| <= half_y + |c| half_x, and c - centre = back q^T e. So
    # |c - centre| <= d with d = |back q^T| (half_y + half_x (|centre| + d)): where that has a solution, a
    # coefficient beyond its d has one sign only, and the programmes of the other need not be solved.
    n = half_x.shape[1]
    gain = np.abs(back[:n] @ q.T) / rounding
    mixed = gain @ half_x
    if float(np.abs(np.linalg.eigvals(mixed)).max()) < 1:
        reach = np.linalg.solve(np.eye(n) - mixed, gain @ (half_y + half_x @ np.abs(centre[:n])))
        spare = 1 + 1e-6
        return [
            (1.0,) if c > r * spare else (-1.0,) if c < -r * spare else (1.0, -1.0)
            for c, r in zip(centre[:n].tolist(), reach.tolist(), strict=True)
        ]
    return [(1.0, -1.0)] * n


class _Polytope:
    """The points with area x <= right: thousands of sides in a few dimensions."""

    def __init__(self, area: Array, right: Array) -> None:
        size = np.maximum(np.linalg.norm(area, axis=1), np.finfo(float).tiny)
        # A cube that is far outside gives every programme a first vertex; a lowest point on it means that
        # nothing else bounds the goal.
        self._cube = len(area)
        corner = np.eye(area.shape[1])
        self._far = 1e6 * math.sqrt(len(area)) * (1.0 + float(np.abs(right / size).max()))
        self._area = np.vstack([area / size[:, None], corner, -corner])
        self._right = np.concatenate([right / size, np.full(2 * len(corner), self._far)])
        self._given = (area, right)
        self.empty = False
        self.points: list[Array] = []  # at which a goal was lowest

    def lowest(self, goal: Array) -> float | None:
        """Return the lowest value of ``goal`` x; None where there is no point at all, or no limit.

        The dual simplex: from a vertex that is optimal for the sides it knows, to the side that it violates
        most, until it violates none.
        """
        n = len(goal)
        basis = np.where(goal >= 0, self._cube + n, self._cube) + np.arange(n)
        for _ in range(_STEPS):
            sides = self._area[basis]
            try:
                point = np.linalg.solve(sides, self._right[basis])
                weights = np.linalg.solve(sides.T, -goal)
                over = self._area @ point - self._right
                new = int(np.argmax(over))
                if over[new] <= _TIGHT * (1.0 + abs(self._right[new])):
                    free = bool(np.any((basis >= self._cube) & (weights > _TIGHT)))
                    if free:
                        return None
                    self.points.append(point)
                    return float(goal @ point)
                moves = np.linalg.solve(sides.T, self._area[new])
            except np.linalg.LinAlgError:
                break
            blocking = moves > _TIGHT
            if not blocking.any():
                self.empty = True
                return None
            ratio = np.full(n, np.inf)
            ratio[blocking] = np.maximum(weights[blocking], 0.0) / moves[blocking]
            basis[int(np.argmin(ratio))] = new
        return self._solved(goal)

    def _solved(self, goal: Array) -> float | None:
        # By a general solver where the steps did not end; None where the programme has no lowest value.
        from scipy.optimize import linprog

        area, right = self._given
        answer = linprog(goal, A_ub=area, b_ub=right, bounds=(None, None), method="highs")
        if answer.status != 0 or answer.fun is None:
            return None
        self.points.append(np.asarray(answer.x))
        return float(answer.fun)


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatedCoefficient:
    """An estimated coefficient, in the file's units, and what the printed digits allow."""

    value: OrNan
    low: Annotated[float | None, Entry("null where nothing bounds it")]
    high: Annotated[float | None, Entry("null where nothing bounds it")]


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatedEquation:
    """The linear equation of a load as the file has it."""

    unit: str
    linear: Annotated[bool, Entry("whether any linear equation gives every row")]
    rms: Annotated[OrNan, Entry("of the residuals of the least squares")]
    max_abs: Annotated[OrNan, Entry("of the residuals of the least squares")]
    coefficients: Annotated[tuple[tuple[str, EstimatedCoefficient], ...], Keyed(), Entry("and the constant")]


@dataclass(frozen=True, slots=True, kw_only=True)
class NearestRecord:
    """The record, as it is, whose values come nearest."""

    record: str
    FY_max_abs_N: Annotated[float | None, Entry("by which its worst row lies off")]
    MZ_max_abs_Nm: Annotated[float | None, Entry("by which its worst row lies off")]


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimatedCalibration:
    """What computed the longest stretch of rows that no candidate explains."""

    first_row: Annotated[int, Entry("from 1")]
    last_row: int
    equations: Annotated[tuple[tuple[str, EstimatedEquation], ...], Keyed(), Entry("of each load")]
    nearest: NearestRecord | None


def estimate(columns: Columns, segments: Sequence[Segment], screen: Screen) -> EstimatedCalibration | None:
    """Return the equation of a file's unknown rows; None where there are too few of them."""
    unknown = [segment for segment in segments if segment.grade == "unknown"]
    if not unknown or not columns.loads or not columns.names:
        return None
    longest = max(unknown, key=lambda segment: segment.last_row - segment.first_row)
    rows = slice(longest.first_row - 1, longest.last_row)
    part = columns.part(rows)
    if part.rows < len(columns.names) + 1 + _MARGIN:
        return None
    return EstimatedCalibration(
        first_row=longest.first_row,
        last_row=longest.last_row,
        equations=tuple((load, _equation(part, load)) for load in part.loads),
        nearest=_nearest(part, screen),
    )


def _equation(part: Columns, load: str) -> EstimatedEquation:
    # In parts of a power of two: what a broken channel holds may have no square in double precision.
    largest = math.ldexp(1.0, math.frexp(float(np.abs(part.y[load]).max()))[1] - 1)
    design = np.column_stack([part.x, np.ones(part.rows)])
    scale = np.maximum(np.abs(design).max(axis=0), np.finfo(float).tiny)
    solved = np.linalg.lstsq(design / scale, part.y[load], rcond=1e-12)[0] / scale
    residual = part.y[load] - design @ solved
    bounds = {interval.name: interval for interval in coefficient_intervals(part, load)}
    names = (*part.names, "constant")
    return EstimatedEquation(
        unit=part.y_units[load],
        coefficients=tuple(
            (
                name,
                EstimatedCoefficient(
                    value=float(value),
                    low=_finite(bounds[name].low) if name in bounds else None,
                    high=_finite(bounds[name].high) if name in bounds else None,
                ),
            )
            for name, value in zip(names, solved, strict=True)
        ),
        linear=bool(bounds),
        rms=largest * float(np.sqrt(np.mean((residual / largest) ** 2))),
        max_abs=float(np.abs(residual).max()),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _nearest(part: Columns, screen: Screen) -> NearestRecord | None:
    from toolkit.audit.identify import recompute

    best: tuple[float, NearestRecord] | None = None
    for record in screen.records:
        new = recompute(part, record)
        off = {load: _off(part, load, new[load]) for load in part.loads}
        # Newtons and newton metres are added in parts of what the file's own values span.
        total = sum(
            size / max(float(np.ptp(part.y[load])) * si_scale(part.y_units[load]), 1e-12)
            for load, size in off.items()
        )
        if best is None or total < best[0]:
            best = (
                total,
                NearestRecord(record=record.id, FY_max_abs_N=off.get("FY"), MZ_max_abs_Nm=off.get("MZ")),
            )
    return None if best is None else best[1]


def _off(part: Columns, load: str, new: Array) -> float:
    return float(np.max(np.abs(new - part.y[load] * si_scale(part.y_units[load]))))
