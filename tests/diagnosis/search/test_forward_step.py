"""What a step takes: of equals the likeliest, and what coloured noise of few rows only hints at."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import HEAD, TWO, write_case
from tests.diagnosis.tire_case import python_tire
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.policy import STEP
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import step_groups
from toolkit.diagnosis.search.screen_step import look
from toolkit.diagnosis.simulators.build_simulator import model_of

COASTING = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"v": inputs["v0"] * np.exp(-p["c"] * inputs["t"])})
"""
CASE = """schema = 1
[simulation]
kind = "python"
path = "sim.py"
[simulation.parameters.c]
value = 0.02
unit = "1/s"
sd = 0.004
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
v0 = { unit = "m/s", role = "input" }
v = { unit = "m/s", role = "output" }
"""


def coasts(folder, *, force):
    """Return coasting runs under v' = -c v - force (closed form), with noise that wanders for minutes."""
    rng, text, frames = np.random.default_rng(3), CASE, {}
    for k in range(4):
        t, wander = np.arange(120) * 0.5, np.zeros(120)
        for i in range(1, 120):
            wander[i] = 0.99 * wander[i - 1] + rng.normal(0, 0.05)
        v = (8 + force / 0.02) * np.exp(-0.02 * t) - force / 0.02
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "v0": 8.0, "v": v + wander + rng.normal(0, 0.03, 120)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, text, simulator=COASTING, **frames))


def carriage(folder, *, zero):
    """Return runs of a carriage of 94 kg whose force, up to 300 N, shows so much too much [N]."""
    frames = {}
    for k in range(2):
        rng, t = np.random.default_rng([1, k]), np.arange(300) * 0.02
        v, a = 0.5 * np.sin(2 * t + k) + 0.2 * np.sin(5 * t), np.cos(2 * t + k) + np.cos(5 * t)
        force = 94 * a + 210 * v + zero + rng.normal(0, 1, 300)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "v": v, "a": a, "F": force})
    return read_case(write_case(folder, HEAD + TWO, **frames))


@pytest.mark.parametrize(
    ("zero", "names"),
    [(3.0, ("zero_offset", "constant_force")), (60.0, ("constant_force", "zero_offset"))],
)
def test_a_hundredth_of_the_range_is_a_sensors_zero_and_a_fifth_of_it_a_force(tmp_path, zero, names):
    (effect,) = diagnose(carriage(tmp_path, zero=zero), None).diagnosis.effects
    assert (effect.name, *effect.equivalent_to) == names


def test_a_degree_is_a_zero_of_the_steering_and_no_plies_pull_as_far(tmp_path):
    case = read_case(python_tire(tmp_path, offset=1.0))
    (effect,) = diagnose(case, None).diagnosis.effects
    assert (effect.name, effect.equivalent_to) == ("steer_offset", ("plysteer",))


def test_a_drift_that_takes_half_of_the_range_is_a_force(tmp_path):
    (effect,) = diagnose(coasts(tmp_path, force=0.12), None).diagnosis.effects
    assert (effect.name, effect.equivalent_to) == ("constant_force", ("zero_drift",))


def test_noise_that_wanders_gets_no_name(tmp_path):
    assert not diagnose(coasts(tmp_path, force=0.0), None).diagnosis.effects


def test_what_few_rows_of_coloured_noise_hint_at_has_to_explain_most_of_unseen_runs(tmp_path):
    case = coasts(tmp_path, force=0.06)
    problem = problem_of(case, model_of(case, None, None))
    view = look(problem, fit(problem), candidates(problem), turn=0, seed=1)
    assert view.significant == ()
    assert "constant_force" in {trial.candidate.name for trial in view.hinted}
    assert step_groups((), view.hinted, frozenset(), STEP.first) == [
        (view.hinted[: STEP.refined], STEP.shown)
    ]
    assert step_groups((), (), frozenset(), STEP.first) == []
