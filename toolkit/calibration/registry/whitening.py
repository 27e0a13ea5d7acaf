"""The load-time refit of records with shared errors, or errors in both variables: numpy alone.

Another way than the fit's: shared errors are whitened by the Cholesky factor of the covariance, which for
I + a a' is a running sum (Golub and Van Loan, Matrix Computations, 6.5.4), errors in both variables by
repeated weighted fits from a plain one (York, Earth Planet. Sci. Lett. 5 (1969) 320, for any terms).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.session.known_errors import KnownErrors, known_errors
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.terms import term_matrix, term_slopes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.session.table import Table

Whitener = Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]
_ITERATIONS = 400


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearised:
    """The problem at its solution: ``terms`` (rows, terms) at the adjusted indications, ``weights`` 1/u.

    ``load`` (rows,) is carried to the adjusted indications.
    """

    terms: NDArray[np.float64]
    weights: NDArray[np.float64]
    load: NDArray[np.float64]


def errors_of(record: CalibrationRecord, load: str, table: Table) -> KnownErrors:
    """Return what a record's session states about the errors of one load."""
    return known_errors(record.load(load).method, statements_of(record), table, load, record.id)


def whitener(terms: NDArray[np.float64], load: NDArray[np.float64], errors: KnownErrors) -> Whitener:
    """Return the map that makes rows (rows, ...) independent and of unit spread."""
    ordinary = _weighted(terms, load, np.ones(len(load)))
    fitted = terms @ ordinary
    residual = load - fitted
    u = errors.u
    if u is None:
        u = np.full(len(load), np.sqrt(residual @ residual / (len(load) - terms.shape[1])))
    acts = fitted / np.abs(load).max() if errors.proportional else np.ones(len(load))
    a = errors.u_shared * acts / u
    order = np.argsort(errors.group, kind="stable")
    bounds = np.flatnonzero(np.diff(errors.group[order])) + 1
    blocks = np.split(order, bounds)

    def whiten(values: NDArray[np.float64]) -> NDArray[np.float64]:
        scaled = (values.T / u).T
        out = np.empty_like(scaled)
        for block in blocks:
            b, x = a[block], scaled[block].reshape(len(block), -1)
            after = 1 + np.cumsum(b * b)
            before = np.concatenate([[1.0], after[:-1]])
            # What the rows before tell of the shared error is taken out of each row.
            sums = np.cumsum(b[:, None] * x, axis=0)
            earlier = np.vstack([np.zeros((1, x.shape[1])), sums[:-1]]) / before[:, None]
            white = (x - b[:, None] * earlier) * np.sqrt(before / after)[:, None]
            out[block] = white.reshape(scaled[block].shape)
        return out

    return whiten


def linearise(
    terms: Sequence[str],
    columns: Mapping[str, NDArray[np.float64]],
    load: NDArray[np.float64],
    errors: KnownErrors,
) -> Linearised:
    """Return the weighted problem whose solution is that with errors in both variables."""
    u = np.ones(len(load)) if errors.u is None else errors.u
    x, u_x = np.array(list(columns.values())), errors.u_cells[:, None]
    matrix = term_matrix(terms, columns)
    coefficients = _weighted(matrix, load, 1 / u)
    delta = np.zeros_like(x)
    largest = float(np.abs(load).max())
    best, still = np.inf, 0
    for _ in range(_ITERATIONS):
        at = dict(zip(columns, x + delta, strict=True))
        matrix = term_matrix(terms, at)
        slopes = term_slopes(terms, coefficients, at)
        slope = np.array([np.broadcast_to(slopes[name], load.shape) for name in columns])
        weights = 1 / np.sqrt(u**2 + np.square(slope * u_x).sum(axis=0))
        carried = load + (slope * delta).sum(axis=0)
        linear = _weighted(matrix, carried, weights)
        adjusted = slope * u_x**2 * (carried - matrix @ linear) * weights**2
        moved = float(np.abs(matrix @ (linear - coefficients)).max())
        moved = max(moved, float(np.abs((slope * (adjusted - delta)).sum(axis=0)).max())) / largest
        coefficients, delta = linear, adjusted
        # At the level of rounding the steps stop shrinking: that is the end, not a failure.
        still = 0 if moved < best else still + 1
        best = min(best, moved)
        if moved <= 1e-15 or still > 3:
            break
    return Linearised(terms=matrix, weights=weights, load=carried)


def _weighted(
    matrix: NDArray[np.float64], load: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    length = np.abs(matrix).max(axis=0)
    design = matrix / length * weights[:, None]
    basis, values, right = np.linalg.svd(design, full_matrices=False)
    solution = right.T @ (basis.T @ (load * weights) / values)
    residual = (load - matrix @ (solution / length)) * weights
    solution = solution + right.T @ (basis.T @ residual / values)
    return np.asarray(solution / length, dtype=np.float64)
