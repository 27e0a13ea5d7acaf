"""Gates of size: loads, indications and tolerances that no calibration of this instrument can have.

A unit that slipped in every file of a session (kN written N, mV/V written V/V) is consistent in itself. What
gives it away is the size of things: the range against the last record's, against the machine's rated load,
and the output against what a strain-gauge bridge can give.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, Indication, LoadFit
from toolkit.calibration.registry.gates import GateResult
from toolkit.calibration.registry.response import largest_load, response, same_dimension, tolerance
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import INTERCEPT
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.calibration.uncertainty.scatter import scatter_of
from toolkit.machine.definition import Machine
from toolkit.units import unit

# Between a session that stays at a twentieth of the range, which calibrates nothing, and a twentyfold
# overload, which no cell survives; the common slips are 9.81 (kgf), 304.8 (mm for ft) and 1000.
RANGE = 20.0
# Metal foil bridges give 1 to 4 mV/V at capacity, semiconductor bridges some ten times that.
BRIDGE_V_V = (1e-5, 0.1)
# A published lever of this field differs from its drawing's by 1.8 (47.8 mm against a half-side of 86.6 mm).
LEVER = 2.0
TOLERANCE = 0.1  # of the largest load: check loads within a tolerance above it check nothing


def plausible(
    new: CalibrationRecord, old: CalibrationRecord | None, machine: Machine | None
) -> tuple[GateResult, ...]:
    """Return the sizes that cannot be: rules ``range``, ``lever``, ``bridge-range``, ``check-tolerance``."""
    failed: list[GateResult] = [] if machine is None else _levers(new, machine)
    rated = {} if machine is None else dict(machine.rated_loads)
    for load in new.loads:
        size, si = largest_load(load), unit(load.unit).si
        if math.isnan(size):
            continue
        earlier = None if old is None else next((o for o in old.loads if o.load == load.load), None)
        if old is not None and earlier is not None and same_dimension(load.unit, earlier.unit):
            failed += _range(load.load, size, largest_load(earlier), si, f"in {old.id}")
        if machine is not None and load.load in rated:
            failed += _range(load.load, size, rated[load.load], si, f"as rated by machine {machine.name}")
        if load.tolerance is not None and load.tolerance > TOLERANCE * load.largest:
            message = (
                f"the check loads' tolerance of {load.tolerance:.4g} {load.unit} is "
                f"{100 * load.tolerance / load.largest:.3g} % of the largest load: is its unit right?"
            )
            failed.append(GateResult(rule="check-tolerance", where=load.load, message=message))
    bridges = [_largest(cell) for cell in new.cells if unit(cell.unit).dimension == "bridge_ratio"]
    strongest = max((size for size in bridges if not math.isnan(size)), default=math.nan)
    for cell in new.cells:
        size, read = _largest(cell), unit(cell.unit)
        if math.isnan(size):
            continue
        # Off its axis a cell may hardly move: too small is only what the strongest of them gives.
        if read.dimension == "bridge_ratio" and (size > BRIDGE_V_V[1] or strongest < BRIDGE_V_V[0]):
            message = (
                f"the largest output is {1e3 * size:.4g} mV/V, where a bridge gives {1e3 * BRIDGE_V_V[0]:g} "
                f"to {1e3 * BRIDGE_V_V[1]:g} mV/V: is its unit, excitation or scale right?"
            )
            failed.append(GateResult(rule="bridge-range", where=cell.name, message=message))
        before = None if old is None else next((c for c in old.cells if c.name == cell.name), None)
        if old is not None and before is not None and same_dimension(cell.unit, before.unit):
            failed += _range(cell.name, size, _largest(before), read.si, f"in {old.id}")
    return tuple(failed)


def _levers(new: CalibrationRecord, machine: Machine) -> list[GateResult]:
    """Hold the ratio of a cell's moment to its force against the machine's geometry [m].

    It needs no history: one of two units that slipped moves a lever by 4.45 (lbf, N), 305 or 1000.
    """
    loads = {load.load: load for load in new.loads}
    if "FY" not in loads:
        return []
    failed = []
    drawn = {name: abs(lever) for name, lever in machine.layout.overturning_lever_m}
    pitch = machine.layout.pitch_diameter_m
    for cell in new.cells:
        stated = machine.cell(cell.name)
        limits = {
            "MX": (drawn[cell.name] / LEVER, drawn[cell.name] * LEVER) if drawn.get(cell.name) else None,
            "MZ": (pitch / RANGE, pitch) if pitch and stated is not None and stated.sign("MZ") else None,
        }
        force = abs(response(new, loads["FY"], cell).value)
        for load, between in limits.items():
            if load not in loads or between is None or force == 0:
                continue
            lever = abs(response(new, loads[load], cell).value) / force
            if not between[0] <= lever <= between[1]:
                message = (
                    f"its moment and its force make a lever of {1e3 * lever:.4g} mm, where machine "
                    f"{machine.name} has {1e3 * between[0]:.4g} to {1e3 * between[1]:.4g} mm: is the unit of "
                    f"{load} or of FY right?"
                )
                failed.append(GateResult(rule="lever", where=f"{load}, {cell.name}", message=message))
    return failed


def _range(name: str, size: float, reference: float, si: str, where: str) -> list[GateResult]:
    if math.isnan(reference) or not reference > 0 or 1 / RANGE <= size / reference <= RANGE:
        return []
    message = (
        f"the largest value is {size:.4g} {si} against {reference:.4g} {si} {where}, a factor of "
        f"{size / reference:.3g}: is the unit right?"
    )
    return [GateResult(rule="range", where=name, message=message)]


def _largest(cell: Indication) -> float:
    if cell.minimum is None or cell.maximum is None:
        return math.nan
    return max(abs(cell.minimum), abs(cell.maximum)) * unit(cell.unit).factor


# What is stated of a session may be larger than what it calibrated.


COARSE_U = 0.1  # of the largest load: twice the standard uncertainty from which a reference is too coarse
_EXPLAINING = 3


def coarse(record: CalibrationRecord, loads: Table, check: Table | None) -> tuple[GateResult, ...]:
    """Return the loads whose expanded uncertainty at the largest load is no small share of it.

    Whatever makes it so, a resolution in a wrong unit, a creep reading that fell, a zero that moved, cells of
    an uncertainty beyond reason, or rows that scatter: with such a record nothing is measured.
    """
    results: list[GateResult] = []
    for load in record.loads if record.kind == "fit" else ():
        if not load.covariance or not load.largest > 0:
            continue
        budget = calibration_budget(record, loads, check, load.load)
        share = budget.U / load.largest
        if share <= COARSE_U:
            continue
        parts = sorted(budget.components, key=lambda part: -part.u)[:_EXPLAINING]
        shares = ", ".join(
            f"{part.name} {100 * budget.share(part):.0f} %" for part in parts if budget.share(part) > 0.01
        )
        message = (
            f"the expanded uncertainty at the largest load is {budget.U:.3g} {load.unit}, "
            f"{100 * share:.3g} % of it, where an approval needs {100 * COARSE_U:g} % or less. Its variance: "
            f"{shares}; is what the session states of them right, with its unit?"
        )
        results.append(GateResult(rule="coarse-uncertainty", where=load.load, message=message))
    return tuple(results)


# `zero = "tared"` is a claim: without load, a tared indication reads nothing.


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
    failed = [result for load in record.loads for result in _intercept(record, load, tables[0])]
    noise = [_SIGMAS * (u or 0.0) for u in tuple(u_reference) or (None,) * len(record.loads)]
    rows = [_zero_rows(record, table, noise) for table in tables]
    zeros = np.vstack([table.matrix(record.indications)[at] for table, at in zip(tables, rows, strict=True)])
    if len(zeros):
        failed += _offsets(record, tables[0], zeros, noise)
    elif not all(INTERCEPT in load.terms for load in record.loads):
        message = (
            'zero = "tared" cannot be seen to hold: no row is at zero load and no intercept is fitted; '
            "record a row at zero load in each run"
        )
        failed.append(GateResult(rule="tared", where=record.instrument, message=message, effect="tells"))
    return tuple(failed)


def _intercept(record: CalibrationRecord, load: LoadFit, loads: Table) -> list[GateResult]:
    if INTERCEPT not in load.terms or not load.covariance:
        return []
    at = load.terms.index(INTERCEPT)
    value, standard_error = load.coefficients[at], load.standard_errors[at]
    if abs(value) <= max(AT_ZERO * _limit(load), _SIGMAS * standard_error):
        return []  # whatever reversal and misfit add
    scatter = scatter_of(record, loads, load)
    u = math.hypot(standard_error, scatter.reversal, scatter.misfit)
    if abs(value) <= _SIGMAS * u:
        return []
    message = (
        f'zero = "tared" does not hold: the intercept is {value:+.4g} {load.unit}, its standard uncertainty '
        f"{u:.2g} {load.unit}; a tared test would read it as a load. Tare before each run, or say "
        'zero = "included" or zero = "run"'
    )
    return [GateResult(rule="tared", where=f"{load.load}, {INTERCEPT}", message=message)]


def _zero_rows(record: CalibrationRecord, table: Table, noise: Sequence[float]) -> NDArray[np.bool_]:
    """Return which rows have every reference load at zero within its own uncertainty (rows,)."""
    at = np.ones(table.rows, dtype=bool)
    for load, least in zip(record.loads, noise, strict=True):
        at &= np.abs(table.column(load.load)) <= max(AT_ZERO * _limit(load), least)
    return at


def _limit(load: LoadFit) -> float:
    """Return the check loads' tolerance in the load's own unit."""
    return tolerance(load) / unit(load.unit).factor


def _offsets(
    record: CalibrationRecord, table: Table, zeros: Array, noise: Sequence[float]
) -> list[GateResult]:
    """Return each cell's worst offset at zero load, judged in the load that it moves most.

    ``noise`` is what each reference itself may be off by without load.
    """
    failed = []
    for column, cell in enumerate(record.cells):
        judged = []
        for load, least in zip(record.loads, noise, strict=True):
            sensitivity = response(record, load, cell)
            slope = sensitivity.value * unit(cell.unit).factor / unit(load.unit).factor
            limit = max(_limit(load), least)
            if slope != 0:
                judged.append((abs(slope) / limit, slope, limit, load))
        if not judged:
            continue
        _, slope, limit, load = max(judged, key=lambda entry: entry[0])
        scatter = _scatter(load, table, record.indications)
        moved = slope * zeros[:, column]
        mean, worst = float(moved.mean()), float(moved[np.abs(moved).argmax()])
        beyond_mean = abs(mean) > max(limit, _SIGMAS * scatter / len(moved) ** 0.5)
        beyond_row = abs(worst) > max(limit, _ROW_SIGMAS * scatter)
        if not (beyond_mean or beyond_row):
            continue
        value, extent = (mean, "on average") if beyond_mean else (worst, "at most")
        message = (
            f'zero = "tared" does not hold: at zero load ({len(moved)} rows) the indication is '
            f"{value / slope:+.4g} {cell.unit} {extent}, worth {value:+.4g} {load.unit} of {load.load} where "
            f"the rows scatter by {scatter:.2g} {load.unit}; the tolerance is {limit:.4g} {load.unit}"
        )
        failed.append(GateResult(rule="tared", where=cell.name, message=message))
    return failed


def _scatter(load: LoadFit, table: Table, indications: Sequence[str]) -> float:
    """Return the rows' scatter about the equation in the load's unit, robust against rows that are off."""
    fitted = load.at(table.columns(indications))
    residuals = table.column(load.load) - fitted
    return _MAD * float(np.median(np.abs(residuals - np.median(residuals))))
