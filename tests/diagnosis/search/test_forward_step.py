"""What a step takes: of equals the likeliest, and what coloured noise of few rows only hints at."""

import numpy as np
import pandas as pd

from tests.diagnosis.cases import write_case
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


def test_of_equals_the_physics_is_named_before_the_instrument(tmp_path):
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
