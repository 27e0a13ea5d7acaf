"""Joint fits end where least squares ends, whatever the way there; straight ones take few simulations."""

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import curve_fit

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.descent import Space, Weighing
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.noise import Autoregression
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of

CASE = """schema = 1
[simulation]
kind = "python"
path = "sim.py"
[simulation.parameters]
a = {{ value = {a}, unit = "N", sd = 1e3 }}
k = {{ value = {k}, unit = "1/s", sd = 1e3 }}
[recording]
time = "t"
[recording.channels]
t = {{ unit = "s", role = "time" }}
F = {{ unit = "N", role = "output" }}
[[recording.run]]
file = "r0.csv"
"""
SIMULATOR = """
def simulate(inputs, p):
    import numpy as np, pandas as pd
    t = inputs["t"].to_numpy()
    return pd.DataFrame({"F": %s})
"""
DECAY, LINE = 'p["a"] * np.exp(-p["k"] * t)', 'p["a"] + p["k"] * t'
T = np.linspace(0.0, 4.0, 200)


def fitted(folder, formula, values, *, sd="1e3", **start):
    table = pd.DataFrame({"t": T, "F": values})
    text = CASE.replace("1e3", sd).format(**start)
    path = write_case(folder, text, simulator=SIMULATOR % formula, r0__csv=table)
    case = read_case(path)
    problem = problem_of(case, model_of(case, None))
    asked, simulate = set(), problem.model.simulate

    def counted(run, p, active):
        asked.add(tuple(p.values()))
        return simulate(run, p, active)

    problem.model.simulate = counted
    return fit(problem), len(asked)


@pytest.mark.parametrize(("a", "k"), [(5.0, 0.3), (20.0, 3.0), (8.0, 1.2)])
def test_a_bent_problem_ends_at_the_least_squares_from_any_start(tmp_path, a, k):
    values = 10 * np.exp(-1.1 * T) + np.random.default_rng(4).normal(0, 0.2, T.size)
    made, _ = fitted(tmp_path, DECAY, values, a=a, k=k)
    wanted, covariance = curve_fit(lambda t, a, k: a * np.exp(-k * t), T, values, (10.0, 1.0))
    assert made.noise["F"].reflection == ()
    # parts of what the noise leaves open
    assert np.abs((made.p - wanted) / np.sqrt(np.diag(covariance))).max() < 0.03


def test_a_straight_problem_needs_differences_once_on_the_way_and_once_at_the_end(tmp_path):
    values = 3.0 + 2.0 * T + np.random.default_rng(5).normal(0, 0.2, T.size)
    made, asked = fitted(tmp_path, LINE, values, a=1.0, k=1.0)
    np.testing.assert_allclose(made.p, np.polynomial.polynomial.polyfit(T, values, 1), rtol=1e-6)
    # two differences at the start and two at the solution; start, solution, and what rounding moves it by
    assert asked <= 10


def test_a_fit_ends_where_no_step_promises_anything_and_simulates_nothing_to_see_that(tmp_path):
    """Against a prior that is too narrow, by data of little noise: a way of many bends along both."""
    values = 10 * np.exp(-1.1 * T) + np.random.default_rng(4).normal(0, 0.01, T.size)
    made, asked = fitted(tmp_path, DECAY, values, a=9.0, k=0.6, sd="0.1")
    assert made.p == pytest.approx((9.17, 0.986), rel=0.003)
    assert asked <= 26  # a search that saw it by simulations took 38


def test_a_trial_that_runs_away_is_large_and_no_fault_of_arithmetic(tmp_path):
    """Warnings are errors here: neither the colour's products nor the square of the whole may overflow."""
    case = read_case(
        write_case(
            tmp_path, CASE.format(a=1.0, k=1.0), simulator=SIMULATOR % LINE,
            r0__csv=pd.DataFrame({"t": T, "F": 3.0 + 2.0 * T}),
        )
    )  # fmt: skip
    problem = problem_of(case, model_of(case, None))
    colour = {"F": Autoregression(reflection=(0.9, -0.3), sd=1.0)}
    weighing = Weighing(Space.of(problem, ()), {"F": problem.layout("F")}, colour)
    away = np.geomspace(1.0, 1e308, problem.rows)
    away[-1] = np.inf
    size = weighing.size({"F": away})
    assert np.isfinite(size)
    assert size > 1e50 * weighing.size({"F": T})
