"""Runs of a plan: which slip angles and loads, which way, how fast; the plan's ``[motion]`` and ``[[run]]``.

A run is one recording. Without ``[[run]]`` there is one for each direction and slip angle, through all
loads, as the machine's protocol has it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Literal

from toolkit.channels import Rotation
from toolkit.declared import Above, AtLeast, AtMost, Entry, Fault, Keyed, Size, Text, Unit
from toolkit.machine.definition import Machine

Mounting = Literal["normal", "turned"]
Outer = Literal["slip_angle", "load"]
_Dwell = Annotated[float | None, Unit("s"), Above(0), Entry("at each condition", key="dwell")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """How the machine moves and what it stands in.

    ``steer_rate_rad_s`` of the rack, ``load_rate_N_s`` of the load actuator, ``dwell_s`` at each condition
    (None: the protocol's revolutions), ``between_files_s`` until the next recording begins; ``ambient_K`` and
    its drift are the room's. Slip work heats the tread by ``tread_heating_K_J`` (some 2 kJ/K of rubber) and
    it cools to the room with ``tread_cooling_s``, a minute for a rolling passenger tire.
    """

    steer_rate_rad_s: Annotated[float, Unit("deg/s"), Above(0), Entry("of the rack", key="steer_rate")] = (
        0.0698131700797732  # 4 deg/s
    )
    load_rate_N_s: Annotated[float, Unit("N/s"), Above(0), Entry("of the actuator", key="load_rate")] = 5000.0
    dwell_s: _Dwell = None
    between_files_s: Annotated[
        float, Unit("s"), Above(0), Entry("until the next recording begins", key="between_files")
    ] = 30.0
    ambient_K: Annotated[float, Unit("degC"), Entry("of the room", key="ambient")] = 294.15
    ambient_drift_K_s: Annotated[float, Unit("K/s"), Entry("of the room", key="ambient_drift")] = 0.0
    tread_heating_K_J: Annotated[float, Unit("K/J"), Above(0), Entry("by slip work", key="tread_heating")] = (
        0.5e-3
    )
    tread_cooling_s: Annotated[float, Unit("s"), Above(0), Entry("time constant", key="tread_cooling")] = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSteps:
    """One recording: every slip angle [rad] at every load [N], in the order of ``outer``, and how.

    ``conditions`` are what a case says of it, rotation and mounting among them. In a plan's file slip angles
    and loads that are empty are the plan's, and ``times`` says how often the recording is made.
    """

    rotation: Annotated[Rotation, Entry("direction of the drum")] = "forward"
    slip_angles_rad: Annotated[
        tuple[float, ...], Unit("deg"), Size(1), Entry("default: the plan's", key="slip_angles")
    ] = ()
    loads_N: Annotated[tuple[float, ...], Unit("N"), Size(1), Entry("default: the plan's", key="loads")] = ()
    outer: Annotated[Outer, Entry("what is stepped in the outer loop")] = "slip_angle"
    mounting: Annotated[Mounting, Entry("of the tire on the hub")] = "normal"
    speed_m_s: Annotated[float | None, Unit("km/h"), Above(0), Entry("default: the drum's", key="speed")] = (
        None
    )
    pressure_Pa: Annotated[
        float | None, Unit("kPa"), Above(0), Entry("default: the plan's", key="pressure")
    ] = None
    steer_rate_rad_s: Annotated[
        float | None, Unit("deg/s"), Above(0), Entry("default: the plan's", key="steer_rate")
    ] = None
    load_rate_N_s: Annotated[
        float | None, Unit("N/s"), Above(0), Entry("default: the plan's", key="load_rate")
    ] = None
    dwell_s: _Dwell = None
    sweep: Annotated[
        bool, Entry("steered in time and recorded with every row, whatever the plan's other recordings hold")
    ] = False
    times: Annotated[int, AtLeast(1), AtMost(1000), Entry("recordings of this kind, one after another")] = 1
    extra: Annotated[
        tuple[tuple[str, str], ...], Keyed(), Text(empty=True, numbers="int"),
        Entry("to which an effect can be confined", key="conditions", example={"surface": "steel"}),
    ] = ()  # fmt: skip

    def faults(self) -> Iterator[Fault]:
        """Yield conditions that have a key of their own."""
        for key, text in self.extra:
            if key in ("rotation", "mounting", "file", "phase"):
                yield Fault(key=("conditions", key), got=text, expected=f"{key} of the run itself")

    @property
    def conditions(self) -> dict[str, str]:
        """Conditions of the run by name."""
        return {"rotation": self.rotation, "mounting": self.mounting, **dict(self.extra)}

    @property
    def steps(self) -> tuple[tuple[float, float], ...]:
        """Slip angle [rad] and load [N] of each condition, in their order."""
        if self.outer == "slip_angle":
            return tuple(itertools.product(self.slip_angles_rad, self.loads_N))
        return tuple((angle, load) for load, angle in itertools.product(self.loads_N, self.slip_angles_rad))


def protocol_runs(
    rotations: tuple[Rotation, ...], slip_angles_rad: tuple[float, ...], loads_N: tuple[float, ...]
) -> tuple[RunSteps, ...]:
    """Return one run for each direction and slip angle."""
    return tuple(
        RunSteps(rotation=rotation, slip_angles_rad=(angle,), loads_N=loads_N)
        for rotation in rotations
        for angle in slip_angles_rad
    )


def stated_runs(
    runs: tuple[RunSteps, ...], *, slip_angles_rad: tuple[float, ...], loads_N: tuple[float, ...]
) -> tuple[RunSteps, ...]:
    """Return the recordings of ``[[run]]``: each as often as it says, with the plan's angles and loads."""
    return tuple(
        replace(
            run,
            slip_angles_rad=run.slip_angles_rad or slip_angles_rad,
            loads_N=run.loads_N or loads_N,
            times=1,
        )
        for run in runs
        for _ in range(run.times)
    )


def machine_speed(run: RunSteps, machine: Machine) -> float:
    """Return the surface speed of a run [m/s]."""
    return machine.drum.speed_m_s if run.speed_m_s is None else run.speed_m_s
