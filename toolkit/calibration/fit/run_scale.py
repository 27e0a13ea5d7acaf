"""Runs that were recorded in another unit: their loads are a number times what the other runs tell.

To a model of scatter such a run has a gain of its own: no row is an outlier within it. So one equation is
fitted to all runs together with a factor of each, and a factor is held against the ratios of units. The
equation is linear whatever the session's is: what bends is small beside the ratio of two units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.session_rows import groups_of
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.units import ratio_of_units

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.session_fit import LoadResult
    from toolkit.calibration.session.read import Session

_APART = 0.05  # runs of one instrument differ by less
_LARGEST_SHARE = 0.1  # of the residuals: a scale that leaves more explains something else
_LEAST_SINGULAR = 0.02  # least singular value of an equation and factors that the runs tell apart


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScale:
    """A run or mounting (``factor``) whose loads are ``ratio`` times what ``most`` of the runs tell.

    ``rows`` from 1. ``units`` says which units have that ratio, such as ``lbf against N``; None where none
    have. ``most`` is False where as many runs say the other thing.
    """

    factor: str
    run: float
    rows: tuple[int, ...]
    ratio: float
    units: str | None
    most: bool


def run_scales(session: Session, load: LoadResult) -> tuple[RunScale, ...]:
    """Return the runs of a load that have another scale than the others."""
    factor, group = groups_of(session.table, session.zero)
    if load.fit.weights is not None or not group.any() or load.fit.residual_sd <= load.setting.tolerance:
        return ()
    reference = session.table.column(load.setting.name)
    linear = [term for term in load.fit.terms if term in (*session.indications, INTERCEPT)]
    design = term_matrix(linear, session.table.columns(session.indications))
    scale = _scales(design, reference, group)
    if scale is None:
        return ()
    agree = (np.abs(scale[:, None] / scale - 1) < _APART).sum(axis=1)
    usual = int(np.argmax(agree))
    ratio = scale / scale[usual]
    if _rms(design, reference / ratio[group]) > _LARGEST_SHARE * _rms(design, reference):
        return ()
    number = session.table.rotation if factor == "mounting" else session.table.run
    names = np.unique(group if number is None else number)
    return tuple(
        RunScale(
            factor=factor,
            run=float(names[at]),
            rows=tuple((np.flatnonzero(group == at) + 1).tolist()),
            ratio=float(ratio[at]),
            units=ratio_of_units(float(ratio[at]), load.setting.unit),
            most=int(agree[at]) < int(agree[usual]),
        )
        for at in np.flatnonzero(np.abs(ratio - 1) >= _APART).tolist()
    )


def _scales(design: Array, load: Array, group: NDArray[np.int64]) -> Array | None:
    """Return each run's factor against the first (runs,): load = scale x design c; None: not told apart."""
    # A run counts by the size of its own indications, which may be those in another unit.
    moved = design[:, np.ptp(design, axis=0) > 0]
    size = np.sqrt(np.bincount(group, weights=np.mean((moved / np.abs(moved).max(axis=0)) ** 2, axis=1)))
    if not size.all():
        return None
    weight = (np.sqrt(np.bincount(group)) / size)[group]
    design, load = design * weight[:, None], load * weight
    factors = -np.where(group[:, None] == np.arange(1, int(group.max()) + 1), load[:, None], 0.0)
    matrix = np.column_stack([design, factors])
    length = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    if not length.all():
        return None
    solution, _, _, singular = np.linalg.lstsq(matrix / length, np.where(group == 0, load, 0.0), rcond=None)
    inverse = (solution / length)[design.shape[1] :]
    if singular[-1] < _LEAST_SINGULAR or not (inverse > 0).all():
        return None
    return np.asarray(np.concatenate([[1.0], 1 / inverse]), dtype=np.float64)


def _rms(design: Array, load: Array) -> float:
    """Return what an equation leaves of loads, by their size."""
    residual = load - design @ np.linalg.lstsq(design, load, rcond=None)[0]
    return float(np.linalg.norm(residual) / np.linalg.norm(load))
