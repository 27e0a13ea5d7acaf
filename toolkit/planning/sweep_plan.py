"""The sweeps of a planned test, as people and files have them, within the limits of the test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from toolkit.channels import Rotation
from toolkit.declared import Entry
from toolkit.errors import ConfigError
from toolkit.planning.sweep_search import PRIOR_M, ROTATION, SweepChoice, energy_J
from toolkit.simulation.steps import Motion

if TYPE_CHECKING:
    from toolkit.machine import Sweeping
    from toolkit.planning.expectation import EarlierTest
    from toolkit.planning.tread import Tread

TO_LOAD_S = 2.5  # the actuator's way from one load to the next
_TREAD = Motion()
_REST_S = 0.02  # of a turn; the virtual machine rests at every angle that it is told


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedSweep:
    """A recording in time: the slip angle goes up and down at a steady rate, at each load in turn."""

    rotation: Annotated[Rotation, Entry("direction of the drum")]
    speed_m_s: Annotated[float, Entry("of the road")]
    steer_rate_deg_s: Annotated[float, Entry("of every move")]
    amplitude_deg: Annotated[float, Entry("to either side of zero")]
    cycles: Annotated[int, Entry("at each load: to one side, to the other, and back")]
    loads_N: Annotated[tuple[float, ...], Entry("one after another")]
    seconds: Annotated[float, Entry("of the recording")]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedSweeps:
    """The recordings in time beside the settled steps, with what they cost."""

    recordings: Annotated[tuple[PlannedSweep, ...], Entry("one a speed")]
    minutes: Annotated[float, Entry("time on the machine, pauses among it")]
    sliding_kJ: Annotated[float, Entry("energy that slides away in them")]
    rise_K: Annotated[float, Entry("of a cold tread over the room, at most")]

    def runs(self) -> list[dict[str, Any]]:
        """Return them as the runs of a plan of the virtual machine."""
        runs = []
        for sweep in self.recordings:
            corners = [sweep.amplitude_deg, -sweep.amplitude_deg] * sweep.cycles
            runs.append({
                "rotation": sweep.rotation, "sweep": True, "outer": "load",
                "slip_angles": {"value": [*corners, 0.0], "unit": "deg"},
                "loads": {"value": list(sweep.loads_N), "unit": "N"},
                "speed": {"value": round(3.6 * sweep.speed_m_s, 6), "unit": "km/h"},
                "steer_rate": {"value": sweep.steer_rate_deg_s, "unit": "deg/s"},
                "dwell": {"value": _REST_S, "unit": "s"},
            })  # fmt: skip
        return runs


def planned_sweeps(choice: SweepChoice, tires: Sequence[EarlierTest], tread: Tread) -> PlannedSweeps:
    """Return the sweeps of a choice in the units of people."""
    design, steering = choice.design, choice.design.steering
    energy = energy_J(design, tires)
    rolled = len(design.loads_N) * steering.cycle_m * sum(design.cycles)
    lasts = [
        len(design.loads_N) * (TO_LOAD_S + design.load_s(place)) for place in range(len(design.speeds_m_s))
    ]
    powers = [energy / rolled * speed for speed in design.speeds_m_s]
    return PlannedSweeps(
        recordings=tuple(
            PlannedSweep(
                rotation=ROTATION, speed_m_s=speed,
                steer_rate_deg_s=round(math.degrees(steering.rate_rad_m * speed), 4),
                amplitude_deg=round(math.degrees(steering.amplitude_rad), 4), cycles=cycles,
                loads_N=tuple(float(load) for load in design.loads_N), seconds=seconds,
            )
            for speed, cycles, seconds in zip(design.speeds_m_s, design.cycles, lasts, strict=True)
        ),
        minutes=(sum(lasts) + len(lasts) * tread.pace.between_files_s) / 60,
        sliding_kJ=energy / 1e3,
        rise_K=max(
            power * _TREAD.tread_heating_K_J * _TREAD.tread_cooling_s
            * -math.expm1(-seconds / _TREAD.tread_cooling_s)
            for power, seconds in zip(powers, lasts, strict=True)
        ),
    )  # fmt: skip


def refuse_beyond(sweeps: PlannedSweeps, tread: Tread, minutes: float) -> None:
    """Refuse sweeps that alone go beyond a limit of the test.

    Raises
    ------
    ConfigError
        ``plan-infeasible``, with the least that they take
    """
    limits = (
        ("--minutes", minutes, sweeps.minutes, "min"),
        ("--sliding", tread.energy_J / 1e3, sweeps.sliding_kJ, "kJ"),
        ("--rise", tread.rise_K, sweeps.rise_K, "K"),
    )
    for name, limit, least, unit in limits:
        if least >= limit:
            raise ConfigError(
                "the sweeps of a relaxation length alone go beyond a limit", where=name,
                got=f"{limit:g} {unit}",
                expected=f"more than {math.ceil(10 * least) / 10:g} {unit}, for the settled steps too",
                next_step="allow as much, or demand a larger uncertainty", rule="plan-infeasible",
            )  # fmt: skip


def sweep_assumptions(
    sweeps: PlannedSweeps, sweeping: Sweeping, tires: Sequence[EarlierTest]
) -> tuple[str, ...]:
    """Return what a plan of sweeps rests on, for people."""
    known = all(set(sweeps.recordings[0].loads_N) <= set(earlier.lengths_m) for earlier in tires)
    prior = " to ".join(f"{1e3 * length:.0f}" for length in PRIOR_M)
    delay = sweeping.delay
    return (
        "the relaxation length is that of the earlier test"
        if known
        else f"the relaxation length is {prior} mm: the demand is met at both ends, and each line is of the "
        "end that is nearer to its limit",
        "the rows of a sweep have the noise of the settled blocks, at every speed",
        "nobody states a delay between the channels of FY and slip angle: two speeds part it from the length"
        if delay is None
        else f"FY is {1e3 * delay.value_s:g} ms behind the slip angle, with a standard uncertainty of "
        f"{1e3 * delay.u_s:g} ms",
        "the machine's protocol measures settled steps at one speed, and gives no relaxation length",
    )


def sweep_lines(sweeps: PlannedSweeps) -> tuple[str, ...]:
    """Return the sweeps for people, a line each."""
    return tuple(
        f"{sweep.cycles} cycles of ±{sweep.amplitude_deg:g} deg at {sweep.steer_rate_deg_s:.3g} deg/s, "
        f"{3.6 * sweep.speed_m_s:.3g} km/h, {sweep.seconds:.0f} s"
        for sweep in sweeps.recordings
    )
