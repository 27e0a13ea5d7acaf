"""Kind ``machine``: a tire file on the machine, judged on FY and MZ, from the cells where there are any."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.calibration.registry.registry import Registry
from toolkit.diagnosis.simulators.acquisition import AcquisitionModel
from toolkit.diagnosis.simulators.cells import CaseCells, record_of
from toolkit.diagnosis.simulators.channels import channel_places, through_channels
from toolkit.diagnosis.simulators.setting import setting, si
from toolkit.diagnosis.simulators.simulator import Capability, Output
from toolkit.diagnosis.simulators.tir_tire import TirTire
from toolkit.diagnosis.simulators.tire import (
    base_drive,
    delays_load,
    first_of,
    late,
    rotation,
    slip_work_before,
    through_tire,
    tire_places,
    tire_signs,
)
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.signals import Drive, TireForces, drive
from toolkit.errors import ConfigError
from toolkit.machine import load_machine
from toolkit.tires.tir import TirFile, read_tir
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.diagnosis.case.case import Case, Run

# Numbers of the machine definition that the simulation of FY and MZ depends on or may be asked for.
_MACHINE_NUMBERS = {"drum.speed": "speed", "drum.circumference": "length", "cells.pitch_diameter": "length"}
_FORCES = {"FY": "N", "MZ": "N*m"}


class MachineModel:
    """A tire file of the Magic Formula on a machine definition, with the cells' calibration."""

    def __init__(self, case: Case, tir: TirFile, record: CalibrationRecord | None, speed_m_s: float) -> None:
        self.case = case
        self._tire = TirTire(tir)
        self._speed = speed_m_s
        self._load = self._tire.FNOMIN
        self.cells = None if record is None else CaseCells(case, record)
        self.capability = Capability(
            nominal_load_N=self._load,
            cells=() if self.cells is None else self.cells.names,
            unsure={},
            findings=tir.findings(),
            repeats=None,
            together=None,
            motion=None,
        )
        self.parameters = case.parameters
        for one in case.parameters:
            if one.name in _MACHINE_NUMBERS:
                _check_dimension(case, one.name, one.unit)
            elif one.name not in self._tire.names:
                near = difflib.get_close_matches(
                    one.name, sorted((*self._tire.names, *_MACHINE_NUMBERS)), n=1
                )
                raise ConfigError(
                    f"the simulation has no parameter {one.name!r}",
                    where=f"{case.path}: simulation.parameters",
                    got=one.name,
                    expected="a coefficient or scale factor of the tire file, or a number of the machine: "
                    + ", ".join(_MACHINE_NUMBERS),
                    next_step=f"did you mean {near[0]!r}?" if near else "correct the name",
                    rule="case",
                )
        self._direct = {one.name for one in case.outputs}
        self.outputs = self._outputs()
        self._settings: dict[Run, Any] = {}

    def _outputs(self) -> tuple[Output, ...]:
        made = []
        direct = {one.name: one for one in self.case.outputs}
        for name, text in _FORCES.items():
            if name in direct:
                made.append(Output(name=name, unit=direct[name].unit, sd=direct[name].sd))
            elif self.cells is not None and name in self.cells.loads:
                made.append(Output(name=name, unit=text, sd=self.cells.noise(name)))
        if "FZ" in direct:
            made.append(Output(name="FZ", unit=direct["FZ"].unit, sd=direct["FZ"].sd))
        known = {one.name for one in made} | (set(self.cells.names) if self.cells else set())
        unknown = [name for name in direct if name not in known]
        if unknown or not made:
            raise ConfigError(
                "an output is nothing that the machine simulates",
                where=f"{self.case.path}: recording.channels",
                got=", ".join(unknown) or "no output",
                expected="FY, MZ, FZ, or D51, D52, E5 with a calibration",
                next_step="change the channel's role, or name the calibration",
                rule="case",
            )
        return tuple(made)

    def observed(self, run: Run) -> dict[str, NDArray[np.float64]]:
        """Return FY and MZ as recorded, or from the cells by the calibration; FZ where it is judged."""
        made = {}
        for one in self.outputs:
            # The acquisition program's own FY beside the cells is judged only where its role says so.
            if one.name in self._direct:
                if one.name in run.columns:
                    made[one.name] = run.columns[one.name]
            elif self.cells is not None and all(cell in run.columns for cell in self.cells.names):
                made[one.name] = self.cells.load(run, one.name) / unit(one.unit).factor
        return made

    def simulate(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]
    ) -> dict[str, NDArray[np.float64]]:
        """Return every output of a run with effects in it."""
        case, here = self.case, self._setting(run)
        start = base_drive(case, run, load_N=self._load, speed_m_s=self._drum_speed(p))
        start = dataclasses.replace(start, FZ=start.FZ - self._shown_too_much(run, active, here))
        reverse = rotation(run) == "reverse"
        pressure = first_of(case, run, "P_INFL", "P")

        def steady(SA: NDArray[np.float64], at: Drive) -> TireForces:
            FY, MZ = self._tire(
                p,
                SA=-SA,
                FZ=at.FZ,
                IA=-at.IA if reverse else at.IA,
                V=at.V,
                P=pressure,
                pressure_error=at.pressure_error,
            )
            return TireForces(FY=FY if reverse else -FY, MZ=-MZ)

        # A load that was measured is late already: its lag shows in FZ against the command, not in the tire.
        measured = first_of(case, run, "FZ") is not None
        on_tire = [one for one in active if not (measured and delays_load(one))]
        forces = through_tire(start, steady, on_tire, run, here)
        turn = tire_signs("machine", case.axes, run)
        made = {}
        for one in self.outputs:
            if one.name in _FORCES:
                made[one.name] = turn[one.name] * getattr(forces, one.name) / unit(one.unit).factor
            else:
                made["FZ"] = self._load_output(run, active) / unit(one.unit).factor
        values = through_channels(made, active, run, here, run.columns)
        return values if self.cells is None else self.cells.disturbed(values, active, run, here, self.outputs)

    def _drum_speed(self, p: Mapping[str, float]) -> float:
        """Return the surface speed [m/s]: that of the machine definition, unless a parameter frees it."""
        for one in self.parameters:
            if one.name == "drum.speed":
                return p[one.name] * unit(one.unit).factor
        return self._speed

    def _shown_too_much(
        self, run: Run, active: Sequence[AppliedEffect], here: Any
    ) -> NDArray[np.float64] | float:
        """Return by how much [N] a channel of FZ that is disturbed shows more than the load on the tire."""
        if not any(one.channel == "FZ" and one.acts_in(run) for one in active):
            return 0.0
        if "FZ" not in self._direct or first_of(self.case, run, "FZ") is None:
            return 0.0
        factor = unit(self.case.unit("FZ")).factor
        load = self._load_output(run, active) / factor
        on_load = [one for one in active if one.channel == "FZ"]
        return (through_channels({"FZ": load}, on_load, run, here, run.columns)["FZ"] - load) * factor

    def _load_output(self, run: Run, active: Sequence[AppliedEffect]) -> NDArray[np.float64]:
        commanded = first_of(self.case, run, "FZ_CMD")
        if commanded is None:
            return si(self.case, "FZ", run.columns["FZ"])
        start = drive(run.t, np.zeros(run.rows), commanded)
        loaded = late(start, active, run, self._setting(run), _no_tire)
        return commanded if loaded is None else loaded.FZ

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return where an effect could act: on the machine, on an output, or on a cell."""
        case = self.case
        names = {one.name for one in case.channels}
        drivers = {one.name for one in case.drivers}
        found = tire_places(
            effect,
            has_IA=self._tire.has_camber,
            has_P=self._tire.has_pressure,
            varies={"load_commanded": "FZ_CMD" in names},
        )
        others = [(one.name, one.unit) for one in case.drivers if one.name in ("FZ", "FZ_CMD", "FX")]
        if "FZ" in {one.name for one in self.outputs}:
            others = [one for one in others if one[0] != "FZ"]
        found += channel_places(effect, [(one.name, one.unit) for one in self.outputs], others, drivers)
        if self.cells is not None:
            found += self.cells.places(effect, drivers)
        return found

    def _setting(self, run: Run) -> Any:
        if run not in self._settings:
            self._settings[run] = setting(
                self.case,
                run,
                nominal_load_N=self._load,
                speed_m_s=self._speed,
                work_kJ=self._work_before(run),
            )
        return self._settings[run]

    def _work_before(self, run: Run) -> float:
        values = {one.name: one.value for one in self.parameters}

        def lateral(_: Run, start: Drive) -> NDArray[np.float64]:
            return self._tire(
                values, SA=-start.SA, FZ=start.FZ, IA=start.IA, V=start.V, P=None, pressure_error=0.0
            )[0]

        return slip_work_before(self.case, run, lateral, load_N=self._load, speed_m_s=self._speed)


def _no_tire(at: Drive) -> TireForces:
    return TireForces(FY=np.zeros_like(at.FZ), MZ=np.zeros_like(at.FZ))


def _check_dimension(case: Case, name: str, text: str) -> None:
    if unit(text).dimension != _MACHINE_NUMBERS[name]:
        raise ConfigError(
            "a parameter's unit does not fit it",
            where=f"{case.path}: simulation.parameters.{name}.unit",
            got=text,
            expected=f"a unit of {_MACHINE_NUMBERS[name]}",
            next_step="correct the unit",
            rule="case",
        )


def build(case: Case, calibrations: Path | None) -> MachineModel | AcquisitionModel:
    """Return the simulation of a case of this kind: a tire on the machine, or the acquisition alone.

    Raises
    ------
    ConfigError
        no tire, or a tire file, calibration or channel that cannot be used
    """
    machine = load_machine(case.simulation.machine)
    record = record_of(case, calibrations) if case.simulation.calibration else None
    roles = {one.name: one.role for one in case.channels}
    if record is not None and all(roles.get(name) == "input" for name in record.indications):
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
    if calibrations is None:
        return ()
    registry = Registry(calibrations)
    return tuple(record for instrument in registry.instruments() for record in registry.usable(instrument)[0])
