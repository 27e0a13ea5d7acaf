"""The physical part of the chain over one recording: road, carriage, tire, and what reaches the hub.

Every stage is a function of the signals before it. The load is moved before the wheel is turned, so that the
drum's run-out adds to what the actuator holds; temperatures follow from the slip work.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.applied import acting, in_order
from toolkit.effects.filters import lag
from toolkit.effects.forward import driven, similar
from toolkit.effects.signals import Drive, Setting, TireForces, drive
from toolkit.simulation import carriage
from toolkit.simulation.places import through_machine
from toolkit.simulation.plan import Plan
from toolkit.simulation.steady import loaded_radius, steady_of
from toolkit.simulation.steps import RunSteps, machine_speed
from toolkit.simulation.timeline import Timeline
from toolkit.simulation.tire import TireForces as HubTire

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    SA: NDArray[np.float64]
    sensed: NDArray[np.float64]
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


def _warmed(
    plan: Plan, setting: Setting, line: Timeline, power_W: NDArray[np.float64], before: Before
) -> Setting:
    # T' = heat * power - (T - room) / cooling, on top of the room's own temperature.
    cooling = plan.motion.tread_cooling_s
    gain = plan.motion.tread_heating_K_J * cooling
    rise = gain * lag(line.t, power_W, cooling, start=before.warmth_K / gain)
    tread = setting.channels["T_AMBIENT"] + rise
    return dataclasses.replace(setting, channels={**setting.channels, "T_TREAD": tread})
