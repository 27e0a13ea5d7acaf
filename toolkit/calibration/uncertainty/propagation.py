"""What all rows of one record have in common: the covariance that goes into everything computed with it.

A test is a weighted sum of loads that one record computed. Errors of the record do not average out over its
rows; the covariance of its coefficients carries them, J V J^T (JCGM 100 eq. 13), and lets them cancel in
differences where they must. Beside the scatter of the fit, which V_fit holds, follow from the record alone:

- *scale*: had the reference applied (1 + e) times the load it states, least squares, linear in the loads,
  would have returned (1 + e) c: every coefficient, the intercept too. So V_scale = u(e)^2 c c^T, and the
  error of a load is e f(x): it grows with the load, is zero at zero load, and stays in every sum that is
  not zero. u(e) is u(reference) over the largest calibrated load, where the stated U is meant, whether it
  was stated as an amount or as a share of the load; the budget reads it so too. Creep, a part of the load as
  well, is added to it.
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
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.terms import INTERCEPT
from toolkit.calibration.uncertainty.readings import creep, left_at_zero, sensitivities, zero_drift

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.statements import Statements


def record_covariance(record: CalibrationRecord) -> dict[str, NDArray[np.float64]]:
    """Return load -> covariance of its coefficients (terms, terms), with what the session stated.

    A legacy record, which has no covariance, gives none; a session that states nothing gives the fit's own.
    """
    statements = statements_of(record)
    return {load.load: _covariance(record, load, statements) for load in record.loads if load.covariance}


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
    middle = [((c.minimum or 0.0) + (c.maximum or 0.0)) / 2 for c in record.cells]
    slope = sensitivities(record, load, middle)
    moved = 0.0 if isinstance(drift, str) else float(slope @ np.asarray(drift)) / math.sqrt(3.0)
    return math.hypot(tared, float(np.linalg.norm(slope * np.asarray(stated))), moved)


def _covariance(record: CalibrationRecord, load: LoadFit, statements: Statements) -> NDArray[np.float64]:
    total = np.array(load.covariance)
    scale = scale_u(record, load, statements)
    if scale > 0:
        c = np.asarray(load.coefficients)
        total += scale**2 * np.outer(c, c)
    if INTERCEPT in load.terms:
        at = load.terms.index(INTERCEPT)
        total[at, at] += offset_u(record, load, statements) ** 2
    return total
