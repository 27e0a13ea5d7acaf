"""Errors that all rows of one record share: what its session states of them, and the covariance they make.

A test is a weighted sum of loads that one record computed. Errors of the record do not average out over its
rows; the covariance of its coefficients carries them, J V J^T (JCGM 100 eq. 13), and lets them cancel in
differences where they must. Beside the scatter of the fit, which V_fit holds, follow from the record alone:

- *scale*: had the reference applied (1 + e) times the load it states, least squares, linear in the loads,
  would have returned (1 + e) c: every coefficient, the intercept too. So V_scale = u(e)^2 c c^T, and the
  error of a load is e f(x): it grows with the load, is zero at zero load, and stays in every sum that is
  not zero. u(e) is u(reference) over the largest calibrated load. Of a U that is stated as an amount this is
  the part that a test's sums and slopes keep: the standard and the cells are zeroed without load, and a shift
  that is left at every other load alike has no place in a linear equation. The budget of a single load has
  the amount at every load. Creep, a part of the load as well, is added to it.
- *offset*: a stated uncertainty of an indication, and the drift of its zero over the session, are taken as
  one shift common to all rows of a test: V_offset has them on the intercept. It cancels in slopes and in
  differences, and with a tare where the record's intercept does (``zero = "included"``).

Loads are taken one at a time. A shared reference (``shared_group``) makes the scale errors of two loads the
same, and a cell's shift moves both; that matters to a sum of forces with moments only. The fits' scatter is
correlated too, as far as one cell's noise feeds both loads: V_ab = rho s_a s_b (X'X)^-1 with rho of the joint
residuals, which `calibrate` tells (``residual_correlation``) and no record keeps. The one characteristic of
two loads is the residual torque, MZ where FY is zero: of its variance by the two fits, u_a^2 + u_b^2, the
correlation can change at most the share |rho|, since 2 |rho| u_a u_b <= |rho| (u_a^2 + u_b^2).

Not in it: misfit and reversal, which are local in the load, need the session's rows and do not follow from
the record alone; they stand in the budget. Resolution averages out over a block of readings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.session.statements import Statements, statements_of
from toolkit.calibration.terms import INTERCEPT
from toolkit.findings import Finding

_STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True)
class IndicationError:
    """Errors of one indication in its unit: ``readings`` roundings of ``half_width``, and a normal ``u``."""

    name: str
    half_width: float
    readings: int
    u: float


def indication_errors(record: CalibrationRecord, statements: Statements) -> tuple[IndicationError, ...]:
    """Return what is stated of every indication; zeros where nothing is.

    A load from a tared record is a difference of two readings, each rounded by itself: the standard
    uncertainty of the rounding is then r/sqrt(6) of a resolution r, as in ISO 376 annex C, else r/sqrt(12).
    """
    readings = 1 if record.zero == "included" else 2
    return tuple(
        IndicationError(
            name=cell.name, half_width=(cell.resolution or 0.0) / 2, readings=readings, u=cell.u or 0.0
        )
        for cell in statements.cells
    )


def sensitivities(record: CalibrationRecord, load: LoadFit, points: Array) -> Array:
    """Return d load / d indication (points, indications), by central differences."""
    sizes = np.array([max(abs(cell.minimum or 0.0), abs(cell.maximum or 0.0)) for cell in record.cells])
    reach = np.maximum(sizes, np.abs(points)).T  # (indications, points), as all below
    steps = _STEP * np.where(reach == 0, 1.0, reach)
    moves = np.eye(len(steps))[:, :, None] * steps[:, None, :]
    at = points.T[:, None, :]
    moved = np.concatenate([at + moves, at - moves], axis=1)
    columns = dict(zip(record.indications, moved.reshape(len(steps), -1), strict=True))
    values = load.at(columns).reshape(2, *steps.shape)
    slopes: Array = (values[0] - values[1]) / (2 * steps)
    return slopes.T


def zero_drift(record: CalibrationRecord) -> tuple[float, ...] | str:
    """Return after minus before of each indication's zero, in its unit; else why it is not known.

    The last reading whose ``when`` begins with *after* is held against the first that begins with *before*;
    without such words the last reading against the first. Readings with the shunt connected are no zeros.
    """
    entries = [entry for entry in statements_of(record).zero if not entry.shunt]
    if len(entries) < 2:
        return "no zero before and after the session is stated"
    moments = [entry.when.casefold() for entry in entries]
    before = next((i for i, text in enumerate(moments) if text.startswith("before")), 0)
    after = max((i for i, text in enumerate(moments) if text.startswith("after")), default=len(moments) - 1)
    first, last = dict(entries[before].values), dict(entries[after].values)
    missing = [name for name in record.indications if name not in first or name not in last]
    if missing:
        return f"the zero readings lack {', '.join(missing)}"
    return tuple(last[name] - first[name] for name in record.indications)


def left_at_zero(record: CalibrationRecord, load: LoadFit) -> float:
    """Return the load that tared indications of zero would mean [unit of the load]; 0 where it is none.

    An intercept under ``zero = "tared"`` beyond twice its standard uncertainty is no scatter: a gate lets it
    pass inside the check loads' tolerance, and every reading has it.
    """
    if record.zero != "tared" or INTERCEPT not in load.terms:
        return 0.0
    at = load.terms.index(INTERCEPT)
    size = abs(load.coefficients[at])
    return size if size > 2 * load.standard_errors[at] else 0.0


def creep(record: CalibrationRecord, load: LoadFit) -> float | str:
    """Return the creep of a load as a ratio of the load, |last - first reading|; else why it is not known.

    ISO 376 relates the change of the deflection between 30 s and 300 s to the deflection at the largest
    force. A reading after unloading is related to the largest load too; of several series the largest counts.
    """
    series: dict[str, list[tuple[float, float]]] = {}
    slope = None
    for entry in statements_of(record).creep:
        if entry.load != load.load and len(record.loads) > 1:
            continue
        if entry.shown is not None:
            value = entry.shown[1]
        else:
            if slope is None:
                slope = dict(
                    zip(record.indications, sensitivities(record, load, _middle(record))[0], strict=True)
                )
            value = sum(float(slope[name]) * reading for name, reading in entry.values)
        key = f"{entry.load} {' '.join(name for name, _ in entry.values)}"
        series.setdefault(key, []).append((entry.seconds, value))
    moved = [
        abs(max(one_series)[1] - min(one_series)[1]) for one_series in series.values() if len(one_series) > 1
    ]
    return max(moved) / load.largest if moved else "no two creep readings of this load are stated"


def _middle(record: CalibrationRecord) -> Array:
    """Return the middle of the calibrated indications, as one point (1, indications)."""
    return np.array([[((cell.minimum or 0.0) + (cell.maximum or 0.0)) / 2 for cell in record.cells]])


def record_covariance(record: CalibrationRecord) -> dict[str, Array]:
    """Return load -> covariance of its coefficients (terms, terms), with what the session stated.

    A legacy record, which has no covariance, gives none; a session that states nothing gives the fit's own.
    """
    statements = statements_of(record)
    return {load.load: _covariance(record, load, statements) for load in record.loads if load.covariance}


def standard_errors(record: CalibrationRecord, load: str) -> tuple[float, ...]:
    """Return the standard errors of a load's coefficients, as they are printed; empty for a legacy import.

    They are those of `record_covariance`: what a test inherits from a record is what its pages state.
    """
    covariance = record_covariance(record).get(load)
    return () if covariance is None else tuple(np.sqrt(np.diag(covariance)).tolist())


def reference_findings(record: CalibrationRecord) -> tuple[Finding, ...]:
    """Return that no uncertainty of a record's loads holds the standard that they were measured with.

    A legacy import has no uncertainty at all, and says so.
    """
    reference = statements_of(record).reference
    bare = [
        load.load
        for load in record.loads
        if load.covariance and reference.of(load.load) is None and load.reference_u is None
    ]
    if not bare:
        return ()
    names = ", ".join(bare)
    message = f"no uncertainty of the reference standard is stated of {names}: no uncertainty here holds it"
    return (Finding(rule="reference-unstated", where=record.id, message=message, level="note"),)


def scale_u(record: CalibrationRecord, load: LoadFit, statements: Statements) -> float:
    """Return the relative standard uncertainty of a load's scale: reference standard and creep."""
    # A generalised fit of one shared reference has its error in the covariance already.
    counted = load.method == "gls" and statements.reference.shared_group is not None
    u = 0.0 if counted else statements.reference.u(load.load) or load.reference_u or 0.0
    crept = creep(record, load)
    relative = 0.0 if isinstance(crept, str) else crept / math.sqrt(3.0)
    return math.hypot(u / load.largest if load.largest > 0 else 0.0, relative)


def offset_u(record: CalibrationRecord, load: LoadFit, statements: Statements) -> float:
    """Return the standard uncertainty of a shift of all rows [the unit of the load]: cells, zeros."""
    stated = [cell.u or 0.0 for cell in statements.cells]
    drift = zero_drift(record)
    tared = left_at_zero(record, load) / math.sqrt(3.0)
    if not any(stated) and isinstance(drift, str):
        return tared
    slope = sensitivities(record, load, _middle(record))[0]
    moved = 0.0 if isinstance(drift, str) else float(slope @ np.asarray(drift)) / math.sqrt(3.0)
    return math.hypot(tared, float(np.linalg.norm(slope * np.asarray(stated))), moved)


def _covariance(record: CalibrationRecord, load: LoadFit, statements: Statements) -> Array:
    total = np.array(load.covariance)
    scale = scale_u(record, load, statements)
    if scale > 0:
        c = np.asarray(load.coefficients)
        total += scale**2 * np.outer(c, c)
    if INTERCEPT in load.terms:
        at = load.terms.index(INTERCEPT)
        total[at, at] += offset_u(record, load, statements) ** 2
    return total
