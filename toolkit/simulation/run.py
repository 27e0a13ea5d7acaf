"""The forward chain: tire, road, carriage, load cells, data acquisition, walked once for each file.

Nothing here reads a file or knows a file format; `write` does. Each file has a random generator of its
own, derived from the plan's seed and the file's number, so that one file repeats without the others.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.channels import Rotation
from toolkit.simulation import acquisition, carriage, cells, road, tire
from toolkit.simulation.acquisition import OwnProgram, true_program
from toolkit.simulation.cells import CELLS
from toolkit.simulation.plan import Plan

if TYPE_CHECKING:
    from numpy.typing import NDArray

_TARE_FILE = 1_000_000  # the tare's place among the seeds, beyond any file's number


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockTruth:
    """What really was in one load block: means over its rows, machine axes; steps as commanded."""

    file: str
    rotation: Rotation
    step_SA_rad: float
    step_FZ_N: float
    first_row: int
    last_row: int
    SA_rad: float
    FZ_N: float
    FY_N: float
    MZ_Nm: float
    MX_Nm: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualFile:
    """One recording: its name, its columns in the units of the machine's files, and the truth."""

    name: str
    rotation: Rotation
    columns: dict[str, NDArray[np.float64]]
    truth: tuple[BlockTruth, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualTest:
    """A whole test: the files in the order of recording, and the tare in the cells' unit."""

    plan: Plan
    files: tuple[VirtualFile, ...]
    tare: tuple[tuple[str, float], ...]
    tare_unit: str
    program: OwnProgram


def simulate(plan: Plan, program: OwnProgram | None = None) -> VirtualTest:
    """Run a plan's test on the virtual machine.

    Parameters
    ----------
    plan : with ``kind = "test"``
    program : what the acquisition program was given, before the plan's signs are turned; None for the
        true map of the cells
    """
    program = (true_program(plan.cells) if program is None else program).with_negated(
        plan.acquisition.negated
    )
    files: list[VirtualFile] = []
    for rotation in plan.rotations:
        for step in plan.slip_angles_rad:
            files.append(_file(plan, program, rotation, step, len(files) + 1))
    tare, unit = _tare(plan)
    return VirtualTest(plan=plan, files=tuple(files), tare=tare, tare_unit=unit, program=program)


def _file(plan: Plan, program: OwnProgram, rotation: Rotation, step: float, number: int) -> VirtualFile:
    rng = np.random.default_rng([plan.seed, number])
    name = plan.file_name.format(number=number)
    clock = float(rng.uniform(0.0, 60.0))  # the drum turns on between files
    parts: list[dict[str, NDArray[np.float64]]] = []
    truth: list[BlockTruth] = []
    first = 1
    for load in plan.loads_N:
        channels, block, clock = _block(plan, rotation=rotation, step=step, load=load, clock=clock, rng=rng)
        rows = len(channels["FZ"])
        parts.append(channels)
        truth.append(dataclasses.replace(block, file=name, first_row=first, last_row=first + rows - 1))
        first += rows
    channels = {symbol: np.concatenate([part[symbol] for part in parts]) for symbol in parts[0]}
    channels |= acquisition.own_columns(program, channels)
    columns = acquisition.printed(plan.machine, channels)
    return VirtualFile(name=name, rotation=rotation, columns=columns, truth=tuple(truth))


def _block(
    plan: Plan, *, rotation: Rotation, step: float, load: float, clock: float, rng: np.random.Generator
) -> tuple[dict[str, NDArray[np.float64]], BlockTruth, float]:
    machine, protocol = plan.machine, plan.machine.protocol
    per_turn = plan.acquisition.rows_per_revolution
    dt = tire.revolution_time_s(plan.tire, machine.drum.speed_m_s) / per_turn
    settle = round(protocol.settle_revolutions * per_turn)
    keep = round(protocol.average_revolutions * per_turn)
    time = clock + dt * np.arange(settle + keep, dtype=np.float64)

    # road: the load between tire and drum
    set_load = carriage.set_load(plan.carriage, step_N=load, rng=rng)
    angle = road.drum_angle(
        time=time,
        speed_m_s=machine.drum.speed_m_s,
        radius_m=machine.drum.radius_m,
        start_rad=0.0,
        reverse=rotation == "reverse",
    )
    FZ = road.load_on_drum(plan.road, load=np.full(time.shape, set_load), angle=angle)

    # carriage holds the wheel at an angle; the tire answers; carriage carries it to the hub
    SA = np.full(time.shape, carriage.wheel_angle(plan.carriage, step_rad=step))
    answer = tire.forces(plan.tire, SA=SA, FZ=FZ, rotation=rotation, camber=plan.carriage.camber_offset_rad)
    hub = carriage.hub_loads(plan.carriage, tire=answer, FZ=FZ)

    # load cells, then the acquisition
    channels = acquisition.digitise(
        plan.acquisition,
        cells=cells.sense(plan.cells, hub=hub),
        FZ=FZ,
        SA=carriage.sensed_angle(plan.carriage, SA=SA),
        noise_V_V=tuple(cell.noise_V_V for cell in plan.cells.all),
        dt=dt,
        rng=rng,
    )
    recorded = slice(settle, settle + keep)
    block = BlockTruth(
        file="",
        rotation=rotation,
        step_SA_rad=step,
        step_FZ_N=load,
        first_row=0,
        last_row=0,
        SA_rad=float(SA[recorded].mean()),
        FZ_N=float(FZ[recorded].mean()),
        FY_N=float(hub.FY[recorded].mean()),
        MZ_Nm=float(hub.MZ[recorded].mean()),
        MX_Nm=float(hub.MX[recorded].mean()),
    )
    pause = float(rng.uniform(1.0, 4.0))  # the actuator moves to the next load
    return {k: v[recorded] for k, v in channels.items()}, block, float(time[-1]) + pause


def _tare(plan: Plan) -> tuple[tuple[tuple[str, float], ...], str]:
    # Wheel mounted and lifted off the drum: the zeros and its weight, before any zero has moved.
    rng = np.random.default_rng([plan.seed, _TARE_FILE])
    rows = plan.acquisition.rows_per_revolution
    none = np.zeros(rows)
    hub = carriage.HubLoads(FY=none, MZ=none, MX=np.full(rows, plan.carriage.overturning_Nm), FZ=none)
    unmoved: dict[str, Any] = {
        name: dataclasses.replace(getattr(plan.cells, name), zero_offset_V_V=0.0) for name in CELLS
    }
    at_rest = dataclasses.replace(plan.cells, **unmoved)
    channels = acquisition.digitise(
        plan.acquisition,
        cells=cells.sense(at_rest, hub=hub),
        FZ=none,
        SA=none,
        noise_V_V=tuple(cell.noise_V_V for cell in plan.cells.all),
        dt=tire.revolution_time_s(plan.tire, plan.machine.drum.speed_m_s) / rows,
        rng=rng,
    )
    unit = plan.machine.column(CELLS[0]).unit
    means = {name: np.array([channels[name].mean()]) for name in CELLS}
    shown = acquisition.printed(plan.machine, means)
    return tuple((name, float(shown[name][0])) for name in CELLS), unit
