"""From a case to the model of its kind."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.diagnosis.simulators.built_in import build_in
from toolkit.diagnosis.simulators.simulator import Model
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.diagnosis.case.case import Case


def model_of(case: Case, calibrations: Path | None) -> Model:
    """Return the simulation of a case, ready to run.

    Raises
    ------
    ConfigError
        the simulator, tire file or calibration cannot be used
    """
    model = _model(case, calibrations)
    build_in(case, model)
    return model


def _model(case: Case, calibrations: Path | None) -> Model:
    kind = case.simulation.kind
    if kind == "python":
        from toolkit.diagnosis.simulators.python import PythonModel, load_functions

        return PythonModel(case, *load_functions(case.file(), case.simulation.function))
    if kind == "ode":
        from toolkit.diagnosis.simulators.ode import OdeModel
        from toolkit.diagnosis.simulators.python import load_functions

        return OdeModel(case, *load_functions(case.file(), "rhs", "outputs", "initial"))
    if kind == "columns":
        from toolkit.diagnosis.simulators.columns import ColumnsModel

        return ColumnsModel(case)
    return _machine(case, calibrations)


def _machine(case: Case, calibrations: Path | None) -> Model:
    from toolkit.diagnosis.simulators.machine import MachineModel
    from toolkit.machine import load_machine
    from toolkit.tires.tir import read_tir

    machine = load_machine(case.simulation.machine)
    record = record_of(case, calibrations) if case.simulation.calibration else None
    roles = {one.name: one.role for one in case.channels}
    if record is not None and all(roles.get(name) == "input" for name in record.indications):
        from toolkit.diagnosis.simulators.acquisition import AcquisitionModel

        return AcquisitionModel(case, record, _others(calibrations))
    if case.simulation.tire is None:
        raise ConfigError(
            "the simulation has no tire",
            where=f"{case.path}: simulation.tire",
            got="nothing",
            expected='tire = "tire.tir", or the cells as inputs with a calibration',
            next_step="name the tire file",
            rule="case",
        )
    # Where FY and MZ are given in place of the cells, a calibration has nothing to be applied to.
    if record is not None and not any(name in roles for name in record.indications):
        record = None
    return MachineModel(case, read_tir(case.simulation.tire), record, machine.drum.speed_m_s)


def _others(calibrations: Path | None) -> tuple[CalibrationRecord, ...]:
    from toolkit.calibration.registry.registry import Registry

    if calibrations is None:
        return ()
    registry = Registry(calibrations)
    return tuple(record for instrument in registry.instruments() for record in registry.usable(instrument)[0])


def record_of(case: Case, calibrations: Path | None) -> CalibrationRecord:
    """Return the calibration that a case names: a path beside the case file, or a registry's id."""
    from toolkit.calibration.records.record import from_bytes
    from toolkit.calibration.registry.registry import Registry
    from toolkit.files import read_bytes

    named = case.simulation.calibration
    path = case.path.parent / named
    if path.is_file():
        return from_bytes(read_bytes(path), where=path)
    if calibrations is None:
        raise ConfigError(
            "the case names a calibration and there is no registry",
            where=f"{case.path}: simulation.calibration",
            got=named,
            expected="the path of a record beside the case, or a home with calibrations/",
            next_step="give --calibrations DIR",
            rule="case",
        )
    return Registry(calibrations).load(named)
