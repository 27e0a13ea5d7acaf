"""Kind ``machine``: a tire file on the machine, judged on FY and MZ, from the cells where there are any."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.calibration.registry.registry import Registry
from toolkit.diagnosis.simulators.acquisition import AcquisitionModel
from toolkit.diagnosis.simulators.cells import CaseCells, record_of
from toolkit.diagnosis.simulators.channels import channel_places, through_channels
from toolkit.diagnosis.simulators.setting import setting, si
from toolkit.diagnosis.simulators.simulator import Capability, Output
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
from toolkit.spelling import nearest
from toolkit.tires.models import mf52, mf61
from toolkit.tires.slip import state
from toolkit.tires.tir import FOREIGN, TirFile, read_tir, si_number
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.arrays import Array
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.diagnosis.case.case import Case, Run

# A tire file as a function of slip angle, load, camber and pressure, with some coefficients replaced.


_SCALES = tuple(
    "LFZO LCX LMUX LEX LKX LHX LVX LGAX LCY LMUY LEY LKY LHY LVY LGAY LTR LRES LGAZ LXAL LYKA LVYKA LS "
    "LMUV LKYC LKZC".split()
)


class TirTire:
    """Pure lateral and aligning force of a tire file, ISO-W, SI."""

    def __init__(self, tir: TirFile) -> None:
        self._version = tir.version
        self._p = dict(tir.coefficients())
        self.FNOMIN = si_number(tir, "FNOMIN")
        self._radius = si_number(tir, "UNLOADED_RADIUS")
        self._speed = si_number(tir, "LONGVL", 0.0) or None
        self._nominal = si_number(tir, "NOMPRES", 0.0)
        self._inflation = si_number(tir, "INFLPRES", self._nominal)
        self.names = frozenset((*self._p, *_SCALES, *mf61.LATERAL, *mf61.ALIGNING)) - FOREIGN[self._version]
        self.has_pressure = self._version != "5.2" and self._nominal > 0 and any(
            self._p.get(name) for name in ("PPY1", "PPY2", "PPY3", "PPY4", "PPZ1", "PPZ2")
        )  # fmt: skip
        self.has_camber = any(
            self._p.get(name)
            for name in ("PKY6", "PKY7", "PVY3", "PVY4", "PHY3", "PDY3", "QDZ8", "QDZ9", "QHZ3", "QHZ4")
        )

    def __call__(
        self,
        p: Mapping[str, float],
        *,
        SA: Array,
        FZ: Array,
        IA: Array,
        V: Array,
        P: Array | None,
        pressure_error: Array | float,
    ) -> tuple[Array, Array]:
        """Return FY [N] and MZ [N·m], each (n,); nothing where there is no load.

        ``p`` replaces coefficients by name; ``P`` [Pa], None for the file's own pressure;
        ``pressure_error`` [Pa] is added to it.
        """
        loaded = FZ > 0
        load = np.where(loaded, FZ, self.FNOMIN)
        change: Array | float = 0.0
        if self._version != "5.2" and self._nominal > 0:
            change = ((self._inflation if P is None else P) + pressure_error) / self._nominal - 1
        values = {**self._p, **p}
        with np.errstate(all="ignore"):
            q = state(
                values, SA=SA, FZ=load, FNOMIN=self.FNOMIN, IA=IA, KAPPA=0.0, pressure_change=change,
                V=V, V0=self._speed if self._version == "6.x" else None, angles="star",
            )  # fmt: skip
            responses = (mf52 if self._version == "5.2" else mf61).forces(
                values, q, UNLOADED_RADIUS=self._radius
            )
        return np.where(loaded, responses.FY, 0.0), np.where(loaded, responses.MZ, 0.0)


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
            averages=False,
            repeats=None,
            together=None,
            motion=None,
        )
        self.parameters = case.parameters
        for parameter in case.parameters:
            if parameter.name in _MACHINE_NUMBERS:
                _check_dimension(case, parameter.name, parameter.unit)
            elif parameter.name not in self._tire.names:
                near = nearest(parameter.name, sorted((*self._tire.names, *_MACHINE_NUMBERS)))
                raise ConfigError(
                    f"the simulation has no parameter {parameter.name!r}",
                    where=f"{case.path}: simulation.parameters",
                    got=parameter.name,
                    expected="a coefficient or scale factor of the tire file, or a number of the machine: "
                    + ", ".join(_MACHINE_NUMBERS),
                    next_step=f"did you mean {near!r}?" if near else "correct the name",
                    rule="case",
                )
        self._direct = {output.name for output in case.outputs}
        self.outputs = self._outputs()
        self._settings: dict[Run, Any] = {}

    def _outputs(self) -> tuple[Output, ...]:
        outputs = []
        direct = {output.name: output for output in self.case.outputs}
        for name, text in _FORCES.items():
            if name in direct:
                outputs.append(Output(name=name, unit=direct[name].unit, sd=direct[name].sd))
            elif self.cells is not None and name in self.cells.loads:
                outputs.append(Output(name=name, unit=text, sd=self.cells.noise(name)))
        if "FZ" in direct:
            outputs.append(Output(name="FZ", unit=direct["FZ"].unit, sd=direct["FZ"].sd))
        names = {output.name for output in outputs} | (set(self.cells.names) if self.cells else set())
        unknown = [name for name in direct if name not in names]
        if unknown or not outputs:
            raise ConfigError(
                "an output is nothing that the machine simulates",
                where=f"{self.case.path}: recording.channels",
                got=", ".join(unknown) or "no output",
                expected="FY, MZ, FZ, or D51, D52, E5 with a calibration",
                next_step="change the channel's role, or name the calibration",
                rule="case",
            )
        return tuple(outputs)

    def observed(self, run: Run) -> dict[str, Array]:
        """Return FY and MZ as recorded, or from the cells by the calibration; FZ where it is judged."""
        columns = {}
        for output in self.outputs:
            # The acquisition program's own FY beside the cells is judged only where its role says so.
            if output.name in self._direct:
                if output.name in run.columns:
                    columns[output.name] = run.columns[output.name]
            elif self.cells is not None and all(cell in run.columns for cell in self.cells.names):
                columns[output.name] = self.cells.load(run, output.name) / unit(output.unit).factor
        return columns

    def simulate(self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]) -> dict[str, Array]:
        """Return every output of a run with effects in it."""
        case, around = self.case, self._setting(run)
        start = base_drive(case, run, load_N=self._load, speed_m_s=self._drum_speed(p))
        start = dataclasses.replace(start, FZ=start.FZ - self._shown_too_much(run, active, around))
        reverse = rotation(run) == "reverse"
        pressure = first_of(case, run, "P_INFL", "P")

        def steady(SA: Array, at: Drive) -> TireForces:
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
        on_tire = [applied for applied in active if not (measured and delays_load(applied))]
        forces = through_tire(start, steady, on_tire, run, around)
        turn = tire_signs("machine", case.axes, run)
        columns = {}
        for output in self.outputs:
            if output.name in _FORCES:
                columns[output.name] = (
                    turn[output.name] * getattr(forces, output.name) / unit(output.unit).factor
                )
            else:
                columns["FZ"] = self._load_output(run, active) / unit(output.unit).factor
        values = through_channels(columns, active, run, around, run.columns)
        return (
            values if self.cells is None else self.cells.disturbed(values, active, run, around, self.outputs)
        )

    def _drum_speed(self, p: Mapping[str, float]) -> float:
        """Return the surface speed [m/s]: that of the machine definition, unless a parameter frees it."""
        for parameter in self.parameters:
            if parameter.name == "drum.speed":
                return p[parameter.name] * unit(parameter.unit).factor
        return self._speed

    def _shown_too_much(self, run: Run, active: Sequence[AppliedEffect], around: Any) -> Array | float:
        """Return by how much [N] a channel of FZ that is disturbed shows more than the load on the tire."""
        if not any(applied.channel == "FZ" and applied.acts_in(run) for applied in active):
            return 0.0
        if "FZ" not in self._direct or first_of(self.case, run, "FZ") is None:
            return 0.0
        factor = unit(self.case.unit("FZ")).factor
        load = self._load_output(run, active) / factor
        on_load = [applied for applied in active if applied.channel == "FZ"]
        return (through_channels({"FZ": load}, on_load, run, around, run.columns)["FZ"] - load) * factor

    def _load_output(self, run: Run, active: Sequence[AppliedEffect]) -> Array:
        commanded = first_of(self.case, run, "FZ_CMD")
        if commanded is None:
            return si(self.case, "FZ", run.columns["FZ"])
        start = drive(run.t, np.zeros(run.rows), commanded)
        loaded = late(start, active, run, self._setting(run), _no_tire)
        return commanded if loaded is None else loaded.FZ

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return where an effect could act: on the machine, on an output, or on a cell."""
        case = self.case
        names = {channel.name for channel in case.channels}
        drivers = {driver.name for driver in case.drivers}
        found = tire_places(
            effect,
            has_IA=self._tire.has_camber,
            has_P=self._tire.has_pressure,
            varies={"load_commanded": "FZ_CMD" in names},
        )
        others = [
            (driver.name, driver.unit) for driver in case.drivers if driver.name in ("FZ", "FZ_CMD", "FX")
        ]
        if "FZ" in {output.name for output in self.outputs}:
            others = [channel for channel in others if channel[0] != "FZ"]
        found += channel_places(
            effect, [(output.name, output.unit) for output in self.outputs], others, drivers
        )
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
        values = {parameter.name: parameter.value for parameter in self.parameters}

        def lateral(_: Run, start: Drive) -> Array:
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


def build(case: Case, calibrations: Path | None, _: object) -> MachineModel | AcquisitionModel:
    """Return the simulation of a case of this kind: a tire on the machine, or the acquisition alone.

    Raises
    ------
    ConfigError
        no tire, or a tire file, calibration or channel that cannot be used
    """
    machine = load_machine(case.simulation.machine)
    record = record_of(case, calibrations) if case.simulation.calibration else None
    roles = {channel.name: channel.role for channel in case.channels}
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
