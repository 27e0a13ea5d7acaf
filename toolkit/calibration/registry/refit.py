"""Load-time gates: a record must reproduce from its own data, by another algorithm than the fit's.

The fit is a QR decomposition; this is a singular value decomposition in numpy, on columns
that are centred and scaled, so that a fault of one is not a fault of both. It is light to import: every
command that touches a record runs it.

Criterion (metrology): max over terms of |dc_i| x range_i <= 1e-6 of the largest load. Beyond it, the
golden vectors, exact rational arithmetic at fit time, must come out of the stored coefficients to 1e-12 of
the largest load, and of the refit to 1e-9: that sees an intercept changed in its fifth digit, or the
coefficient of a term that hardly matters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.rounding import rounding_of
from toolkit.calibration.fit.row_noise import RowNoise, noise_of, shown_rows, weighed_rows
from toolkit.calibration.fit.session_rows import groups_of
from toolkit.calibration.fit.session_scatter import FittedRows, is_of_rows
from toolkit.calibration.issued import issued_value
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.records.scatter import SHOWN
from toolkit.calibration.session.known_errors import KnownErrors, known_errors
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import INTERCEPT, term_matrix, term_reach, term_slopes
from toolkit.errors import RecordError
from toolkit.units import unit

# The load-time refit of records with shared errors, or errors in both variables: numpy alone.


Whitener = Callable[["Array"], "Array"]
_ITERATIONS = 400


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearised:
    """The problem at its solution: ``terms`` (rows, terms) at the adjusted indications, ``weights`` 1/u.

    ``load`` (rows,) is carried to the adjusted indications.
    """

    terms: Array
    weights: Array
    load: Array


def errors_of(record: CalibrationRecord, load: str, table: Table) -> KnownErrors:
    """Return what a record's session states about the errors of one load."""
    return known_errors(record.load(load).method, statements_of(record), table, load, record.id)


def whitener(terms: Array, load: Array, errors: KnownErrors) -> Whitener:
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

    def whiten(values: Array) -> Array:
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
    terms: Sequence[str], columns: Mapping[str, Array], load: Array, errors: KnownErrors
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


def _weighted(matrix: Array, load: Array, weights: Array) -> Array:
    length = np.abs(matrix).max(axis=0)
    design = matrix / length * weights[:, None]
    basis, values, right = np.linalg.svd(design, full_matrices=False)
    solution = right.T @ (basis.T @ (load * weights) / values)
    residual = (load - matrix @ (solution / length)) * weights
    solution = solution + right.T @ (basis.T @ residual / values)
    return np.asarray(solution / length, dtype=np.float64)


CRITERION = 1e-6
GOLDEN = 1e-12
GOLDEN_REFIT = 1e-9
# Two algorithms agree in a covariance to some 1e-13 where the terms are well conditioned; an entry off the
# diagonal is small beside its two standard errors, so that a wide tolerance would not see it dropped.
SPREAD = 1e-9
RESIDUAL = 1e-12


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
        extent = (float(values.min()), float(values.max()))
        _demand_equal(record, cell.name, "range", (cell.minimum, cell.maximum), extent)
    golden = record.golden
    shape = (len(record.cells), len(golden.inputs))
    complete = len(golden.inputs) > len(record.cells) and len(golden.outputs) == len(record.loads)
    if not complete or {(len(i), len(o)) for i in golden.inputs for o in golden.outputs} != {shape}:
        raise _refused(
            record, "golden vectors", f"{len(golden.inputs)} inputs, {len(golden.outputs)} rows of outputs",
            "one output a load for each of the inputs, more inputs than indications", "golden",
        )  # fmt: skip
    inputs = np.asarray(golden.inputs)
    points = dict(zip(record.indications, inputs.T, strict=True))
    shared: dict[tuple[str, ...], _Solver] = {}
    for at, load in enumerate(record.loads):
        _same_unit(record, load.load, table.unit(load.load), load.unit)
        if load.method in ("gls", "odr"):
            weighted = _known_errors_solver(record, load, table, points)
            _check_load(record, at, load, weighted, table)
            continue
        weights = _weights(load, table)
        solver = shared.get(load.terms) if weights is None else None
        if solver is None:
            terms = term_matrix(load.terms, columns)
            solver = _solver(terms, weights, load.terms[-1] == INTERCEPT, term_matrix(load.terms, points))
            if weights is None:
                shared[load.terms] = solver
        _check_load(record, at, load, solver, table)


