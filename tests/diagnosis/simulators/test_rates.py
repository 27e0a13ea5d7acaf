"""The rate of a recorded position against closed forms, and force laws that have their place by it."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import TWO, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.rates import Track, reach_of, usual_speed
from toolkit.effects.catalogue import effect

T = np.arange(400) * 0.05
X, V = 10 * np.sin(0.8 * T), 8 * np.cos(0.8 * T)  # mm, mm/s
BY_SPEED = ("coulomb_friction", "viscous_damping", "quadratic_drag")
SLIDE = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["area"] * inputs["p"]})
"""
CASE = """schema = 1
[simulation]
kind = "python"
path = "sim.py"
[simulation.parameters.area]
value = 50.0
unit = "N/bar"
sd = 1.0
[recording]
TIME[recording.channels]
CLOCKx = { unit = "mm", role = "input" }
p = { unit = "bar", role = "input" }
F = { unit = "N", role = "output" }
"""
TIMED = CASE.replace("TIME", 'time = "t"\n').replace("CLOCK", 't = { unit = "s", role = "time" }\n')


def slide(seed, *, friction=0.0, noise=0.0, step=0.0):
    """Return a cylinder that goes to and fro under a pressure, its position noisy or in steps."""
    rng = np.random.default_rng(seed)
    x = 10 * np.sin(0.8 * T + seed) + 4 * np.sin(0.31 * T)
    v = 8 * np.cos(0.8 * T + seed) + 1.24 * np.cos(0.31 * T)
    p = 4 + 0.5 * np.sin(0.23 * T + seed)
    F = 50 * p + friction * np.sign(v) + rng.normal(0, 0.5, len(T))
    x = x + rng.normal(0, noise, len(T)) if noise else x
    x = step * np.round(x / step) if step else x
    return pd.DataFrame({"t": T, "x": x, "p": p, "F": F})


def case(folder, text=TIMED, **how):
    frames = {f"r{k}__csv": slide(10 * how.get("draw", 0) + k, **{n: how[n] for n in how if n != "draw"})
              for k in range(2)}  # fmt: skip
    return read_case(write_case(folder, text + TWO, simulator=SLIDE, **frames))


def of(track):
    reach = reach_of(track, usual_speed([track]))
    assert reach is not None
    return reach, track.rate(reach)


def test_the_rate_of_a_clean_position_is_its_slope_over_the_next_rows():
    reach, rate = of(Track.of(T, X))
    assert reach == 1
    assert rate == pytest.approx(V, abs=0.02)


@pytest.mark.parametrize(("noise", "step"), [(0.05, 0.0), (0.2, 0.0), (0.0, 0.25), (0.0, 0.5)])
def test_a_noisy_or_coarse_position_is_smoothed_as_far_as_it_asks_for(noise, step):
    x = X + np.random.default_rng(0).normal(0, noise, len(T)) if noise else step * np.round(X / step)
    reach, rate = of(Track.of(T, x))
    assert reach > 1
    assert np.sqrt(np.mean((rate - V) ** 2)) < 0.1 * np.sqrt(np.mean(V**2))


def test_a_position_that_only_jitters_or_goes_in_a_few_steps_has_no_rate():
    for x in (np.random.default_rng(1).normal(0, 0.1, len(T)), 4 * np.round(X / 4)):
        track = Track.of(T, x)
        assert reach_of(track, usual_speed([track])) is None


def test_a_gap_and_a_turn_are_no_motion():
    t = np.where(np.arange(400) < 200, T, T + 30.0)
    angle = np.mod(40 * T, 360.0)
    rate = Track.of(t, angle, turn=360.0).rate(1)
    assert rate == pytest.approx(40.0, abs=1e-6)


def test_forces_of_a_velocity_have_a_place_where_the_position_is_recorded_in_time(tmp_path):
    timed = model_of(case(tmp_path / "timed"), None)
    assert all(timed.places(effect(name)) == [("F", None)] for name in BY_SPEED)
    moving = timed.capability.motion
    assert moving.units("F") == ("N", "mm/s", "mm")
    assert moving.sizes("F", lambda _: 1.0).fastest == pytest.approx(9.2, rel=0.1)
    untimed = CASE.replace("TIME", "").replace("CLOCK", 't = { unit = "1", role = "covariate" }\n')
    still = model_of(case(tmp_path / "untimed", untimed), None)
    assert not any(still.places(effect(name)) for name in BY_SPEED)


OTHER = pytest.mark.campaign("a position without noise, and one in steps: a noisy one holds in every run")


@pytest.mark.campaign("a whole diagnosis: that friction has its place beside a position is held in every run")
@pytest.mark.parametrize(
    "how", [{"noise": 0.1}, *(pytest.param(how, marks=OTHER) for how in ({}, {"step": 0.5}))]
)
def test_friction_is_named_beside_a_position_alone(tmp_path, how):
    made = diagnose(case(tmp_path, friction=4.0, **how), None).diagnosis
    (one,) = made.effects
    assert (made.verdict, one.name) == ("named", "coulomb_friction")
    low, high = one.parameters[0].ci95
    assert low < 4.0 < high


@pytest.mark.parametrize(
    ("speed", "load", "moves"),
    [("m/s", "N", True), ("rad/s", "N*m", True), ("deg/s", "lbf*ft", True), ("1/min", "N*m", True),
     ("rpm", "N*m", True), ("Hz", "N", False), ("V", "N", False)],
)  # fmt: skip
def test_a_rate_that_turns_is_a_velocity_as_one_along_a_line(tmp_path, speed, load, moves):
    text = TIMED.replace('"mm"', f'"{speed}"').replace('unit = "N"', f'unit = "{load}"')
    posed = case(tmp_path, text.replace('"N/bar"', f'"{load}/bar"'))
    for name in BY_SPEED:
        assert model_of(posed, None).places(effect(name)) == ([("F", None)] if moves else [])
