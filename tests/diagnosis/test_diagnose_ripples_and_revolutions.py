"""Forces that repeat with a position or a shaft's angle: any phase, any period, linear responses."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from tests.diagnosis.tire_case import SIGNS, SIMULATOR, sweep, toml
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

POSITION = HEAD.replace('v = { unit = "m/s"', 'x = { unit = "m", role = "input" }\nv = { unit = "m/s"')
PENDULUM = """
def rhs(t, x, u, p):
    return [x[1], -p["k"] * x[0] - p["c"] * x[1] + u["M"]]
def outputs(x, u, p):
    return {"TH": x[0]}
def initial(p):
    return [0.3, 0.0]
"""
SWINGS = """schema = 1
[simulation]
kind = "ode"
path = "sim.py"
states = ["th", "om"]
[simulation.parameters.k]
value = 25.0
unit = "1/s^2"
[simulation.parameters.c]
value = 0.6
unit = "1/s"
[recording.channels]
t = { unit = "s", role = "time" }
M = { unit = "rad/s^2", role = "input" }
TH = { unit = "rad", role = "output" }
[[recording.run]]
file = "r0.csv"
"""


def moved(seed, amplitude, period, phase):
    """The carriage with the way it went, and a ripple over it."""
    made = carriage(seed=seed, rows=400, coulomb=0.0)
    t = made["t"].to_numpy()
    # The integral of its velocity, 0.2 sin(1.3 t + seed) + 0.1 sin(3.1 t).
    x = -0.2 / 1.3 * np.cos(1.3 * t + seed) - 0.1 / 3.1 * np.cos(3.1 * t)
    ripple = amplitude * np.sin(2 * np.pi * x / period + np.radians(phase))
    return made.assign(x=x, F=made["F"] + ripple)


OTHER = pytest.mark.campaign("a longer period at another phase: the shorter one is harder to find")


@pytest.mark.parametrize(("period", "phase"), [(0.0237, 200.0), pytest.param(0.061, -70.0, marks=OTHER)])
def test_a_ripple_of_any_period_and_phase_is_named_with_both(tmp_path, period, phase):
    frames = {f"r{i}__csv": moved(i, 6.0, period, phase) for i in range(2)}
    (one,) = diagnose(read_case(write_case(tmp_path, POSITION + TWO, **frames)), None).diagnosis.effects
    assert one.name == "periodic_ripple"
    found = {each.name: each for each in one.parameters}
    for name, truth in (("amplitude", 6.0), ("period", period)):
        low, high = found[name].ci95
        assert low - (high - low) / 2 < truth < high + (high - low) / 2, name  # four standard errors
        assert high - low < 0.2 * truth


FURTHER = pytest.mark.campaign("further phases: one of the second quadrant holds in every run")


@pytest.mark.parametrize(
    "phase",
    [151.0, *(pytest.param(phase, marks=FURTHER) for phase in (0.0, 45.0, 260.0))],
)
def test_a_force_locked_to_the_drum_is_named_at_any_phase(tmp_path, phase):
    frames = {}
    for i in range(2):
        made = sweep("SAE", seed=i)
        angle = (140.0 * made["t"] + 30 * i) % 360
        force = 60.0 * np.cos(np.radians(angle + phase))
        frames[f"r{i}__csv"] = made.assign(DRUM_ANGLE=angle, FY=made["FY"] + force)
    channels = (
        'DRUM_ANGLE = { unit = "deg", role = "covariate" }\nFY = { unit = "N", role = "output" }\n'
        'MZ = { unit = "N*m", role = "output" }\n'
    )
    text = toml('kind = "python"\npath = "sim.py"', channels=channels)
    simulator = SIMULATOR.format(signs=SIGNS["SAE"])
    (one,) = diagnose(
        read_case(write_case(tmp_path, text, simulator=simulator, **frames)), None
    ).diagnosis.effects
    assert (one.name, one.channel) == ("drum_runout", "FY")
    found = {each.name: each for each in one.parameters}
    low, high = found["amplitude_1"].ci95
    assert low - (high - low) / 2 < 60.0 < high + (high - low) / 2
    turned = (found["phase_1"].value - phase + 180) % 360 - 180
    assert abs(turned) < 10


@pytest.mark.parametrize("period", [0.12, 0.2, 0.4])
def test_linear_responses_of_an_equation_are_its_simulations_for_a_small_force(tmp_path, period):
    t = np.arange(150) * 0.04
    rows = pd.DataFrame({"t": t, "M": 3 * np.sin(2.2 * t), "TH": 0.0 * t})
    model = model_of(read_case(write_case(tmp_path, SWINGS, simulator=PENDULUM, r0__csv=rows)), None)
    (run,), p = model.case.runs, {"k": 25.0, "c": 0.6}

    def pattern(signals):
        x = signals["position"]
        return np.stack([np.sin(2 * np.pi * x / period), np.cos(2 * np.pi * x / period)], axis=1)

    linear = model.capability.motion.pushed(run, p, (), "om", pattern)["TH"]
    plain = model.simulate(run, p, ())["TH"]
    for column, phase in enumerate((0.0, 90.0)):
        values = {"amplitude": 1e-3, "period": period, "phase": phase}
        ripple = AppliedEffect(effect=effects()["periodic_ripple"], channel="om", values=values)
        moved_by = (model.simulate(run, p, (ripple,))["TH"] - plain) / 1e-3
        # Where the motion passes a period within a row the trapezoid is coarse: a tenth of the largest.
        np.testing.assert_allclose(linear[:, column], moved_by, atol=0.1 * np.abs(moved_by).max())


def test_rows_at_rest_ask_for_no_shorter_ripple(tmp_path):
    from_rest = PENDULUM.replace("[0.3, 0.0]", "[0.0, 0.0]")
    moves = 3 * np.sin(2.2 * np.arange(150) * 0.04)
    periods = []
    for rest in (0, 200):
        torque = np.concatenate([np.zeros(rest), moves])
        rows = pd.DataFrame({"t": np.arange(torque.size) * 0.04, "M": torque, "TH": 0.0 * torque})
        folder = tmp_path / str(rest)
        folder.mkdir()
        case = read_case(write_case(folder, SWINGS, simulator=from_rest, r0__csv=rows))
        problem = problem_of(case, model_of(case, None, None))
        starts = effects()["periodic_ripple"].parameters[1].start_values
        periods.append(min(starts(CaseView(problem, "om", None))))
    assert periods[0] < periods[1] * 1.05


def test_a_channel_that_is_saturated_shows_nothing_of_a_small_force(tmp_path):
    t = np.arange(150) * 0.04
    rows = pd.DataFrame({"t": t, "M": 3 * np.sin(2.2 * t), "TH": 0.0 * t})
    model = model_of(read_case(write_case(tmp_path, SWINGS, simulator=PENDULUM, r0__csv=rows)), None)
    (run,), p = model.case.runs, {"k": 25.0, "c": 0.6}
    plain = model.simulate(run, p, ())["TH"]
    level = float(np.quantile(np.abs(plain), 0.6))
    stop = AppliedEffect(effect=effects()["saturation"], channel="TH", values={"level": level})
    free, stopped = (
        model.capability.motion.pushed(run, p, active, "om", lambda seen: np.ones((len(seen["om"]), 1)))[
            "TH"
        ][:, 0]
        for active in ((), (stop,))
    )
    beyond = np.abs(plain) > level
    assert beyond.sum() > 20
    assert np.abs(stopped[beyond]).max() == 0.0
    np.testing.assert_allclose(stopped[~beyond], free[~beyond])