def _known_errors_solver(
    record: CalibrationRecord, load: LoadFit, table: Table, points: dict[str, Array]
) -> _Solver:
    columns, loads = table.columns(record.indications), table.column(load.load)
    terms, golden = term_matrix(load.terms, columns), term_matrix(load.terms, points)
    has_constant = load.terms[-1] == INTERCEPT
    errors = errors_of(record, load.load, table)
    if load.method == "gls":
        return _solver(terms, None, has_constant, golden, whiten=whitener(terms, loads, errors))
    linear = linearise(load.terms, columns, loads, errors)
    solver = _solver(linear.terms, linear.weights, has_constant, golden)
    solution, _ = solver.solve(linear.load)
    residuals = loads - terms @ (solver.back @ solution)
    sd = math.sqrt(float(residuals @ residuals) / (len(loads) - len(load.terms)))
    # Range and extent are those of the indications as observed, whose digits a certificate prints.
    return replace(
        solver,
        solved=(solution, sd),
        reach=term_reach(terms, has_constant),
        extent=np.abs(terms).max(axis=0).tolist(),
    )


def polarity(coefficients: tuple[float, ...]) -> tuple[int, ...]:
    """Return the sign of each coefficient: -1, 0 or +1."""
    return tuple(0 if c == 0 else 1 if c > 0 else -1 for c in coefficients)


def reference_u(table: Table, load: str, load_unit: str, method: str) -> float | None:
    """Return the largest standard uncertainty that the rows of a plain fit state of a load, in its unit."""
    name = f"u_{load}"
    if method != "ols" or not table.has(name):
        return None
    return float(table.column(name).max()) * (unit(table.unit(name)).factor / unit(load_unit).factor)


def _weights(load: LoadFit, table: Table) -> Array | None:
    if load.method != "wls":
        return None
    name = f"u_{load.load}"
    u = table.column(name) * (unit(table.unit(name)).factor / unit(load.unit).factor)
    weights: Array = 1.0 / u
    return weights


def _check_load(record: CalibrationRecord, at: int, load: LoadFit, solver: _Solver, table: Table) -> None:
    where, loads = load.load, table.column(load.load)
    coefficients = np.asarray(load.coefficients)
    low, high = float(loads.min()), float(loads.max())
    largest = max(abs(low), abs(high))
    solution, sd = solver.solve(loads)
    moved = np.abs(solver.back @ solution - coefficients) * solver.reach
    worst = int(moved.argmax())
    if not moved[worst] <= CRITERION * largest:
        raise _refused(
            record, f"{where}, term {load.terms[worst]}", f"{load.coefficients[worst]!r}",
            f"{float((solver.back @ solution)[worst])!r} from its own data", "refit",
        )  # fmt: skip
    n = len(loads)
    _demand_equal(record, where, "number of rows and dof", (load.n, load.dof), (n, n - len(coefficients)))
    _demand_equal(record, where, "range", (load.minimum, load.maximum), (low, high))
    if load.rounding is not None and rounding_of(record, load, table) is None:
        _demand_equal(record, where, "rounding", load.rounding, None)
    if load.reference_u is not None:  # records made before have none
        stated = reference_u(table, where, load.unit, load.method)
        _demand_equal(record, where, "reference_u", load.reference_u, stated)
    _demand_equal(record, where, "polarity", load.polarity, polarity(load.coefficients))
    issued = tuple(issued_value(c, e, largest) for c, e in zip(load.coefficients, solver.extent, strict=True))
    _demand_equal(record, where, "issued coefficients", load.issued, issued)
    _demand(
        record, where, "residual standard deviation",
        load.residual_sd is not None and abs(load.residual_sd - sd) <= SPREAD * sd + RESIDUAL * largest,
        repr(load.residual_sd), repr(sd),
    )  # fmt: skip
    stored = np.asarray(load.covariance)
    expected = _covariance(record, load, solver, table)
    errors = np.sqrt(expected.diagonal())
    # Its rounding grows with the square of the terms' condition number.
    slack = SPREAD + 10 * np.finfo(float).eps * solver.condition**2
    _demand(
        record, where, "covariance",
        stored.shape == expected.shape
        and bool((np.abs(stored - expected) <= slack * np.outer(errors, errors)).all()),
        "another matrix in the record", "that of the refit",
    )  # fmt: skip
    golden = np.asarray(record.golden.outputs[at])
    # A power series in the raw variable cancels: its own rounding is allowed for, nothing more.
    rounding = 64 * np.finfo(float).eps * (np.abs(solver.golden) @ np.abs(coefficients))
    ours = solver.golden @ coefficients
    theirs = solver.golden_design @ solution
    for values, by, share in ((ours, "the coefficients", GOLDEN), (theirs, "the refit", GOLDEN_REFIT)):
        off = np.abs(values - golden) - (share * largest + rounding)
        if not (off <= 0).all():
            row = int(off.argmax())
            raise _refused(
                record, f"{where}, golden vector {row + 1}", f"{float(values[row])!r} from {by}",
                f"{float(golden[row])!r}", "golden",
            )  # fmt: skip


