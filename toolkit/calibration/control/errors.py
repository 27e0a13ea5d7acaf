"""Errors of a session's rows by a record that was not fitted to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.calibration.apply import apply_record
from toolkit.errors import ToolkitError, UnitError
from toolkit.units import si_scale

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord, Zero
    from toolkit.calibration.session.table import Table


def errors_by(record: CalibrationRecord, table: Table, *, zero: Zero) -> dict[str, NDArray[np.float64]] | str:
    """Return fitted minus reference (rows,) of each load that both have, in the table's unit.

    ``zero`` is the session's. A text tells why the record cannot be held against these rows: another
    indication or unit, or indications that were not tared where the record needs that. Tared rows under a
    record that includes the zero are compared without its intercept.
    """
    if record.zero != "included" and zero == "included":
        return f"{record.id} was fitted to tared indications, the session's are not tared"
    missing = [name for name in record.indications if not table.has(name)]
    if missing:
        return f"{record.id} needs {', '.join(missing)}, which the session does not have"
    units = dict(zip(record.indications, record.indication_units, strict=True))
    try:
        in_units = table.in_units(units)
    except UnitError as error:
        return f"{record.id}: {error.what}"
    loads = [one.load for one in record.loads if table.has(one.load)]
    if not loads:
        return f"{record.id} has none of the session's loads"
    tare = dict.fromkeys(units, 0.0) if (record.zero == "included") != (zero == "included") else None
    try:
        fitted = apply_record(
            record, in_units.columns(record.indications), units=units, tare=tare, only=loads
        )
        return {
            load: fitted[load] / si_scale(table.unit(load), where=f"column {load}") - table.column(load)
            for load in loads
        }
    except ToolkitError as error:
        return f"{record.id}: {error.what}"
