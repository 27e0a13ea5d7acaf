"""A whole test on the virtual machine: each recording walked from its commands to the columns of its file.

Nothing here reads a file or knows a file format; `write` does. Each file has a random generator of its
own, derived from the plan's seed and the file's number, so that the noise of one file repeats without the
others. What a tire remembers from file to file (slip work, warmth) and the clock do go on.

The physical part of the chain is road, carriage, tire, and what reaches the hub. Every stage is a function of
the signals before it. The load is moved before the wheel is turned, so that the drum's run-out adds to what
the actuator holds; temperatures follow from the slip work.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Rotation
from toolkit.effects.applied import AppliedEffect, acting, in_order
from toolkit.effects.filters import lag
from toolkit.effects.forward import driven, similar, with_source
from toolkit.effects.signals import Drive, Setting, TireForces, drive
from toolkit.errors import ConfigError
from toolkit.reduction import averaging
from toolkit.simulation import acquisition, carriage, cells, timeline, tire
from toolkit.simulation.acquisition import OwnProgram, true_program
from toolkit.simulation.cells import CELLS
from toolkit.simulation.places import through_machine
from toolkit.simulation.plan import Plan
from toolkit.simulation.steady import loaded_radius, steady_of
from toolkit.simulation.steps import RunSteps, machine_speed
from toolkit.simulation.timeline import Block, Timeline
from toolkit.simulation.tire import TireForces as HubTire

Signals = dict[str, Array]

_TARE_FILE = 1_000_000  # the tare's place among the seeds, beyond any file's number
_TARE_ROWS = 100  # of the lifted wheel's one revolution, however few a recording has
_BETWEEN = 1  # the stream of the rows that a dwell recording leaves out


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
    """One recording: its name, its columns in the units of the machine's files, and the truth.

    ``signals`` has every recorded signal in SI, unrounded: ``t`` since the test began, commands, measured
    channels, angles, temperatures; ``FY`` and ``MZ`` are what the true map of the cells makes of the tared
    cells, as a laboratory without error would.
    """

    name: str
    rotation: Rotation
    columns: dict[str, Array]
    truth: tuple[BlockTruth, ...]
    run: RunSteps
    signals: dict[str, Array] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualTest:
    """A whole test: the files in the order of recording, and the tare in the cells' unit.

    ``tare_u`` is the standard uncertainty of each mean in ``tare``; ``tare_rows`` are the tare's samples
    [V/V], (rows, 3), ``tare_dt`` apart [s].
    """

    plan: Plan
    files: tuple[VirtualFile, ...]
    tare: tuple[tuple[str, float], ...]
    tare_u: tuple[tuple[str, float], ...]
    tare_unit: str
    program: OwnProgram
    tare_rows: dict[str, Array]
    tare_dt: float


def simulate(
    plan: Plan, program: OwnProgram | None = None, others: Mapping[str, OwnProgram] | None = None
) -> VirtualTest:
    """Run a plan's test on the virtual machine.

    Parameters
    ----------
    plan : with ``kind = "test"``
    program : what the acquisition program was given, before the plan's signs are turned; None for the
        true map of the cells
    others : record id to program, for an effect that computes with another record

    Raises
    ------
    ConfigError
        a wrong calibration that ``others`` does not have
    """
    acquisition_program = (true_program(plan.cells) if program is None else program).with_negated(
        plan.acquisition.negated
    )
    programs = dict(others or {})
    for effect in plan.effects:
        if effect.effect.replaces_record and effect.source not in programs:
            raise ConfigError(
                "the record of a wrong calibration is not known", where=f"--effect {effect.effect.name}",
                got=effect.source, expected=", ".join(programs) or "a registry with that record",
                next_step="give --calibrations DIR or --home DIR", rule="effect-value",
            )  # fmt: skip
    tare_rows, tare_dt = _tare(plan)
    tare, unit = _tare_values(plan, tare_rows)
    files: list[VirtualFile] = []
    before = Before()
    for number, run in enumerate(plan.recordings, start=1):
        recording, before = _file(plan, acquisition_program, programs, run, number, before, tare_rows)
        files.append(recording)
    return VirtualTest(
        plan=plan,
        files=tuple(files),
        tare=tare,
        tare_u=_tare_u(plan, tare_rows),
        tare_unit=unit,
        program=acquisition_program,
        tare_rows=tare_rows,
        tare_dt=tare_dt,
    )


def _file(
    plan: Plan,
    program: OwnProgram,
    own_programs: Mapping[str, OwnProgram],
    run: RunSteps,
    number: int,
    before: Before,
    tare: Signals,
) -> tuple[VirtualFile, Before]:
    rng = np.random.default_rng([plan.seed, number])
    if plan.record == "dwell" and not run.sweep:
        line = timeline.dwell(plan, run, rng, np.random.default_rng([plan.seed, number, _BETWEEN]))
    else:
        line = timeline.continuous(plan, run, rng)
    walked = walk(plan, run, line, before)
    effects = acting(plan.effects, run.conditions)
    measured = _measured(plan, line, walked, effects)
    tared = {name: measured[name] - float(tare[name].mean()) for name in CELLS}
    columns = _computed(plan, program, own_programs, measured, effects, walked.setting)
    right = _computed(plan, true_program(plan.cells), own_programs, measured | tared, effects, walked.setting)
    rows = line.recorded
    commands = {"SA_CMD": line.SA_CMD, "FZ_CMD": line.FZ_CMD}
    signals = {"t": walked.setting.elapsed_s, **walked.setting.channels, **commands, **measured, **right}
    name = plan.file_name.format(number=number)
    return VirtualFile(
        name=name,
        rotation=run.rotation,
        columns=acquisition.printed(plan.machine, {k: v[rows] for k, v in (measured | columns).items()}),
        truth=_truth(name, run, line, walked),
        run=run,
        signals={symbol: values[rows] for symbol, values in signals.items()},
    ), walked.after


def _measured(plan: Plan, line: Timeline, walked: Walked, effects: Sequence[AppliedEffect]) -> Signals:
    """Return the recorded cells [V/V], FZ [N] and SA [rad]: load cells, then the acquisition."""
    hub, machine = walked.hub, plan.machine
    loads = {"FY": hub.FY, "MZ": hub.MZ, "MX": hub.MX, "FZ": hub.FZ}
    at_cells = in_order(effects, "load_cells")
    sensed = through_machine(
        loads, [at_cell for at_cell in at_cells if at_cell.channel in loads], walked.setting, machine
    )
    bridge = cells.sense(
        plan.cells,
        hub=carriage.HubLoads(FY=sensed["FY"], MZ=sensed["MZ"], MX=sensed["MX"], FZ=hub.FZ),
    )
    readings = {name: bridge[:, i] for i, name in enumerate(CELLS)}
    readings = through_machine(
        {**sensed, **readings},
        [at_cell for at_cell in at_cells if at_cell.channel in CELLS],
        walked.setting,
        machine,
    )
    channels = acquisition.digitise(
        plan.acquisition,
        cells=np.column_stack([readings[name] for name in CELLS]),
        FZ=sensed["FZ"],
        SA=walked.sensed,
        noise=line.noise,
        dt=line.dt,
    )
    return through_machine(channels, _acquired(effects), walked.setting, machine)


def _computed(
    plan: Plan,
    program: OwnProgram,
    own_programs: Mapping[str, OwnProgram],
    channels: Signals,
    effects: Sequence[AppliedEffect],
    setting: Setting,
) -> Signals:
    """Return FY [N] and MZ [N·m] as a program makes them of recorded cells, with effects on them."""
    signals = acquisition.own_columns(program, channels)
    for applied in _acquired(effects):
        if applied.effect.replaces_record and applied.effect.channel is not None:
            columns = acquisition.own_columns(own_programs[str(applied.source)], channels)
            for name in signals:
                replaced = with_source(setting, columns[name])
                signals[name] = applied.effect.channel(signals[name], applied.values, replaced)
        else:
            signals = through_machine(signals, [applied], setting, plan.machine)
    return signals


def _acquired(effects: Sequence[AppliedEffect]) -> Sequence[AppliedEffect]:
    return in_order(effects, "acquisition")


def _truth(name: str, run: RunSteps, line: Timeline, walked: Walked) -> tuple[BlockTruth, ...]:
    place = np.cumsum(line.recorded)

    def block(part: Block) -> BlockTruth:
        rows = slice(part.start, part.stop)
        return BlockTruth(
            file=name,
            rotation=run.rotation,
            step_SA_rad=part.step_SA_rad,
            step_FZ_N=part.step_FZ_N,
            first_row=int(place[part.start]),
            last_row=int(place[part.stop - 1]),
            SA_rad=float(walked.SA[rows].mean()),
            FZ_N=float(walked.hub.FZ[rows].mean()),
            FY_N=float(walked.hub.FY[rows].mean()),
            MZ_Nm=float(walked.hub.MZ[rows].mean()),
            MX_Nm=float(walked.hub.MX[rows].mean()),
        )

    return tuple(block(part) for part in line.blocks)


def _tare(plan: Plan) -> tuple[Signals, float]:
    """Return the samples of the lifted wheel: the zeros and its weight, before any zero has moved."""
    rng = np.random.default_rng([plan.seed, _TARE_FILE])
    rows = max(plan.acquisition.rows_per_revolution, _TARE_ROWS)
    none = np.zeros(rows)
    dt = tire.revolution_time_s(plan.tire, plan.machine.drum.speed_m_s) / rows
    hub = carriage.HubLoads(FY=none, MZ=none, MX=np.full(rows, plan.carriage.overturning_Nm), FZ=none)
    unmoved: dict[str, Any] = {
        name: dataclasses.replace(getattr(plan.cells, name), zero_offset_V_V=0.0) for name in CELLS
    }
    at_rest = dataclasses.replace(plan, cells=dataclasses.replace(plan.cells, **unmoved))
    ambient = none + plan.motion.ambient_K
    setting = Setting(
        t=dt * np.arange(rows, dtype=np.float64),
        elapsed_s=none,
        channels={"T_AMBIENT": ambient, "T_TREAD": ambient},
        first={"T_AMBIENT": plan.motion.ambient_K, "T_TREAD": plan.motion.ambient_K},
        nominal_load_N=plan.tire.nominal_load_N,
    )
    line = Timeline(
        t=setting.t, clock=setting.t, dt=dt, SA_CMD=none, FZ_CMD=none, FZ_SET=none,
        noise=acquisition.draw_noise(plan.acquisition, plan.cells, rows, rng),
        recorded=np.ones(rows, dtype=bool), blocks=(),
    )  # fmt: skip
    still = Walked(hub=hub, SA=none, sensed=none, setting=setting, after=Before())
    effects = [applied for applied in acting(plan.effects, {}) if _is_in_tare(applied)]
    return _measured(at_rest, line, still, effects), dt


def _is_in_tare(applied: AppliedEffect) -> bool:
    return applied.effect.on_channel is None or applied.effect.on_channel.tare != "after"


def _tare_values(plan: Plan, rows: Signals) -> tuple[tuple[tuple[str, float], ...], str]:
    unit = plan.machine.column(CELLS[0]).unit
    means = {name: np.array([rows[name].mean()]) for name in CELLS}
    printed = acquisition.printed(plan.machine, means)
    return tuple((name, float(printed[name][0])) for name in CELLS), unit


def _tare_u(plan: Plan, rows: Signals) -> tuple[tuple[str, float], ...]:
    printed = acquisition.printed(plan.machine, {name: rows[name] for name in CELLS})
    sure = averaging.means(np.stack([printed[name] for name in CELLS]))
    return tuple((name, mean.u) for name, mean in zip(CELLS, sure, strict=True))


_HEAT_TURNS = 4  # of the fixed point between heat and the forces that it changes


@dataclass(frozen=True, slots=True, kw_only=True)
class Before:
    """What a recording inherits: time since the first one began [s], slip work [kJ], tread above room [K]."""

    elapsed_s: float = 0.0
    work_kJ: float = 0.0
    warmth_K: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Walked:
    """What reaches the hub, and all that went with it; each array (n,), SI.

    ``SA`` is the wheel's true slip angle, ``sensed`` what the sensor stands at.
    """

    hub: carriage.HubLoads
    SA: Array
    sensed: Array
    setting: Setting
    after: Before


def walk(plan: Plan, run: RunSteps, line: Timeline, before: Before) -> Walked:
    """Walk from the commands to the loads at the hub."""
    speed = machine_speed(run, plan.machine)
    setting = _setting(plan, run, line, before, speed)
    effects = acting(plan.effects, run.conditions)
    pressure = plan.pressure_Pa if run.pressure_Pa is None else run.pressure_Pa
    steady = steady_of(plan, rotation=run.rotation, facing=setting.facing, pressure_Pa=pressure)

    def tire(drive: Drive) -> TireForces:
        return similar(steady, drive)

    rolling = [effect for effect in effects if effect.effect.stage in ("road", "tire")]
    carried = in_order(effects, "carriage")
    commanded = [applied for applied in carried if applied.effect.follows_command == "FZ"]
    turned = [applied for applied in carried if applied.effect.follows_command != "FZ"]
    wheel = carriage.wheel_angle(plan.carriage, step_rad=line.SA_CMD)
    start = drive(line.t, wheel, line.FZ_SET, IA=plan.carriage.camber_offset_rad, V=speed)
    start = driven(start, in_order(rolling, "road"), setting, tire)
    start = driven(start, commanded, setting, tire)
    angle = setting.channels["DRUM_ANGLE"]
    FZ = carriage.load_on_drum(plan.road, load=start.FZ, angle=angle)
    FZ = through_machine({"FZ": FZ}, rolling, setting, plan.machine)["FZ"]
    start = driven(dataclasses.replace(start, FZ=FZ), turned, setting, tire)

    on_tire = in_order(rolling, "tire")
    heats = any(applied.effect.by_temperature for applied in on_tire)
    for _ in range(_HEAT_TURNS if heats else 1):
        driven_tire = driven(start, on_tire, setting, tire)
        forces = tire(driven_tire)
        power = np.abs(forces.FY * driven_tire.V * np.sin(driven_tire.SA))
        setting = _warmed(plan, setting, line, power, before)
    on_top = through_machine({"FY": forces.FY, "MZ": forces.MZ}, rolling, setting, plan.machine)
    answer = HubTire(FY=on_top["FY"], MZ=on_top["MZ"], loaded_radius=loaded_radius(plan, driven_tire.FZ))
    if any(applied.effect.by_slip_work for applied in on_tire):
        # The effect counts the work of the tire as new: what wear itself adds to it is of second order.
        new = driven(
            start, [applied for applied in on_tire if not applied.effect.by_slip_work], setting, tire
        )
        power = np.abs(tire(new).FY * new.V * np.sin(new.SA))
    steps = 0.5 * (power[1:] + power[:-1]) * np.diff(line.t)
    gap = plan.motion.between_files_s
    warmth = float(setting.channels["T_TREAD"][-1] - setting.channels["T_AMBIENT"][-1])
    return Walked(
        hub=carriage.hub_loads(plan.carriage, tire=answer, FZ=driven_tire.FZ),
        SA=start.SA,
        sensed=carriage.sensed_angle(plan.carriage, SA=wheel),
        setting=setting,
        after=Before(
            elapsed_s=before.elapsed_s + float(line.t[-1]) + gap,
            work_kJ=before.work_kJ + 1e-3 * float(steps.sum()),
            warmth_K=warmth * math.exp(-gap / plan.motion.tread_cooling_s),
        ),
    )


def _setting(plan: Plan, run: RunSteps, line: Timeline, before: Before, speed: float) -> Setting:
    reverse = run.rotation == "reverse"
    elapsed = before.elapsed_s + line.t
    ambient = plan.motion.ambient_K + plan.motion.ambient_drift_K_s * elapsed
    pressure = plan.pressure_Pa if run.pressure_Pa is None else run.pressure_Pa
    turns = {
        name: carriage.drum_angle(
            time=line.clock, speed_m_s=speed, radius_m=radius, start_rad=0.0, reverse=reverse
        )
        for name, radius in (
            ("DRUM_ANGLE", plan.machine.drum.radius_m),
            ("TIRE_ANGLE", plan.tire.free_radius_m * plan.tire.rolling_ratio),
        )
    }
    return Setting(
        t=line.t,
        elapsed_s=elapsed,
        channels={
            **turns,
            "V": np.full_like(line.t, speed),
            "P_INFL": np.full_like(line.t, pressure),
            "T_AMBIENT": ambient,
            "T_TREAD": ambient + before.warmth_K,
        },
        conditions=run.conditions,
        first={"T_AMBIENT": plan.motion.ambient_K, "T_TREAD": plan.motion.ambient_K},
        slip_work_before_kJ=before.work_kJ,
        nominal_load_N=plan.tire.nominal_load_N,
        nominal_speed_m_s=plan.machine.drum.speed_m_s,
        travel=-1.0 if reverse else 1.0,
        facing=-1.0 if run.mounting == "turned" else 1.0,
    )


def _warmed(plan: Plan, setting: Setting, line: Timeline, power_W: Array, before: Before) -> Setting:
    # T' = heat * power - (T - room) / cooling, on top of the room's own temperature.
    cooling = plan.motion.tread_cooling_s
    gain = plan.motion.tread_heating_K_J * cooling
    rise = gain * lag(line.t, power_W, cooling, start=before.warmth_K / gain)
    tread = setting.channels["T_AMBIENT"] + rise
    return dataclasses.replace(setting, channels={**setting.channels, "T_TREAD": tread})
