"""Budget of a calibrated load at any load value (GUM), and of any point of indications.

The measurand is the load that the record gives for one reading in later use: another day, run and mounting.

    L = f(x + e_x; c + e_c) + e_reference + e_repeat + e_between + e_creep + e_zero + e_rev + e_misfit + e_T

with u(L)^2 = sum of u_i^2 (JCGM 100, eq. 10: the terms are independent), effective degrees of freedom by
Welch-Satterthwaite (G.2b; what the rows give together counts as one estimate), U = k u with k = t_95(dof)
(G.6.4). Which parts a force calibration has:
ISO 376:2011 annex C and EURAMET cg-4; their forms are those of a deflection, ours of the load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.session.table import Table
from toolkit.calibration.uncertainty.components import components_of
from toolkit.calibration.uncertainty.model import Budget, Contribution, Temperature
from toolkit.calibration.uncertainty.scatter import Scatter, scatter_of
from toolkit.errors import SessionError
from toolkit.estimate import coverage_factors, effective_dof

PROBABILITY = 0.95
_AT_A_TIME = 1 << 12  # rows whose budgets are made together: some megabytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """A load predicted from indications. ``beyond`` names the indications outside their calibrated range."""

    budget: Budget
    beyond: tuple[str, ...]


def calibration_budget(
    record: CalibrationRecord,
    loads: Table,
    check: Table | None,
    load: str,
    at: float | None = None,
    *,
    temperature: Temperature | None = None,
    scatter: Scatter | None = None,
) -> Budget:
    """Return the budget of a load at a load value.

    Parameters
    ----------
    record : as the registry checked it
    loads, check : its reference and check loads (`registry.stored`), in its units
    load : name
    at : load value in the record's unit, the other loads zero; None: the largest
    temperature : the sensitivity's coefficient and the span in use; None: listed as not stated
    scatter : that of other rows, such as those of a plan; None: that of ``loads``

    Raises
    ------
    SessionError
        ``budget``: a legacy record, or a value outside the calibrated range
    RecordError
        the record has no such load
    """
    fitted = _fitted(record, load)
    low, high = fitted.interval
    value = (high if high >= -low else low) if at is None else float(at)
    if not low <= value <= high:
        raise _refused(
            f"{record.id}, {load}", "the load lies outside the calibrated range",
            f"{value:.6g} {fitted.unit}", f"{low:.6g} to {high:.6g} {fitted.unit}",
            "ask within the range, or calibrate over a larger one",
        )  # fmt: skip
    point = typical_indications(record, loads, load, value)
    return _budget(record, loads, check, fitted, value, point, temperature, PROBABILITY, scatter)


def predict(
    record: CalibrationRecord,
    loads: Table,
    check: Table | None,
    load: str,
    indications: Mapping[str, float],
    *,
    temperature: Temperature | None = None,
    probability: float = PROBABILITY,
) -> Prediction:
    """Return the load that a set of indications [the record's units] means, with its budget.

    Raises
    ------
    SessionError
        ``budget``: a legacy record; an indication is missing, unknown or no finite number
    """
    fitted = _fitted(record, load)
    if set(indications) != set(record.indications) or not all(map(math.isfinite, indications.values())):
        raise _refused(
            record.id, "the indications are not those of the record",
            ", ".join(f"{name}={value:g}" for name, value in indications.items()),
            "a finite number for each of " + ", ".join(record.indications), "give every indication once",
        )  # fmt: skip
    point = np.array([indications[name] for name in record.indications])
    value = fitted.at(dict(zip(record.indications, point[:, None], strict=True))).item()
    return Prediction(
        budget=_budget(record, loads, check, fitted, value, point, temperature, probability),
        beyond=tuple(
            cell.name
            for cell, x in zip(record.cells, point.tolist(), strict=True)
            if cell.minimum is not None and cell.maximum is not None and not cell.minimum <= x <= cell.maximum
        ),
    )


def expanded_of_rows(
    record: CalibrationRecord,
    loads: Table,
    check: Table | None,
    load: str,
    indications: Array,
    *,
    step: Callable[[int], None] | None = None,
) -> Array:
    """Return U of a load at every row of indications (rows, indications) [the record's units].

    Each is that of `predict` at the row, not a number where the row has none. The session's scatter is taken
    once; rows go some thousand at a time, and ``step`` is told how many are done.

    Raises
    ------
    SessionError
        ``budget``: a legacy record
    RecordError
        the record has no such load
    """
    fitted = _fitted(record, load)
    scatter, statements = scatter_of(record, loads, fitted), statements_of(record)
    U = np.full(len(indications), np.nan)
    for start in range(0, len(indications), _AT_A_TIME):
        points = indications[start : start + _AT_A_TIME]
        columns = dict(zip(record.indications, points.T, strict=True))
        values = fitted.at(columns)
        finite = np.isfinite(values)
        if finite.any():
            parts, scatter_dof = components_of(
                record, statements, loads, check, fitted, values=values[finite], points=points[finite],
                temperature=None, scatter=scatter,
            )  # fmt: skip
            U[start : start + _AT_A_TIME][finite] = _combined(parts, scatter_dof, PROBABILITY)[3]
        if step is not None:
            step(start + len(points))
    return U


def typical_indications(record: CalibrationRecord, loads: Table, load: str, at: float) -> Array:
    """Return the indications (indications,) that a load makes by itself: a plane through the session's rows.

    The plane is indications on loads; it only sets the point at which sensitivities are taken.
    """
    names = [load.load for load in record.loads]
    design = np.column_stack([loads.matrix(names), np.ones(loads.rows)])
    scale = np.maximum(np.abs(design).max(axis=0), 1e-300)
    plane = np.linalg.lstsq(design / scale, loads.matrix(record.indications), rcond=None)[0]
    place = np.array([at if name == load else 0.0 for name in names] + [1.0])
    point: Array = (place / scale) @ plane
    return point


def _combined(
    parts: Sequence[Contribution], scatter_dof: Array, probability: float
) -> tuple[Array, Array, Array, Array]:
    """Return (u, dof, k, U) of a budget's components at many points."""
    joint = np.sqrt(np.asarray(sum(part.u**2 for part in parts if part.joint)))
    apart = [(part.u, part.dof) for part in parts if not part.joint]
    return combine([(joint, scatter_dof), *apart], probability)


def combine(
    contributions: Sequence[tuple[Array | float, Array | float]], probability: float
) -> tuple[Array, Array, Array, Array]:
    """Return (u, dof, k, U) of independent (u_i, dof_i) at many points: JCGM 100 eq. 10, G.2b, G.6.4."""
    u = np.sqrt(np.asarray(sum(u * u for u, _ in contributions)))
    dof = effective_dof(contributions)
    k = coverage_factors(dof, probability)
    return u, dof, k, k * u


def _budget(
    record: CalibrationRecord,
    loads: Table,
    check: Table | None,
    load: LoadFit,
    value: float,
    point: Array,
    temperature: Temperature | None,
    probability: float,
    scatter: Scatter | None = None,
) -> Budget:
    parts, scatter_dof = components_of(
        record, statements_of(record), loads, check, load, values=np.array([value]), points=point[None],
        temperature=temperature, scatter=scatter or scatter_of(record, loads, load),
    )  # fmt: skip
    u, dof, k, U = (values.item() for values in _combined(parts, scatter_dof, probability))
    return Budget(
        record=record.id, load=load.load, unit=load.unit, at=value, indications=tuple(point.tolist()),
        components=tuple(part.at(0) for part in parts), u=u, dof=dof, k=k, U=U,
        probability=probability, scatter_dof=scatter_dof.item(),
    )  # fmt: skip


def _fitted(record: CalibrationRecord, load: str) -> LoadFit:
    fitted = record.load(load)
    if record.kind != "fit" or not fitted.covariance:
        raise _refused(
            f"{record.id}, {load}", "a record without its data has no budget", "a legacy import",
            "a record that was fitted from reference loads", "calibrate the instrument",
        )  # fmt: skip
    return fitted


def _refused(where: str, problem: str, actual: object, expected: object, next_step: str) -> SessionError:
    return SessionError(
        problem, where=where, got=actual, expected=expected, next_step=next_step, rule="budget"
    )
