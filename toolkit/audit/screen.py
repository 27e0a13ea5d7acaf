"""The screen: which candidates are worth evaluating on a file, out of the thousands that there are.

A candidate that explains a file explains a few of its rows, and linear equations of all records, orders and
signs are one matrix product on these. What the screen leaves out could not have been accepted; what it lets
through is judged row by row as before. Equations with higher terms are always let through.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.audit.candidates import ROUND_OFF, Group, group_of, half_fifth_digit, orders, unfit
from toolkit.audit.model import Columns
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.terms import INTERCEPT
from toolkit.units import si_scale

_PROBE = 6  # rows that are looked at first
_CELLS = 1 << 14  # rows and groups at a time: their sums stay in the processor's cache
# Both sides of a comparison are computed in another order here: what is near the limit goes through.
_SPARE = 1.0 + 1e-6

Key = tuple[int, bool, tuple[int, ...]]
"""A group: index of the record, issued coefficients, order of the columns."""

Signature = tuple[tuple[str, ...], tuple[str, ...], tuple[tuple[str, str], ...]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Equations:
    # One load by every linear group: (groups, variants, channels + 1) in the file's columns and units, the
    # constant last; ``size`` and ``slack`` (groups, channels + 1) without signs.
    coefficients: Array
    size: Array
    slack: Array

    @property
    def off(self) -> Array:
        # What coefficients and sums may be off, in parts of each column: (groups, channels + 1).
        return self.slack + 2 * ROUND_OFF * self.size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Screen:
    """Every group of the records that fit files of one layout (names, units, own columns)."""

    records: tuple[CalibrationRecord, ...]
    reasons: tuple[tuple[str, str | None], ...]
    linear: tuple[Key, ...]
    general: tuple[Key, ...]
    equations: dict[str, _Equations]

    def group(self, key: Key, columns: Columns) -> Group:
        """Return a group, evaluated on a file."""
        index, issued, order = key
        return group_of(self.records[index], columns, order=order, issued=issued)

    def for_all_rows(self, columns: Columns) -> list[Key]:
        """Return the groups that may explain every row, with a rounded coefficient or without."""
        rows = probe_rows(columns.rows)
        good = np.arange(len(self.linear))
        for load in self.equations:
            fits = self._fits(columns, load, rows, good)
            good = good[np.any(np.all(fits, axis=0), axis=1)]
        return self._keys(good)

    def anywhere(self, part: Columns) -> Iterator[tuple[Key, NDArray[np.int64]]]:
        """Yield every group that may explain a row of these, and the rows at which it may, rising."""
        step = max(1, _CELLS // max(len(self.linear), 1))
        starts = range(0, part.rows, step) if self.equations else ()
        pairs_of = [self._pairs(part.part(slice(start, start + step)), start) for start in starts]
        pairs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *pairs_of])
        pairs = pairs[np.argsort(pairs[:, 1], kind="stable")]
        for of_group in np.split(pairs, np.flatnonzero(np.diff(pairs[:, 1])) + 1):
            if len(of_group):
                yield self.linear[of_group[0, 1]], of_group[:, 0]
        for key in self.general:
            yield key, np.arange(part.rows)

    def _pairs(self, part: Columns, start: int) -> NDArray[np.int64]:
        # Row and linear group (pairs, 2) wherever some signs of each load may explain the row. The second
        # load is looked at where the first fits, which is nearly nowhere.
        (load, equations), *following = self.equations.items()
        values = np.column_stack([np.abs(part.x), np.ones(part.rows)])
        y = np.abs(part.y[load])
        limit = (
            part.half_x @ equations.size[:, :-1].T
            + values @ equations.off.T
            + (part.half_y[load] + 1e-9 * y)[:, None]
        )
        misses = _misses(values.T[:, :, None], equations.size.T[:, None, :], y[:, None])
        row, group = np.nonzero(~(misses > limit * _SPARE))
        for load, equations in following:
            size, y = equations.size[group], np.abs(part.y[load][row])
            limit = (
                np.einsum("ij,ij->i", part.half_x[row], size[:, :-1])
                + np.einsum("ij,ij->i", values[row], equations.off[group])
                + part.half_y[load][row]
                + 1e-9 * y
            )
            passed = ~(_misses(values[row].T, size.T, y) > limit * _SPARE)
            row, group = row[passed], group[passed]
        return np.column_stack([row + start, group])

    def close_to(self, accepted: Group, columns: Columns, signs: dict[str, int]) -> list[Key]:
        """Return the groups that a file may not tell from an accepted candidate."""
        rows = probe_rows(columns.rows)
        good = np.arange(len(self.linear))
        for load, variant in signs.items() if self.equations else ():
            family = accepted.families[load]
            limit = self._limit(columns, load, rows, good) + (family.bound + family.slack)[rows, None]
            predicted = self._predicted(columns, load, rows, good)
            apart = np.abs(predicted - family.predicted[variant][rows, None, None]) > limit[..., None]
            good = good[np.any(~np.any(apart, axis=0), axis=1)]
        return self._keys(good)

    def _keys(self, good: NDArray[np.int64]) -> list[Key]:
        return [*(self.linear[i] for i in good.tolist()), *self.general]

    def _fits(
        self, columns: Columns, load: str, rows: NDArray[np.int64], among: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        # of shape rows x groups x variants
        error = self._predicted(columns, load, rows, among)
        error -= columns.y[load][rows, None, None]
        fits: NDArray[np.bool_] = (
            np.abs(error, out=error) <= self._limit(columns, load, rows, among)[..., None]
        )
        return fits

    def _predicted(
        self, columns: Columns, load: str, rows: NDArray[np.int64], among: NDArray[np.int64]
    ) -> Array:
        coefficients = self.equations[load].coefficients
        if len(among) < len(coefficients):
            coefficients = coefficients[among]
        groups, variants, n = coefficients.shape
        flat = coefficients.reshape(groups * variants, n)
        predicted = columns.x[rows] @ flat[:, :-1].T
        predicted += flat[:, -1]
        return predicted.reshape(len(rows), groups, variants)

    def _limit(self, columns: Columns, load: str, rows: NDArray[np.int64], among: NDArray[np.int64]) -> Array:
        equations, y = self.equations[load], np.abs(columns.y[load][rows])
        size, slack = equations.size, equations.slack
        if len(among) < len(size):
            size, slack = size[among], slack[among]
        magnitudes = np.column_stack([np.abs(columns.x[rows]), np.ones(len(rows))])
        bound = (columns.half_y[load][rows] + 1e-9 * y)[:, None]
        limit: Array = (
            columns.half_x[rows] @ size[:, :-1].T + magnitudes @ (slack + 2 * ROUND_OFF * size).T + bound
        ) * _SPARE
        return limit


def _misses(values: Array, sizes: Array, y: Array) -> Array:
    """Return how far |y| lies from the nearest |+-s0 v0 +- s1 v1 ...|; ``values`` and ``sizes`` (terms, ...).

    Some signs give y where some give |y|, so that half of the signs need no look.
    """
    sums = [values[0] * sizes[0]]
    for value, size in zip(values[1:], sizes[1:], strict=True):
        product = value * size
        sums = [*(total + product for total in sums), *(np.abs(total - product) for total in sums)]
    nearest = np.abs(sums[0] - y)
    for total in sums[1:]:
        total -= y
        np.minimum(nearest, np.abs(total, out=total), out=nearest)
    return np.asarray(nearest)


def layout(columns: Columns) -> Signature:
    """Return what two files must share to use the same screen."""
    return columns.names, columns.units, tuple(columns.y_units.items())


def screen_of(records: Sequence[CalibrationRecord], columns: Columns) -> Screen:
    """Return the screen of the records for files with the layout of ``columns``."""
    reasons = tuple((record.id, unfit(record, columns)) for record in records)
    fitting = tuple(r for r, (_, reason) in zip(records, reasons, strict=True) if reason is None)
    linear: list[Key] = []
    keys: list[Key] = []
    for index, record in enumerate(fitting if columns.loads else ()):
        forms = (False,) if all(load.issued == load.coefficients for load in record.loads) else (False, True)
        simple = all(_is_linear(record, record.load(load)) for load in columns.loads)
        (linear if simple else keys).extend(
            (index, issued, order) for order in orders(len(record.indications)) for issued in forms
        )
    return Screen(
        records=fitting,
        reasons=reasons,
        linear=tuple(linear),
        general=tuple(keys),
        equations={load: _equations(fitting, linear, columns, load) for load in columns.loads}
        if linear
        else {},
    )


def _is_linear(record: CalibrationRecord, fit: LoadFit) -> bool:
    return all(term == INTERCEPT or term in record.indications for term in fit.terms)


def _equations(
    records: Sequence[CalibrationRecord], keys: Sequence[Key], columns: Columns, load: str
) -> _Equations:
    n = len(columns.names)
    plain, slack = np.zeros((len(keys), n + 1)), np.zeros((len(keys), n + 1))
    turned = np.array(list(itertools.product((1, -1), repeat=n + 1)), dtype=np.float64)
    coefficients = np.zeros((len(keys), len(turned), n + 1))
    for at, (index, issued, order) in enumerate(keys):
        record = records[index]
        fit = record.load(load)
        to_file = si_scale(fit.unit) / si_scale(columns.y_units[load])
        values = dict(zip(fit.terms, fit.issued if issued else fit.coefficients, strict=True))
        signs = np.ones((len(turned), n + 1))
        for i, name in enumerate(record.indications):
            # The coefficient of this channel is given the column of the channel that stands in its place.
            place = columns.names.index(record.indications[order[i]])
            scale = si_scale(columns.units[place]) / si_scale(record.indication_units[order[i]])
            value = values.get(name, 0.0)
            plain[at, place] = value * scale * to_file
            slack[at, place] = abs(scale * to_file) * half_fifth_digit(np.array([value]))[0]
            signs[:, place] = turned[:, i]
        constant = values.get(INTERCEPT, 0.0)
        plain[at, n] = constant * to_file
        slack[at, n] = abs(to_file) * half_fifth_digit(np.array([constant]))[0]
        signs[:, n] = turned[:, n]
        coefficients[at] = plain[at] * signs
    return _Equations(coefficients=coefficients, size=np.abs(plain), slack=slack)


@lru_cache(maxsize=256)
def probe_rows(rows: int) -> NDArray[np.int64]:
    """Return the few rows of a file that are looked at first, from its first to its last."""
    return np.unique(np.linspace(0, rows - 1, min(rows, _PROBE)).round().astype(np.int64))
