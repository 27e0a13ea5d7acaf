"""What the acquisition program was given: the issued coefficients of a record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.calibration.records.record import CalibrationRecord, LoadFit, from_bytes
from toolkit.errors import ConfigError, RecordError
from toolkit.inputs import RECORD_FILE, is_regular, read_input
from toolkit.simulation.acquisition import OwnProgram
from toolkit.simulation.cells import CELLS
from toolkit.units import si_scale, unit

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.simulation.plan import Plan


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


def other_programs(plan: Plan, registry: Registry | None) -> dict[str, OwnProgram]:
    """Return the programs of the wrong calibrations that a plan names: paths of records, or registry ids.

    Raises
    ------
    ConfigError
        a registry id without a registry; RegistryError: an unknown or damaged record; RecordError: a record
        that is not of these cells or not in their unit
    """
    own_programs = {}
    for effect in plan.effects:
        if not effect.effect.replaces_record or effect.source is None or effect.source in own_programs:
            continue
        path = Path(effect.source)
        if path.suffix == ".json" and is_regular(path):
            record = from_bytes(read_input(path, RECORD_FILE), where=path)
        elif registry is None:
            raise ConfigError(
                "a wrong calibration is named and there is no registry",
                where=f"--effect {effect.effect.name}={effect.source}", got=effect.source,
                expected="a home with calibrations/, or the path of a record (.json)",
                next_step="give --calibrations DIR", rule="effect-value",
            )  # fmt: skip
        else:
            record = registry.load(effect.source)
        cell_unit = unit(plan.machine.column(CELLS[0]).unit)
        for text in record.indication_units:
            if unit(text).dimension != cell_unit.dimension:
                raise _unfit(record, f"indications in {text}", f"indications in {cell_unit.text}")
        own_programs[effect.source] = program_from(record)
    return own_programs


def _linear(record: CalibrationRecord, fit: LoadFit) -> tuple[float, ...]:
    # SI: load unit over indication unit, in the order of CELLS, the constant last (0 where there is none).
    coefficients = dict(zip(fit.terms, fit.issued, strict=True))
    constant = coefficients.pop("intercept", 0.0)
    if set(coefficients) - set(CELLS):
        raise _unfit(record, f"{fit.load}: terms {', '.join(fit.terms)}", "a linear equation")
    scale = si_scale(fit.unit)
    units = record.units
    return (
        *(coefficients.get(name, 0.0) * scale / si_scale(units[name]) for name in CELLS),
        constant * scale,
    )


def _unfit(record: CalibrationRecord, actual: str, expected: str) -> RecordError:
    return RecordError(
        f"record {record.id} cannot be given to the virtual machine's acquisition program",
        where=record.id,
        got=actual,
        expected=expected,
        next_step="simulate without a registry, or calibrate the virtual machine by a linear session",
    )
