"""The step of readings that nobody stated: rounding is seen in the lattice on which the readings lie.

Readings of a rounded instrument are whole numbers of a step apart. Where the noise is below the step, equal
loads read equal in every run, and no scatter of repeats tells how far all of them are off (`rounding`): such
a step counts as the resolution, as if it were stated.

Readings that are printed with many digits lie on the lattice of their last place too. That step is far below
what they scatter by, and repeats average it away: it is none that counts. Nor is the lattice of readings that
follow even loads without any scatter, or that is hardly finer than the loads are apart.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.printed_digits import own_scatter

if TYPE_CHECKING:
    from toolkit.calibration.fit.regression import TermFit
    from toolkit.calibration.session.read import Session

_OFF_STEP = 0.02  # of a step: what the conversion of units may move a reading
_FEWEST = 8  # different distances, so that they lie on a lattice by chance once in 0.04^-8
_MOST_PARTS = 24  # of the smallest distance: a step that is finer is not looked for
_MOST_SCATTER = 2.0  # steps: above it repeats average
_NO_SCATTER = 1e-9  # of the largest reading
_FINER, _FINE = 4, 200  # times as many steps as there are different readings, or so many
_FINEST = 1e-6  # of the largest reading: what printing leaves of any instrument


def reading_step(readings: Array, run: Array | None) -> float | None:
    """Return the largest step of which readings (rows,) of a run are whole numbers apart; None without one.

    >>> levels = np.array([0.0, 0.35, 0.71, 1.04, 1.42, 1.77, 2.13, 2.46, 2.81, 3.2])
    >>> round(reading_step(np.round(levels / 0.05) * 0.05, None), 9), reading_step(levels**1.5, None)
    (0.05, None)
    """
    group = np.zeros(len(readings)) if run is None else run
    _, first, inverse = np.unique(group, return_index=True, return_inverse=True)
    apart = np.abs(readings - readings[first][inverse.ravel()])
    apart = np.unique(apart[apart > _FINEST * float(np.abs(readings).max(initial=0.0))])
    if not apart.size:
        return None
    between = np.append(apart[:1], np.diff(apart))
    smallest = float(between[between > 0.5 * _FINEST * apart[-1]].min())
    for parts in range(1, _MOST_PARTS + 1):
        step = smallest / parts
        # The smallest distance is one of two rounded numbers: all of them tell the step better.
        count = np.rint(apart / step)
        step = float(count @ apart / (count @ count))
        count = np.rint(apart / step)
        on_lattice = (np.abs(apart - step * count) <= _OFF_STEP * step).all()
        if not on_lattice:
            continue
        fine = count[-1] >= min(_FINER * len(count), _FINE) and step > _FINEST * apart[-1]
        return step if fine and len(count) >= _FEWEST else None
    return None


def with_steps(session: Session, fits: Sequence[TermFit]) -> Session:
    """Return a session whose cells without a stated resolution have the step that their readings show."""
    table = session.table
    scatters = own_scatter(
        session.indications, [(fit.terms, fit.coefficients, fit.residual_sd) for fit in fits]
    )
    cells = []
    for cell, scatter in zip(session.cells, scatters, strict=True):
        step = None
        if cell.resolution is None and scatter > 0:
            step = reading_step(table.column(cell.name), table.run)
        largest = float(np.abs(table.column(cell.name)).max(initial=0.0))
        counts = step is not None and _NO_SCATTER * largest < scatter <= _MOST_SCATTER * step
        cells.append(dataclasses.replace(cell, step=step if counts else None))
    return dataclasses.replace(session, cells=tuple(cells))
