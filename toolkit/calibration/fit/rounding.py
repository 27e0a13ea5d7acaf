"""What rounded indications leave in the coefficients, however many readings there are.

The step is the resolution that is stated, else the one that the readings show (`fit.reading_steps`).

A reading is off by up to half a step r, rectangular: u = r / sqrt(12) (JCGM 100, F.2.2.1). Rounding has no
noise of its own. Where the noise is below the step, readings of equal size are off by the same amount, of
opposite sign where their signs are, in every run: replicates share it, and it is not averaged away. So the
error e_k of indication j is one for all rows whose reading is k steps in size, and independent of the others.
With the slope b_ij of the load by the indication in row i they reach the coefficients as

    V = sum_j r_j^2 / 12 sum_k a_jk a_jk',   a_jk = sum of A_i b_ij sign_ij over the rows i of size k

with A that makes the coefficients of the loads (`records.scatter`). Readings that dither share little, and V
is then small beside their scatter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.session.statements import Statements, statements_of
from toolkit.calibration.terms import term_slopes

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.table import Table


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
