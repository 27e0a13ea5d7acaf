"""Kind ``columns``: another program's output beside the recording; it cannot be run again.

Effects on single channels act on the recorded output as it is. Effects on road, carriage and tire need the
output at other slip angles and loads: a smooth surface through the simulated columns gives the difference.
Where the columns have too few slip angles for that, nothing below the surface's own error is judged.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.channels import channel_places, through_channels
from toolkit.diagnosis.simulators.motion import AlongMotion, Motion, motion_of
from toolkit.diagnosis.simulators.setting import NOMINAL_SPEED, nominal_load, setting
from toolkit.diagnosis.simulators.simulator import Capability, Output
from toolkit.diagnosis.simulators.surface import Surface
from toolkit.diagnosis.simulators.tire import (
    base_drive,
    late,
    slip_work_before,
    through_tire,
    tire_places,
    tire_signs,
)
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.signals import Drive, Setting, TireForces
from toolkit.errors import ConfigError
from toolkit.spelling import nearest
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Case, Run


class ColumnsModel(AlongMotion):
    """Simulated columns; a parameter ``<output>_gain`` or ``<output>_offset`` scales or shifts one."""

    def __init__(self, case: Case) -> None:
        self.case = case
        column_of = dict(case.simulation.simulated)
        missing = [output.name for output in case.outputs if output.name not in column_of]
        if missing:
            raise ConfigError(
                "an output has no simulated column",
                where=f"{case.path}: simulation.simulated",
                got=", ".join(missing),
                expected="a column for every output",
                next_step="name it, or drop the output",
                rule="case",
            )
        extra = [name for name in column_of if name not in {output.name for output in case.outputs}]
        if extra:
            near = nearest(extra[0], [output.name for output in case.outputs])
            raise ConfigError(
                "a simulated column stands for no output",
                where=f"{case.path}: simulation.simulated",
                got=", ".join(extra),
                expected=", ".join(output.name for output in case.outputs),
                next_step=f"did you mean {near!r}?" if near else "declare the channel with role = output",
                rule="case",
            )
        allowed = {f"{name}_{what}" for name in column_of for what in ("gain", "offset")}
        unknown = [parameter.name for parameter in case.parameters if parameter.name not in allowed]
        if unknown:
            raise ConfigError(
                "a simulation that cannot be run again has no such parameter",
                where=f"{case.path}: simulation.parameters",
                got=", ".join(unknown),
                expected=", ".join(sorted(allowed)),
                next_step="remove it, or give the simulation as kind python",
                rule="case",
            )
        self.parameters = case.parameters
        self.outputs = tuple(
            Output(name=output.name, unit=output.unit, sd=output.sd) for output in case.outputs
        )
        self._load = nominal_load(case)
        self._settings: dict[Run, Setting] = {}
        drivers = {driver.name for driver in case.drivers}
        is_tire = bool(drivers & {"SA", "SA_CMD"}) and bool({"FY", "MZ"} & set(column_of))
        self._surface = Surface(case) if is_tire else None
        self.motion: Motion | None = None if is_tire else motion_of(case)
        findings = () if self._surface is None else self._surface.too_coarse()
        self.capability = Capability(
            nominal_load_N=None,
            cells=(),
            unsure={} if self._surface is None else self._surface.unsure,
            findings=findings,
            averages=True,
            repeats=None,
            together=None,
            motion=self.moving(),
        )

    def observed(self, run: Run) -> dict[str, NDArray[np.float64]]:
        """Return what was recorded of every output, where the other program has a value too."""
        return {
            output.name: np.where(np.isfinite(run.simulated[output.name]), run.columns[output.name], np.nan)
            for output in self.outputs
            if output.name in run.columns
        }

    def simulate(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect]
    ) -> dict[str, NDArray[np.float64]]:
        """Return every output of a run with effects in it."""
        around = self.setting(run)
        simulated = {
            output.name: _whole(run, output.name) * p.get(f"{output.name}_gain", 1.0)
            + p.get(f"{output.name}_offset", 0.0)
            for output in self.outputs
        }
        if self._surface is not None and any(
            applied.effect.drive is not None and applied.acts_in(run) for applied in active
        ):
            simulated = self._tire(run, simulated, active, around)
        forces = [
            applied for applied in active if applied.effect.stage == "dynamics" and applied.acts_in(run)
        ]
        if forces and self.motion is not None:
            simulated = self.motion.disturbed(simulated, forces, run)
        return through_channels(simulated, active, run, around, run.columns)

    def places(self, effect: Effect) -> list[tuple[str | None, str | None]]:
        """Return where an effect could act."""
        found: list[tuple[str | None, str | None]] = []
        drivers = {driver.name for driver in self.case.drivers}
        if self._surface is not None and self._surface.good:
            found += tire_places(
                effect,
                has_IA=False,
                has_P=False,
                varies={"load_commanded": "FZ_CMD" in drivers and "FZ" not in drivers},
            )
        if self.motion is not None:
            found += self.motion.places(effect)
        others = [(driver.name, driver.unit) for driver in self.case.drivers]
        return found + channel_places(
            effect, [(output.name, output.unit) for output in self.outputs], others, drivers
        )

    def setting(self, run: Run) -> Setting:
        """Return a run's setting."""
        if run not in self._settings:
            self._settings[run] = setting(
                self.case,
                run,
                nominal_load_N=self._load,
                speed_m_s=NOMINAL_SPEED,
                work_kJ=self._work_before(run),
            )
        return self._settings[run]

    def _work_before(self, run: Run) -> float:
        if self._surface is None or "FY" not in {output.name for output in self.outputs}:
            return 0.0
        factor = unit(self.case.unit("FY")).factor
        return slip_work_before(
            self.case, run, lambda earlier, _: _whole(earlier, "FY") * factor, load_N=self._load
        )

    def _tire(
        self,
        run: Run,
        simulated: dict[str, NDArray[np.float64]],
        active: Sequence[AppliedEffect],
        setting: Setting,
    ) -> dict[str, NDArray[np.float64]]:
        surface, case = self._surface, self.case
        if surface is None:
            return simulated
        start = base_drive(case, run, load_N=self._load, outputs=False)
        turn, back = tire_signs(case.axes, "machine", run), tire_signs("machine", case.axes, run)
        units = {name: unit(case.unit(name)).factor for name in ("FY", "MZ") if name in simulated}
        zero = np.zeros(run.rows)

        def steady(SA: NDArray[np.float64], drive: Drive) -> TireForces:
            # The surface gives the difference to the row's own slip angle and load.
            got = {
                name: turn[name]
                * units[name]
                * (simulated[name] + surface.difference(name, run, SA, drive.FZ, start))
                for name in units
            }
            return TireForces(FY=got.get("FY", zero), MZ=got.get("MZ", zero))

        forces = through_tire(start, steady, active, run, setting)
        result = dict(simulated)
        for name, factor in units.items():
            result[name] = getattr(forces, name) * back[name] / factor
        if "FZ" in result:
            loads = dataclasses.replace(start, FZ=simulated["FZ"])
            loaded = late(loads, active, run, setting, lambda drive: steady(drive.SA, drive))
            result["FZ"] = result["FZ"] if loaded is None else loaded.FZ
        return result


def build(case: Case, _: Path | None, __: object) -> ColumnsModel:
    """Return the simulation of a case of this kind; ConfigError where an output has no column."""
    return ColumnsModel(case)


def _whole(run: Run, name: str) -> NDArray[np.float64]:
    """Return a simulated column; rows that the other program left out, which none judges, are bridged."""
    values = run.simulated[name]
    good = np.isfinite(values)
    if good.all():
        return values
    return np.interp(run.t, run.t[good], values[good]) if good.any() else np.zeros(run.rows)