def _covariance(record: CalibrationRecord, load: LoadFit, solver: _Solver, table: Table) -> Array:
    """Return the covariance by the model that the record names (terms, terms)."""
    if load.scatter is None:
        # By the record's own residual sd, which was just held against the refit's: of noise-free data it is
        # rounding, and the covariance is that rounding squared.
        alone = solver.inverse if solver.known else (load.residual_sd or 0.0) ** 2 * solver.inverse
        rounding = rounding_of(record, load, table)
        if rounding is None:
            return alone
        design, noise = (
            term_matrix(load.terms, table.columns(record.indications)),
            row_noise(record, load, table),
        )
        group = np.zeros(table.rows, dtype=np.int64)
        rows = weighed_rows(design, table.column(load.load), group, noise, solver.operator, rounding)
        return alone if rows.rounded is None else alone + rows.rounded
    covariance = scatter_covariance(record, load, solver.operator, table)
    if covariance is None:
        raise _refused(
            record, f"{load.load}, scatter", "another scatter in the record", "the likeliest", "refit"
        )
    return covariance


def scatter_covariance(
    record: CalibrationRecord, fit: LoadFit, operator: Array | None, table: Table
) -> Array | None:
    """Return the covariance (terms, terms) that a record's scatter makes; None where it is not its rows'.

    ``operator`` (terms, rows) is what made the coefficients of the loads, where it is known.
    """
    design = term_matrix(fit.terms, table.columns(record.indications))
    load, noise = table.column(fit.load), row_noise(record, fit, table)
    rows = FittedRows(
        design=design, load=load, table=table, zero=record.zero, noise=noise,
        residuals=load - design @ np.asarray(fit.coefficients), residual_sd=fit.residual_sd or 0.0,
        dof=fit.dof or 0, between=statements_of(record).between(fit.load),
    )  # fmt: skip
    if fit.scatter is None or not is_of_rows(fit.scatter, rows):
        return None
    group = groups_of(table, record.zero, every=fit.scatter.groups > 1)[1]
    rounding = rounding_of(record, fit, table)
    weighed = weighed_rows(design, load, group, noise, operator, rounding)
    if fit.scatter.model == SHOWN:
        within = rows.residuals - weighed.of_runs(fit.scatter, rows.residuals)
        weighed, profile = shown_rows(weighed, design, table.columns(record.indications), within)
        if profile is None:
            return None
    return weighed.covariance(fit.scatter)


