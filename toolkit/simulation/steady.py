"""The steady tire of a plan, whatever it is: forces in the machine's axes for what drives it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Rotation
from toolkit.effects.applied import acting
from toolkit.effects.forward import Steady, tire_forces
from toolkit.effects.signals import Drive, Setting, TireForces, drive
from toolkit.publication import write_result
from toolkit.simulation import tire as bakker
from toolkit.simulation.file_tire import file_forces
from toolkit.simulation.plan import Plan

Answer = Callable[[float, float, Rotation], tuple[float, float]]


def steady_of(plan: Plan, *, rotation: Rotation, facing: float, pressure_Pa: float) -> Steady:
    """Return the plan's tire: (slip angle [rad], drive) to forces in the machine's axes."""
    file = plan.tire_file
    if file is None:

        def published(SA: Array, drive: Drive) -> TireForces:
            forces = bakker.forces(
                plan.tire, SA=SA, FZ=drive.FZ, rotation=rotation, camber=drive.IA, facing=facing
            )
            return TireForces(FY=forces.FY, MZ=forces.MZ)

        return published

    def from_file(SA: Array, drive: Drive) -> TireForces:
        pressure = pressure_Pa + drive.pressure_error
        return file_forces(
            file, SA=SA, FZ=drive.FZ, IA=drive.IA, V=drive.V, pressure_Pa=pressure, rotation=rotation
        )

    return from_file


def settled(plan: Plan, conditions: Mapping[str, str]) -> Answer:
    """Return the tire on its road at rest in every motion, with the effects of road and tire in it.

    It is what a perfect test would find: errors of carriage, cells and acquisition are not in it, and what
    needs time has settled.
    """

    def answer(SA: float, FZ: float, rotation: Rotation) -> tuple[float, float]:
        facing = -1.0 if conditions.get("mounting") == "turned" else 1.0
        steady = steady_of(plan, rotation=rotation, facing=facing, pressure_Pa=plan.pressure_Pa)
        speed = plan.machine.drum.speed_m_s
        now = np.zeros(1)
        made = drive(now, np.array([SA]), np.array([FZ]), V=speed)
        setting = Setting(
            t=now, elapsed_s=now, nominal_load_N=plan.tire.nominal_load_N, nominal_speed_m_s=speed,
            facing=facing, conditions=conditions,
            channels={"T_TREAD": now + plan.motion.ambient_K}, first={"T_TREAD": plan.motion.ambient_K},
        )  # fmt: skip

        effects = acting(plan.effects, {**conditions, "rotation": rotation})
        rolling = [applied for applied in effects if applied.effect.stage in ("road", "tire")]
        forces = tire_forces(made, steady, rolling, setting)
        return float(forces.FY[0]), float(forces.MZ[0])

    return answer


def loaded_radius(plan: Plan, FZ: Array) -> Array:
    """Return the distance of the hub from the drum [m], (n,)."""
    truth = plan.tire
    return truth.free_radius_m - np.maximum(FZ, 0.0) / truth.vertical_stiffness_N_m


# A maker's flat-surface table: what the plan's tire does on a flat road, as TABLE.csv has it, SAE axes.


TABLE = "table_simulated.csv"  # CSV has no place for a remark: the name carries it
HEADER = "SA [deg],FZ [N],FY [N],MZ [N*m]"


def table_csv(plan: Plan) -> str:
    """Return the table: every load of the plan, at each of its slip angles in rising order."""
    answer = settled(plan, {})
    lines = [HEADER]
    for load in sorted(set(plan.loads_N)):
        for SA in sorted(set(plan.slip_angles_rad)):
            FY, MZ = answer(SA, load, "forward")  # machine axes are SAE with the drum forward
            lines.append(f"{np.degrees(SA):.6g},{load:.6g},{FY:.6g},{MZ:.6g}")
    return "\n".join(lines) + "\n"


def write_table(plan: Plan, folder: Path) -> Path:
    """Write the table into a folder; return the file."""
    path = folder / TABLE
    write_result(path, table_csv(plan))
    return path
