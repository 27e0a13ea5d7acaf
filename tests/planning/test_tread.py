"""Energy and warmth of the tread: by hand for one slip angle, and by a step through time for the pauses."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.characteristics.tire_factory import M15
from tests.planning.planning_factory import LOADS, earlier
from toolkit.planning.design import Design, Pace
from toolkit.planning.tread import Tread
from toolkit.simulation.steps import Motion

PACE = Pace(condition_s=6.0, between_files_s=30.0)
ANGLES = tuple(np.radians([-8.0, -2.0, 0.0, 4.0]).tolist())
DESIGN = Design(slip_angles_rad=ANGLES, loads_N=LOADS, rotations=("forward", "reverse"))
TREAD = Tread(tires=(earlier(),), pace=PACE, speed_m_s=10.0)
MOTION = Motion()


def test_energy_is_force_times_sliding_speed_times_time() -> None:
    angle = math.radians(4.0)
    by_hand = sum(
        abs(float(earlier().force(angle, load, rotation))) * 10.0 * math.sin(angle) * 6.0
        for load in LOADS
        for rotation in ("forward", "reverse")
    )  # fmt: skip
    energies = TREAD.energies_J(DESIGN)
    assert energies[3] == pytest.approx(by_hand)
    assert energies[2] == 0.0


def stepped(rise: float, power: float, seconds: float) -> float:
    """The heat balance in small steps: dT/dt = k P - T / tau."""
    step = 1e-3
    for _ in range(round(seconds / step)):
        rise += step * (MOTION.tread_heating_K_J * power - rise / MOTION.tread_cooling_s)
    return rise


def test_a_recording_warms_a_cold_tread_as_the_heat_balance_has_it() -> None:
    rise = 0.0
    for load in LOADS:
        power = max(
            abs(float(earlier().force(ANGLES[0], load, rotation))) for rotation in ("forward", "reverse")
        ) * 10.0 * abs(math.sin(ANGLES[0]))  # fmt: skip
        rise = stepped(rise, power, PACE.condition_s)
    assert TREAD.rises_K(DESIGN)[0, -1] == pytest.approx(rise, rel=1e-3)


def test_after_its_pause_a_recording_ends_within_the_limit_and_no_sooner() -> None:
    limit = 1.1 * float(TREAD.rises_K(DESIGN).max())
    warm = dataclasses.replace(TREAD, rise_K=limit)
    pauses = warm.pauses_s(DESIGN)
    assert pauses[2] == PACE.between_files_s  # nothing slides at 0 deg
    rise = stepped(limit, 0.0, float(pauses[0]))
    highest = rise
    for column in TREAD.powers_W(DESIGN).max(axis=1)[0]:
        rise = stepped(rise, float(column), PACE.condition_s)
        highest = max(highest, rise)
    assert highest == pytest.approx(limit, rel=1e-3)


def test_what_a_cold_tread_cannot_bear_has_no_pause() -> None:
    rises = TREAD.rises_K(DESIGN).max(axis=1)
    warm = dataclasses.replace(TREAD, rise_K=0.9 * float(rises[0]))
    assert math.isinf(warm.pauses_s(DESIGN)[0])
    assert math.isinf(warm.minutes(DESIGN))


def test_without_limits_the_time_is_that_of_the_pace_at_the_speed_of_the_protocol() -> None:
    assert TREAD.minutes(DESIGN) == pytest.approx(PACE.minutes(DESIGN))
    made = Tread.of(M15, (earlier(),), between_files_s=7.0)
    assert made.speed_m_s == (M15.protocol.speed_m_s or M15.drum.speed_m_s)
    assert made.pace.between_files_s == 7.0
