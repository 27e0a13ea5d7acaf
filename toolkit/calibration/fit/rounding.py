"""What rounded indications leave in the coefficients, however many readings there are.

The step is the resolution that is stated, else the one that the readings show (`reading_step`).

A reading is off by up to half a step r, rectangular: u = r / sqrt(12) (JCGM 100, F.2.2.1). Rounding has no
noise of its own. Where the noise is below the step, readings of equal size are off by the same amount, of
opposite sign where their signs are, in every run: replicates share it, and it is not averaged away. So the
error e_k of indication j is one for all rows whose reading is k steps in size, and independent of the others.
With the slope b_ij of the load by the indication in row i they reach the coefficients as

    V = sum_j r_j^2 / 12 sum_k a_jk a_jk',   a_jk = sum of A_i b_ij sign_ij over the rows i of size k

with A that makes the coefficients of the loads (`records.scatter`). Readings that dither share little, and V
is then small beside their scatter.

A step that nobody stated is seen in the lattice on which the readings lie. Readings of a rounded instrument
are whole numbers of a step apart. Where the noise is below the step, equal loads read equal in every run, and
no scatter of repeats tells how far all of them are off: such a step counts as the resolution, as if it were
stated.

Readings that are printed with many digits lie on the lattice of their last place too. That step is far below
what they scatter by, and repeats average it away: it is none that counts. Nor is the lattice of readings that
follow even loads without any scatter, or that is hardly finer than the loads are apart.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.printed_digits import own_scatter
from toolkit.calibration.fit.regression import TermFit
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.session.read import Session
from toolkit.calibration.session.statements import Statements, statements_of
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import term_slopes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rounding:
    """The stated steps of indications (``resolutions``, in their units), and the equation that they act in.

    ``columns`` are the indications (rows,).
    """

    terms: Sequence[str]
    coefficients: Sequence[float]
    columns: Mapping[str, Array]
    resolutions: Mapping[str, float]

    @classmethod
    def of(
        cls,
        statements: Statements,
        columns: Mapping[str, Array],
        *,
        terms: Sequence[str],
        coefficients: Sequence[float],
    ) -> Rounding | None:
        """Return the rounding that a session states or shows; None where it does neither."""
        resolutions = {cell.name: cell.resolution for cell in statements.cells if cell.resolution}
        if not resolutions:
            return None
        return cls(terms=terms, coefficients=coefficients, columns=columns, resolutions=resolutions)

    def covariance(self, operator: Array) -> Array:
        """Return the covariance of coefficients (terms, terms) that ``operator`` (terms, rows) makes."""
        slopes = term_slopes(self.terms, self.coefficients, self.columns)
        total = np.zeros((len(operator), len(operator)))
        for name, step in self.resolutions.items():
            reading = self.columns[name]
            _, size = np.unique(np.rint(np.abs(reading) / step), return_inverse=True)
            slope = np.broadcast_to(slopes[name], reading.shape) * np.where(reading < 0, -1.0, 1.0)
            shared = np.stack([np.bincount(size.ravel(), weights=row) for row in operator * slope])
            total += step**2 / 12 * (shared @ shared.T)
        return total


def rounding_of(record: CalibrationRecord, load: LoadFit, table: Table) -> Rounding | None:
    """Return the rounding that the covariance of a record's load holds; None where it holds none."""
    if load.rounding is None:
        return None
    columns = table.columns(record.indications)
    return Rounding.of(statements_of(record), columns, terms=load.terms, coefficients=load.coefficients)


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
