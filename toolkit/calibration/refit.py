"""Load-time gates: a record must reproduce from its own data, by another algorithm than the fit's.

The fit is a QR decomposition in statsmodels; this is a singular value decomposition in numpy, on columns
that are centred and scaled, so that a fault of one is not a fault of both. It is light to import: every
command that touches a record runs it.

Criterion (metrology): max over terms of |dc_i| x range_i <= 1e-6 of the largest load. Beyond it, the
golden vectors, exact rational arithmetic at fit time, must come out of the stored coefficients to 1e-12 of
the largest load, and of the refit to 1e-9: that sees an intercept changed in its fifth digit, or the
coefficient of a term that hardly matters.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.issue import issued_value, term_reach
from toolkit.calibration.table import Table
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.errors import RecordError
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.record import CalibrationRecord, LoadFit

CRITERION = 1e-6
GOLDEN = 1e-12
GOLDEN_REFIT = 1e-9
_SPREAD = 1e-6


def check_reproduces(record: CalibrationRecord, table: Table) -> None:
    """Refit a record from its reference-load data and refuse it where the results differ.

    Raises
    ------
    RecordError
        ``refit``: coefficients, covariance, residual standard deviation, issued digits, polarity, range
        or units are not those of the data; ``golden``: the golden vectors do not come out
    """
    columns = table.columns(record.indications)
    for cell in record.cells:
        values = columns[cell.name]
        _same_unit(record, cell.name, table.unit(cell.name), cell.unit)
        _demand(record, cell.name, "range", (cell.minimum, cell.maximum) == (values.min(), values.max()))
    for at, one in enumerate(record.loads):
        _same_unit(record, one.load, table.unit(one.load), one.unit)
        terms = term_matrix(one.terms, columns)
        loads = table.column(one.load)
        _check_load(record, at, one, terms, loads, _weights(one, table))


def check_transcribed(record: CalibrationRecord, source: bytes) -> None:
    """Compare a legacy record with the source text that lies beside it: it cannot be refitted.

    Raises
    ------
    RecordError
        ``refit``: a coefficient is not the one that the source names
    """
    try:
        typed = tomllib.loads(source.decode("utf-8"))["loads"]
        same = [entry["load"] for entry in typed] == [one.load for one in record.loads] and all(
            {term: float(value) for term, value in entry["coefficients"].items()}
            == dict(zip(one.terms, one.coefficients, strict=True))
            and one.issued == one.coefficients
            and one.polarity == polarity(one.coefficients)
            and unit(entry["unit"]).text == one.unit
            for entry, one in zip(typed, record.loads, strict=True)
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        same = False
    if not same:
        raise _refused(
            record, "its coefficients", "not those of its source file", "those of the source", "refit"
        )


def polarity(coefficients: tuple[float, ...]) -> tuple[int, ...]:
    """Return the sign of each coefficient: -1, 0 or +1."""
    return tuple(0 if c == 0 else 1 if c > 0 else -1 for c in coefficients)


def _weights(one: LoadFit, table: Table) -> NDArray[np.float64] | None:
    if one.method != "wls":
        return None
    name = f"u_{one.load}"
    u = table.column(name) * (unit(table.unit(name)).factor / unit(one.unit).factor)
    weights: NDArray[np.float64] = 1.0 / u
    return weights


def _check_load(
    record: CalibrationRecord,
    at: int,
    one: LoadFit,
    terms: NDArray[np.float64],
    loads: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
) -> None:
    where = one.load
    coefficients = np.asarray(one.coefficients)
    largest = float(np.abs(loads).max())
    has_constant = one.terms[-1] == INTERCEPT
    refit = _svd_fit(terms, loads, weights, has_constant)
    sd, covariance = refit.sd, refit.covariance
    reach = term_reach(terms, has_constant)
    moved = np.abs(refit.coefficients - coefficients) * reach
    worst = int(np.argmax(moved))
    if not moved[worst] <= CRITERION * largest:
        raise _refused(
            record, f"{where}, term {one.terms[worst]}", f"{one.coefficients[worst]!r}",
            f"{float(refit.coefficients[worst])!r} from its own data", "refit",
        )  # fmt: skip
    _demand(
        record, where, "number of rows", one.n == len(loads) and one.dof == len(loads) - len(coefficients)
    )
    _demand(record, where, "range", (one.minimum, one.maximum) == (loads.min(), loads.max()))
    _demand(record, where, "polarity", one.polarity == polarity(one.coefficients))
    extent = np.abs(terms).max(axis=0).tolist()
    issued = tuple(issued_value(c, e, largest) for c, e in zip(one.coefficients, extent, strict=True))
    _demand(record, where, "issued coefficients", one.issued == issued)
    sd_floor = 1e-9 * largest
    _demand(
        record, where, "residual standard deviation",
        one.residual_sd is not None and abs(one.residual_sd - sd) <= _SPREAD * sd + sd_floor,
    )  # fmt: skip
    stored = np.asarray(one.covariance)
    spread = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    # The covariance scales with sd^2, which noise-free data do not determine: hence the floor.
    # Its rounding grows with the square of the terms' condition number.
    slack = _SPREAD + 10 * np.finfo(float).eps * refit.condition**2
    slack += 2 * sd_floor / max(sd, 1e-300) if weights is None else 0.0
    _demand(
        record, where, "covariance",
        stored.shape == covariance.shape and bool(np.all(np.abs(stored - covariance) <= slack * spread)),
    )  # fmt: skip
    inputs = np.asarray(record.golden.inputs)
    golden = term_matrix(one.terms, dict(zip(record.indications, inputs.T, strict=True)))
    wanted = np.asarray(record.golden.outputs[at])
    # A power series in the raw variable cancels: its own rounding is allowed for, nothing more.
    rounding = 64 * np.finfo(float).eps * (np.abs(golden) @ np.abs(coefficients))
    ours = golden @ coefficients
    theirs = refit.predict(golden)
    for values, by, share in ((ours, "the coefficients", GOLDEN), (theirs, "the refit", GOLDEN_REFIT)):
        allowed = share * largest + rounding
        if not np.all(np.abs(values - wanted) <= allowed):
            row = int(np.argmax(np.abs(values - wanted) - allowed))
            raise _refused(
                record, f"{where}, golden vector {row + 1}", f"{float(values[row])!r} from {by}",
                f"{float(wanted[row])!r}", "golden",
            )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Refit:
    """Coefficients and covariance in the raw terms; ``predict`` works in the centred, scaled ones."""

    coefficients: NDArray[np.float64]
    covariance: NDArray[np.float64]
    sd: float
    centre: NDArray[np.float64]
    scale: NDArray[np.float64]
    solution: NDArray[np.float64]
    constant_column: float
    condition: float

    def predict(self, terms: NDArray[np.float64]) -> NDArray[np.float64]:
        k = len(self.scale)
        scaled = (terms[:, :k] - self.centre) / self.scale
        values: NDArray[np.float64] = scaled @ self.solution[:k]
        return values + self.constant_column * self.solution[k] if len(self.solution) > k else values


def _svd_fit(
    terms: NDArray[np.float64],
    loads: NDArray[np.float64],
    weights: NDArray[np.float64] | None,
    has_constant: bool,
) -> _Refit:
    n, p = terms.shape
    k = p - 1 if has_constant else p
    centre = terms[:, :k].mean(axis=0) if has_constant else np.zeros(k)
    design = np.full((n, p), n**-0.5)
    design[:, :k] = terms[:, :k] - centre
    scale = np.sqrt(np.einsum("ij,ij->j", design[:, :k], design[:, :k]))
    scale[scale == 0] = 1.0
    design[:, :k] /= scale
    w = np.ones(n) if weights is None else weights
    left, values, right = np.linalg.svd(design * w[:, None], full_matrices=False)
    solution = right.T @ ((left.T @ (loads * w)) / values)
    # One step of refinement: the second solve works on the residuals and mends the first one's rounding.
    solution = solution + right.T @ ((left.T @ ((loads - design @ solution) * w)) / values)
    residuals = loads - design @ solution
    sd = float(np.sqrt(residuals @ residuals / (n - p)))
    # Back to the raw terms: c = slope / scale, intercept = constant - centre . c
    back = np.zeros((p, p))
    back[:k, :k] = np.diag(1 / scale)
    if has_constant:
        back[k, :k] = -centre / scale
        back[k, k] = n**-0.5
    inverse = (right.T / values**2) @ right
    return _Refit(
        coefficients=back @ solution,
        covariance=back @ inverse @ back.T * (sd**2 if weights is None else 1.0),
        sd=sd,
        centre=centre,
        scale=scale,
        solution=solution,
        constant_column=n**-0.5,
        condition=float(values[0] / values[-1]),
    )


def _same_unit(record: CalibrationRecord, name: str, got: str, expected: str) -> None:
    _demand(record, name, "unit", got == expected)


def _demand(record: CalibrationRecord, where: str, part: str, holds: bool) -> None:
    if not holds:
        raise _refused(
            record, f"{where}, {part}", "another value in the record", "what its data give", "refit"
        )


def _refused(record: CalibrationRecord, where: str, got: str, expected: str, rule: str) -> RecordError:
    return RecordError(
        f"record {record.id} does not reproduce from its own data: {where}",
        where=f"{record.id}, {where}",
        got=got,
        expected=expected,
        next_step="restore the record from a backup; a correction is a new record, made by a new session",
        rule=rule,
    )
