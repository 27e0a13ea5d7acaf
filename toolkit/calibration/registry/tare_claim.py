"""`zero = "tared"` is a claim: without load, a tared indication reads nothing.

Two things can show that it is not so: rows at zero load whose indications lie away from zero by more than
their scatter, and an intercept beyond its own uncertainty. A test tares its own zero and then gets the
intercept as a load that is not there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.registry.gates import GateResult
from toolkit.calibration.registry.response import response, tolerance
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.calibration.uncertainty.scatter import scatter_of
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.table import Table

AT_ZERO = 0.1  # of the check loads' tolerance: what a reference may show without load
_SIGMAS, _ROW_SIGMAS = 3.0, 4.0
_MAD = 1.4826  # standard deviation of a normal scatter by its median absolute deviation


def tare_claim(
    record: CalibrationRecord, tables: Sequence[Table], *, u_reference: Sequence[float | None] = ()
) -> tuple[GateResult, ...]:
    """Return what contradicts a record's ``zero = "tared"``; nothing for other records.

    Parameters
    ----------
    tables : the session's reference loads first, then its check loads, in the record's units
    u_reference : standard uncertainty of each load's reference, in the load's unit, None where not stated

    Notes
    -----
    An intercept's own uncertainty is that of the fit, with half the difference of loading and unloading and
    the misfit of the curve, which move it; a tenth of the check loads' tolerance is what a standard may show
    of nothing. Single cells at zero load are held against the tolerance itself: zero returns stay inside it.
    """
    if record.zero != "tared" or record.kind != "fit" or not tables:
        return ()
    failed = [one for load in record.loads for one in _intercept(record, load, tables[0])]
    noise = [_SIGMAS * (u or 0.0) for u in tuple(u_reference) or (None,) * len(record.loads)]
    rows = [_zero_rows(record, table, noise) for table in tables]
    zeros = np.vstack([table.matrix(record.indications)[at] for table, at in zip(tables, rows, strict=True)])
    if len(zeros):
        failed += _offsets(record, tables[0], zeros, noise)
    elif not all(INTERCEPT in one.terms for one in record.loads):
        message = (
            'zero = "tared" cannot be seen to hold: no row is at zero load and no intercept is fitted; '
            "record a row at zero load in each run"
        )
        failed.append(GateResult(rule="tared", where=record.instrument, message=message, effect="tells"))
    return tuple(failed)


def _intercept(record: CalibrationRecord, one: LoadFit, loads: Table) -> list[GateResult]:
    if INTERCEPT not in one.terms or not one.covariance:
        return []
    at = one.terms.index(INTERCEPT)
    scatter = scatter_of(record, loads, one)
    value, u = one.coefficients[at], math.hypot(one.standard_errors[at], scatter.reversal, scatter.misfit)
    if abs(value) <= max(AT_ZERO * _limit(one), _SIGMAS * u):
        return []
    message = (
        f'zero = "tared" does not hold: the intercept is {value:+.4g} {one.unit}, its standard uncertainty '
        f"{u:.2g} {one.unit}; a tared test would read it as a load. Tare before each run, or say "
        'zero = "included" or zero = "run"'
    )
    return [GateResult(rule="tared", where=f"{one.load}, {INTERCEPT}", message=message)]


def _zero_rows(record: CalibrationRecord, table: Table, noise: Sequence[float]) -> NDArray[np.bool_]:
    """Return which rows have every reference load at zero within its own uncertainty (rows,)."""
    at = np.ones(table.rows, dtype=bool)
    for one, least in zip(record.loads, noise, strict=True):
        at &= np.abs(table.column(one.load)) <= max(AT_ZERO * _limit(one), least)
    return at


def _limit(one: LoadFit) -> float:
    """Return the check loads' tolerance in the load's own unit."""
    return tolerance(one) / unit(one.unit).factor


def _offsets(
    record: CalibrationRecord, table: Table, zeros: NDArray[np.float64], noise: Sequence[float]
) -> list[GateResult]:
    """Return each cell's worst offset at zero load, judged in the load that it moves most.

    ``noise`` is what each reference itself may be off by without load.
    """
    failed = []
    for column, cell in enumerate(record.cells):
        judged = []
        for one, least in zip(record.loads, noise, strict=True):
            found = response(record, one, cell)
            slope = found.value * unit(cell.unit).factor / unit(one.unit).factor
            limit = max(_limit(one), least)
            if slope != 0:
                judged.append((abs(slope) / limit, slope, limit, one))
        if not judged:
            continue
        _, slope, limit, one = max(judged, key=lambda entry: entry[0])
        scatter = _scatter(one, table, record.indications)
        moved = slope * zeros[:, column]
        mean, worst = float(moved.mean()), float(moved[np.abs(moved).argmax()])
        beyond_mean = abs(mean) > max(limit, _SIGMAS * scatter / len(moved) ** 0.5)
        beyond_row = abs(worst) > max(limit, _ROW_SIGMAS * scatter)
        if not (beyond_mean or beyond_row):
            continue
        value, what = (mean, "on average") if beyond_mean else (worst, "at most")
        message = (
            f'zero = "tared" does not hold: at zero load ({len(moved)} rows) the indication is '
            f"{value / slope:+.4g} {cell.unit} {what}, worth {value:+.4g} {one.unit} of {one.load} where the "
            f"rows scatter by {scatter:.2g} {one.unit}; the tolerance is {limit:.4g} {one.unit}"
        )
        failed.append(GateResult(rule="tared", where=cell.name, message=message))
    return failed


def _scatter(one: LoadFit, table: Table, indications: Sequence[str]) -> float:
    """Return the rows' scatter about the equation in the load's unit, robust against rows that are off."""
    fitted = term_matrix(one.terms, table.columns(indications)) @ np.asarray(one.coefficients)
    residuals = table.column(one.load) - fitted
    return _MAD * float(np.median(np.abs(residuals - np.median(residuals))))
