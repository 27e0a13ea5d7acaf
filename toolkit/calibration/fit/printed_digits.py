"""What a session's printed digits tell: scatter that is rounding alone, and check loads that are copies.

The residuals of noise-free data are what printing rounded away. They are no scatter: they grow with the
decade of a value, and a curve, a method or an outlier that is found in them is one of the digits. Check
loads that were copied from rows of the fit agree with them in every digit oftener than chance allows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.regression import TermFit
from toolkit.calibration.terms import term_matrix
from toolkit.recording.digits import FULL_DIGITS, half_last_places

_CHANCE = 0.01  # that check loads which were measured anew are taken for copies
_FITTED = 2.0  # a row's own rounding, and that of the rows which drew the equation
_NOMINAL = 3  # digits
_REPLICATES = 3
_CHANGED = 0.2  # of the scatter: what a copy may have been changed by
_JOINT = 1e-3
_SIX_DIGITS = 5e-7  # of a value whose digits a conversion has hidden


def rounding_alone(fit: TermFit, columns: Mapping[str, Array], load: Array, tolerance: float) -> bool:
    """Tell whether every row lies as near to the equation as its printed digits can tell.

    Loads of up to three digits, such as those of weights, are nominal and count as exact, and so do those
    whose last digit is coarser than the check loads' ``tolerance``.
    """
    sd = fit.residual_sd
    if sd <= 1e-9 * tolerance:
        return True
    if sd > tolerance:
        return False
    names = list(columns)
    half = half_last_places(np.stack([load, *columns.values()]))
    step = 10.0 ** (np.floor(np.log10(np.where(load == 0, 1.0, np.abs(load)))) - _NOMINAL + 1)
    nominal = np.abs(load / step - np.round(load / step)) < 1e-9
    bound = np.where(nominal | (half[0] >= tolerance), 0.0, half[0])
    coefficients = np.asarray(fit.coefficients)
    at = term_matrix(fit.terms, columns) @ coefficients
    for name, by in zip(names, half[1:], strict=True):
        moved = term_matrix(fit.terms, {**columns, name: columns[name] + by}) @ coefficients
        bound += np.abs(moved - at)
    return bool((np.abs(fit.residuals) <= _FITTED * bound).all())


def _half_place(value: float) -> float:
    digits, exponent = Decimal(repr(value)).as_tuple()[1:]
    return 0.5 * 10.0**exponent if len(digits) < FULL_DIGITS and isinstance(exponent, int) else 0.0


def own_scatter(
    indications: Sequence[str], equations: Sequence[tuple[Sequence[str], Sequence[float], float]]
) -> list[float]:
    """Return each indication's own scatter, at most: the scatter of a load over what it moves of it.

    ``equations`` are terms, coefficients and the standard deviation of residuals, one for each load.
    """
    moved = [(dict(zip(terms, values, strict=True)), sd) for terms, values, sd in equations]
    return [min((sd / abs(c[name]) for c, sd in moved if c.get(name)), default=0.0) for name in indications]


def copies(check: Array, rows: Array, scatter: Sequence[float]) -> dict[int, int]:
    """Return which rows of a check (from 0) repeat a row of the fit (from 0) within their printed digits.

    ``check`` and ``rows`` (rows, columns) have the same columns; ``scatter`` is the standard deviation of
    each column where a loading is repeated, 0 of what is exact or not known. Rows that agree in every digit
    are always told; others only where so many would agree by chance once in a hundred sessions or less, or
    where they lie nearer to rows of their loading than those lie to each other, oftener than chance allows.
    """
    equal_rows: dict[int, int] = {}
    near: dict[int, int] = {}
    expected = 0.0
    sd = np.asarray(scatter, dtype=np.float64)
    order = np.argsort(rows[:, 0], kind="stable")
    first = rows[order, 0]
    for at, values in enumerate(check):
        by = np.maximum([_half_place(value) for value in values.tolist()], _SIX_DIGITS * np.abs(values))
        reach = 4 * math.sqrt(2) * sd + by
        low, high = np.searchsorted(first, [values[0] - reach[0], values[0] + reach[0]], side="left")
        around = np.sort(order[low : high + 1])
        distance = np.abs(rows[around] - values)
        equal = around[(distance == 0).all(axis=1)]
        alike = around[(distance <= by).all(axis=1)]
        if equal.size:
            equal_rows[at] = int(equal[0])
        elif alike.size:
            near[at] = int(alike[0])
        # Two readings of one loading differ by sqrt(2) sd: the chance that they agree within the rounding.
        share = np.where(sd > 0, np.minimum(by / (math.sqrt(math.pi) * np.where(sd > 0, sd, 1.0)), 1.0), 1.0)
        expected += float((distance <= reach).all(axis=1).sum() * share.prod())
    if near:
        from scipy.special import pdtrc

        if pdtrc(len(near) - 1, expected) < _CHANCE:
            equal_rows |= near
    return _nearest(check, rows, sd) | equal_rows


def _nearest(check: Array, rows: Array, sd: Array) -> dict[int, int]:
    """Return check loads (from 0) that lie far nearer to a row of the fit (from 0) than its replicates do.

    Among k rows of one loading and a reading taken apart, the reading is the one with the nearest neighbour
    once in k + 1 times, and all check loads of a session far more seldom. What a copy was changed by is
    small beside the scatter, and beside what the replicates are apart: readings in one run may well be nearer
    to each other than to those of other runs, but by their noise.
    """
    noisy = sd > 0
    nearest_rows: dict[int, int] = {}
    ratios: list[float] = []
    count, chances = 0, np.ones(1)  # of so many first places by chance
    for at, values in enumerate(check):
        loads = np.abs(rows[:, ~noisy] - values[~noisy]) <= _SIX_DIGITS * np.abs(values[~noisy])
        reach = (np.abs(rows[:, noisy] - values[noisy]) <= 4 * math.sqrt(2) * sd[noisy]).all(axis=1)
        around = np.flatnonzero(loads.all(axis=1) & reach)
        if len(around) < _REPLICATES:
            continue
        place = rows[np.ix_(around, np.flatnonzero(noisy))] / (math.sqrt(2) * sd[noisy])
        distances = np.sqrt(np.mean((place - values[noisy] / (math.sqrt(2) * sd[noisy])) ** 2, axis=1))
        apart = np.sqrt(np.mean((place[:, None] - place) ** 2, axis=2))
        np.fill_diagonal(apart, np.inf)
        nearest = apart.min(axis=1)
        closest = float(distances.min())
        chance = 1 / (len(around) + 1)
        chances = np.convolve(chances, [1 - chance, chance])
        count += bool((nearest > closest).all())
        ratios.append(closest / min(1.0, float(np.median(nearest)) or 1.0))
        if ratios[-1] < _CHANGED:
            nearest_rows[at] = int(around[distances.argmin()])
    certain = bool(nearest_rows) and chances[count:].sum() < _JOINT and np.median(ratios) < _CHANGED
    return nearest_rows if certain else {}