def row_noise(record: CalibrationRecord, fit: LoadFit, table: Table) -> RowNoise | None:
    """Return what the method of a record's load takes its rows for."""
    return noise_of(
        fit.method, statements_of(record), table, fit.load, terms=fit.terms, coefficients=fit.coefficients,
        indications=record.indications, where=record.id,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solver:
    """One decomposition, for every load that shares terms and weights.

    ``design`` (rows, terms) is centred and scaled; raw coefficients = ``back`` @ solution. ``inverse`` is
    the unscaled covariance in the raw terms. ``golden``
    are the golden inputs' raw terms and ``golden_design`` the same in the columns of the design. ``reach``
    and ``extent`` are each term's range and largest absolute value. ``whiten`` takes the place of the weights
    where rows share errors; ``solved`` is the answer where another iteration found it.
    """

    design: Array
    weights: Array | None
    left: Array
    pseudo: Array
    back: Array
    inverse: Array
    condition: float
    golden: Array
    golden_design: Array
    reach: Array
    extent: list[float]
    whiten: Whitener | None = None
    solved: tuple[Array, float] | None = None

    @property
    def known(self) -> bool:
        """Whether the errors are known: the covariance then follows from them, not from the residuals."""
        return self.weights is not None or self.whiten is not None

    @property
    def operator(self) -> Array | None:
        """What makes coefficients of loads (terms, rows); None where rows share errors."""
        if self.whiten is not None:
            return None
        operator = self.back @ self.pseudo @ self.left.T
        return operator if self.weights is None else operator * self.weights

    def solve(self, loads: Array) -> tuple[Array, float]:
        """Return the solution in the design's columns, and the residual standard deviation."""
        if self.solved is not None:
            return self.solved
        w = 1.0 if self.weights is None else self.weights
        white = (lambda values: values * w) if self.whiten is None else self.whiten
        solution = self.pseudo @ (self.left.T @ white(loads))
        # One step of refinement: the second solve works on the residuals and mends the first's rounding.
        solution = solution + self.pseudo @ (self.left.T @ white(loads - self.design @ solution))
        residuals = loads - self.design @ solution
        n, p = self.design.shape
        return solution, math.sqrt(float(residuals @ residuals) / (n - p))


def _solver(
    terms: Array, weights: Array | None, has_constant: bool, golden: Array, whiten: Whitener | None = None
) -> _Solver:
    n, p = terms.shape
    k = p - 1 if has_constant else p
    centre = terms[:, :k].mean(axis=0) if has_constant else np.zeros(k)
    design = np.full((n, p), n**-0.5)
    design[:, :k] = terms[:, :k] - centre
    scale = np.sqrt(np.einsum("ij,ij->j", design[:, :k], design[:, :k]))
    scale[scale == 0] = 1.0
    design[:, :k] /= scale
    weighted = design if weights is None else design * weights[:, None]
    basis, values, right = np.linalg.svd(
        weighted if whiten is None else whiten(weighted), full_matrices=False
    )
    # Back to the raw terms: c = slope / scale, intercept = constant - centre . c
    back = np.zeros((p, p))
    back[:k, :k] = np.diag(1 / scale)
    if has_constant:
        back[k, :k] = -centre / scale
        back[k, k] = n**-0.5
    golden_design = np.full(golden.shape, n**-0.5)
    golden_design[:, :k] = (golden[:, :k] - centre) / scale
    root = (right.T / values).T @ back.T
    inverse = root.T @ root
    return _Solver(
        design=design,
        weights=weights,
        whiten=whiten,
        left=basis,
        pseudo=right.T / values,
        back=back,
        inverse=inverse,
        condition=float(values[0] / values[-1]),
        golden=golden,
        golden_design=golden_design,
        reach=term_reach(terms, has_constant),
        extent=np.abs(terms).max(axis=0).tolist(),
    )


def _same_unit(record: CalibrationRecord, name: str, header: str, stored: str) -> None:
    _demand_equal(record, name, "unit", stored, header)


def _demand_equal(record: CalibrationRecord, where: str, part: str, actual: object, expected: object) -> None:
    if actual != expected:
        _demand(record, where, part, False, str(actual), str(expected))


def _demand(
    record: CalibrationRecord, where: str, part: str, holds: bool, actual: str, expected: str
) -> None:
    if not holds:
        raise _refused(record, f"{where}, {part}", actual, f"{expected} from its own data", "refit")


def _refused(record: CalibrationRecord, where: str, actual: str, expected: str, rule: str) -> RecordError:
    return RecordError(
        f"record {record.id} does not reproduce from its own data: {where}",
        where=f"{record.id}, {where}",
        got=actual,
        expected=expected,
        next_step="restore the record from a backup; a correction is a new record, made by a new session",
        rule=rule,
    )
