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

from toolkit.diagnosis.simulators.along_recordings import AlongRecordings
from toolkit.diagnosis.simulators.surface import Surface
from toolkit.diagnosis.simulators.tire import base_drive, late, through_tire, tire_signs
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.signals import Drive, Setting, TireForces
from toolkit.errors import ConfigError
from toolkit.spelling import nearest
from toolkit.units import unit

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.arrays import Array, Arrays
    from toolkit.diagnosis.case.case import Case, Run


class ColumnsModel(AlongRecordings):
    """Simulated columns; a parameter ``<output>_gain`` or ``<output>_offset`` scales or shifts one."""

    def __init__(self, case: Case) -> None:
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
        super().__init__(case)
        self._surface = Surface(case) if self.is_tire else None
        self.capability = self.capability_with(
            unsure={} if self._surface is None else self._surface.unsure,
            findings=() if self._surface is None else self._surface.too_coarse(),
            repeats=None,
        )

    def observed(self, run: Run) -> Arrays:
        """Return what was recorded of every output, where the other program has a value too."""
        return {
            output.name: np.where(np.isfinite(run.simulated[output.name]), run.columns[output.name], np.nan)
            for output in self.outputs
            if output.name in run.columns
        }

    def own_outputs(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], around: Setting
    ) -> Arrays:
        """Return the simulated columns, scaled and shifted."""
        del active, around  # the other program ran once: nothing acts before its outputs
        return {
            output.name: _whole(run, output.name) * p.get(f"{output.name}_gain", 1.0)
            + p.get(f"{output.name}_offset", 0.0)
            for output in self.outputs
        }

    def lateral(self, run: Run) -> Array:
        """Return the simulated FY of a run."""
        return _whole(run, "FY")

    def tire_inputs(self) -> tuple[bool, bool] | None:
        """Tell that slip angle and load alone can be asked for anew, where the columns are a surface."""
        return (False, False) if self._surface is not None and self._surface.good else None

    def tire_outputs(
        self, run: Run, p: Mapping[str, float], active: Sequence[AppliedEffect], around: Setting
    ) -> Arrays:
        """Return the simulated columns, moved by the surface through them."""
        simulated = self.own_outputs(run, p, active, around)
        surface, case = self._surface, self.case
        if surface is None:
            return simulated
        start = base_drive(case, run, load_N=self.load_N, outputs=False)
        turn, back = tire_signs(case.axes, "machine", run), tire_signs("machine", case.axes, run)
        units = {name: unit(case.unit(name)).factor for name in ("FY", "MZ") if name in simulated}
        zero = np.zeros(run.rows)

        def steady(SA: Array, drive: Drive) -> TireForces:
            # The surface gives the difference to the row's own slip angle and load.
            got = {
                name: turn[name]
                * units[name]
                * (simulated[name] + surface.difference(name, run, SA, drive.FZ, start))
                for name in units
            }
            return TireForces(FY=got.get("FY", zero), MZ=got.get("MZ", zero))

        forces = through_tire(start, steady, active, run, around)
        result = dict(simulated)
        for name, factor in units.items():
            result[name] = getattr(forces, name) * back[name] / factor
        if "FZ" in result:
            loads = dataclasses.replace(start, FZ=simulated["FZ"])
            loaded = late(loads, active, run, around, lambda drive: steady(drive.SA, drive))
            result["FZ"] = result["FZ"] if loaded is None else loaded.FZ
        return result


def build(case: Case, _: Path | None, __: object) -> ColumnsModel:
    """Return the simulation of a case of this kind; ConfigError where an output has no column."""
    return ColumnsModel(case)


def _whole(run: Run, name: str) -> Array:
    """Return a simulated column; rows that the other program left out, which none judges, are bridged."""
    values = run.simulated[name]
    good = np.isfinite(values)
    if good.all():
        return values
    return np.interp(run.t, run.t[good], values[good]) if good.any() else np.zeros(run.rows)
