"""What the acquisition program was given: the issued coefficients of a record."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.errors import RecordError
from toolkit.simulation.acquisition import OwnProgram
from toolkit.simulation.cells import CELLS
from toolkit.units import si_scale

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit


def program_from(record: CalibrationRecord) -> OwnProgram:
    """Return the program that a record's certificate gives.

    Raises
    ------
    RecordError
        the record is not of these cells, not linear, or lacks FY or MZ
    """
    if record.indications != CELLS:
        raise _unfit(record, f"indications {', '.join(record.indications)}", ", ".join(CELLS))
    terms = {load: _linear(record, record.load(load)) for load in ("FY", "MZ")}
    return OwnProgram(
        record=record.id,
        FY=terms["FY"][:-1],
        MZ=terms["MZ"][:-1],
        FY_constant=terms["FY"][-1],
        MZ_constant=terms["MZ"][-1],
    )


def _linear(record: CalibrationRecord, fit: LoadFit) -> tuple[float, ...]:
    # SI: load unit over indication unit, in the order of CELLS, the constant last (0 where there is none).
    given = dict(zip(fit.terms, fit.issued, strict=True))
    constant = given.pop("intercept", 0.0)
    if set(given) - set(CELLS):
        raise _unfit(record, f"{fit.load}: terms {', '.join(fit.terms)}", "a linear equation")
    scale = si_scale(fit.unit)
    units = dict(zip(record.indications, record.indication_units, strict=True))
    return (*(given.get(name, 0.0) * scale / si_scale(units[name]) for name in CELLS), constant * scale)


def _unfit(record: CalibrationRecord, got: str, expected: str) -> RecordError:
    return RecordError(
        f"record {record.id} cannot be given to the virtual machine's acquisition program",
        where=record.id,
        got=got,
        expected=expected,
        next_step="simulate without a registry, or calibrate the virtual machine by a linear session",
    )
