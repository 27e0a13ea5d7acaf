"""From indications to loads: one record's equation on arrays."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.terms import term_matrix
from toolkit.errors import RecordError
from toolkit.units import si_scale, unit


def apply_record(
    record: CalibrationRecord,
    indications: Mapping[str, Array],
    *,
    units: Mapping[str, str],
    tare: Mapping[str, float] | None = None,
    issued: bool = False,
    only: Collection[str] | None = None,
) -> dict[str, Array]:
    """Return the loads [N, N*m] of a record from indications in its own units.

    Parameters
    ----------
    record : a record that the registry has checked
    indications : name to values (rows,), in the record's indication units
    units : name to the unit of those values, compared with the record's
    tare : name to the unloaded indication, in the same units; None where there is none
    issued : use the issued coefficients, those that an acquisition program is given
    only : names of the loads that are wanted; None for all

    Notes
    -----
    With a tare, a record with ``zero = "tared"`` or ``"run"`` was fitted to indications from their zero:
    load = f(x - tare), and its intercept applies. One with ``zero = "included"`` was fitted to indications
    as they come: load = f(x) - f(tare), in which the intercept cancels. Without a tare load = f(x).

    Raises
    ------
    RecordError
        an indication is missing, or its unit is not the record's
    """
    check_units(record, units)
    _check_present(record, indications)
    return {
        load.load: _evaluate(record, load, indications, tare, issued=issued)
        * si_scale(load.unit, where=record.id)
        for load in record.loads
        if only is None or load.load in only
    }


def coefficient_jacobian(
    record: CalibrationRecord,
    load: str,
    indications: Mapping[str, Array],
    tare: Mapping[str, float] | None = None,
) -> Array:
    """Return d load / d coefficient (rows, terms), in the load's unit per unit of coefficient.

    With the record's covariance V, the variance of row i is J[i] V J[i]^T; a mean over rows has the mean
    of J, because the coefficients are common to all rows.
    """
    return _terms(record, record.load(load), indications, tare)


def check_units(record: CalibrationRecord, units: Mapping[str, str]) -> None:
    """Refuse a record whose indication units are not those given.

    Raises
    ------
    RecordError
        ``units``: the recording and the record differ
    """
    for name, expected in zip(record.indications, record.indication_units, strict=True):
        stated = units.get(name)
        needed = unit(expected, where=record.id)
        present = None if stated is None else unit(stated, where=f"channel {name}")
        if present is None or (present.factor, present.dimension) != (needed.factor, needed.dimension):
            raise RecordError(
                f"the unit of {name} is not that of record {record.id}",
                where=f"{record.id}, {name}",
                got=stated or f"no unit for {name}",
                expected=expected,
                next_step="use a record fitted in the recording's unit, or correct the machine definition",
                rule="units",
            )


def _check_present(record: CalibrationRecord, indications: Mapping[str, object]) -> None:
    missing = [name for name in record.indications if name not in indications]
    if missing:
        raise RecordError(
            f"record {record.id} needs an indication that is not there",
            where=record.id,
            got=", ".join(indications),
            expected=", ".join(record.indications),
            next_step="check the recording's columns: " + ", ".join(missing),
            rule="units",
        )


def _terms(
    record: CalibrationRecord,
    load: LoadFit,
    indications: Mapping[str, Array],
    tare: Mapping[str, float] | None,
) -> Array:
    values = {name: np.asarray(indications[name], dtype=np.float64) for name in record.indications}
    if tare is None:
        return term_matrix(load.terms, values)
    if record.zero != "included":
        return term_matrix(load.terms, {name: values[name] - tare[name] for name in values})
    unloaded = {name: np.array([tare[name]]) for name in values}
    return term_matrix(load.terms, values) - term_matrix(load.terms, unloaded)


def _evaluate(
    record: CalibrationRecord,
    load: LoadFit,
    indications: Mapping[str, Array],
    tare: Mapping[str, float] | None,
    *,
    issued: bool,
) -> Array:
    loads: Array = _terms(record, load, indications, tare) @ np.asarray(
        load.issued if issued else load.coefficients
    )
    return loads
