"""Runs that do not start where ``initial`` puts them: a rate that was differenced, and is half a row late."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import TWO, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.along_recording import with_run_starts
from toolkit.diagnosis.fit.descent import Space
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of

PENDULUM = """
import numpy as np
def rhs(t, x, u, p):
    return [x[1], -p["w2"] * np.sin(x[0]) - p["c"] * x[1]]
def outputs(x, u, p):
    return {"angle": x[0]}
def initial(p, run):
    return [run["angle"], run["rate"]]
"""
CASE = case_text(
    "ode", path="sim.py", states=["angle", "rate"], force_terms={"rate": "1/s^2"},
    parameters={"w2": (40.0, "1/s^2", 2.0), "c": (0.1, "1/s", 0.1, (0.0, 1.0))},
    outputs={"angle": "rad"}, others={"rate": {"unit": "rad/s", "role": "covariate"}},
)  # fmt: skip
NOISE = 0.002


def swing(seed, *, late, dry=0.4):
    """Return a pendulum of 40 1/s^2, 0.08 1/s and a dry friction, its rate of now or of a difference back."""
    rng, t = np.random.default_rng(seed), np.arange(500) * 0.02
    start = [1.2 - 0.3 * seed, 1.0 + seed]

    def rhs(_, x):
        return [x[1], -40 * np.sin(x[0]) - 0.08 * x[1] - dry * np.tanh(x[1] / 0.01)]

    solved = solve_ivp(rhs, (-0.1, t[-1]), start, t_eval=np.append(-0.02, t), rtol=1e-8, atol=1e-9)
    angle, rate = solved.y
    read = np.diff(angle) / 0.02 if late else rate[1:]
    return pd.DataFrame({"t": t, "angle": angle[1:] + rng.normal(0, NOISE, len(t)), "rate": read}), rate[1]


def posed(folder, *, late, dry=0.4):
    runs = [swing(seed, late=late, dry=dry) for seed in (0, 1)]
    path = write_case(
        folder, CASE + TWO, simulator=PENDULUM, r0__csv=runs[0][0], r1__csv=runs[1][0],
    )  # fmt: skip
    problem = problem_of(read_case(path), model_of(read_case(path), None, None))
    off = [rate - frame["rate"][0] for frame, rate in runs]
    return path, problem, off


@pytest.mark.parametrize("dry", [0.0, 0.4])
def test_runs_that_start_where_they_are_said_to_have_no_starts_of_their_own(tmp_path, dry):
    _, problem, _ = posed(tmp_path, late=False, dry=dry)
    assert with_run_starts(problem, fit(problem)).free == problem.free


@pytest.mark.parametrize("dry", [0.0, 0.4])
def test_a_rate_that_is_half_a_row_late_is_seen_beside_a_friction_that_is_missing(tmp_path, dry):
    _, problem, off = posed(tmp_path, late=True, dry=dry)
    freed = with_run_starts(problem, fit(problem))
    starts = {(each.run, each.state): each for each in freed.free[len(problem.free) :]}
    for run, by in enumerate(off):
        start = starts[run, "rate"]
        assert abs(by) > 0.2  # half a row of an acceleration of 40 1/s^2
        assert start.value == pytest.approx(by, abs=4 * start.sd)
        assert start.sd < 0.1 * abs(by)


def test_one_simulation_serves_the_starts_of_all_runs(tmp_path):
    """The derivatives are those of every start moved by itself."""
    _, problem, _ = posed(tmp_path, late=True)
    freed = with_run_starts(problem, fit(problem))
    p = tuple(each.value for each in freed.free)
    space = Space.of(freed, ())
    simulated, slopes = space.around(space.at(p))
    for i, each in enumerate(freed.free):
        moved = space.at(p)
        moved[i] += 1e-4
        alone = (freed.simulate(*space.split(moved))["angle"] - simulated["angle"]) / 1e-4
        assert slopes["angle"][:, i] == pytest.approx(alone, abs=1e-2 * np.abs(alone).max()), each.name


@pytest.fixture(scope="module")
def answered(tmp_path_factory):
    path, _, off = posed(tmp_path_factory.mktemp("late"), late=True)
    return partial(diagnose, read_case(path))(None).diagnosis, off


def test_the_friction_is_named_in_spite_of_wrong_starts(answered):
    answer, _ = answered
    (effect,) = answer.effects
    assert (answer.verdict, effect.name) == ("named", "coulomb_friction")
    (size,) = [each for each in effect.parameters if each.name == "coulomb"]
    low, high = size.ci95
    assert low < 0.4 < high


def test_the_answer_says_which_runs_start_elsewhere_and_lists_no_start_as_a_parameter(answered):
    answer, off = answered
    told = [finding for finding in answer.findings if finding.rule == "run-starts"]
    assert [finding.where.split(": ")[1] for finding in told] == ["r0.csv", "r1.csv"]
    for finding, by in zip(told, off, strict=True):
        value, unit = finding.message.split("rate by ")[1].split(" ")
        assert float(value) == pytest.approx(by, abs=0.05)
        assert unit == "rad/s"
    assert [each.name for each in answer.nominal_parameters] == ["w2", "c"]


def test_the_simulation_as_declared_starts_where_it_is_said_to(answered):
    """Its error is that of the case's own file, solved by scipy from the rows as they were read."""
    answer, _ = answered
    squares = []
    for seed in (0, 1):
        frame, _ = swing(seed, late=True)
        t, start = frame["t"].to_numpy(), [frame["angle"][0], frame["rate"][0]]
        solved = solve_ivp(
            lambda _, x: [x[1], -40 * np.sin(x[0]) - 0.1 * x[1]], (0, t[-1]), start, t_eval=t, rtol=1e-9,
            atol=1e-10,
        )  # fmt: skip
        squares.append((frame["angle"] - solved.y[0]) ** 2)
    (held_out,) = answer.fit.held_out
    assert held_out.nominal_rmse == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-4)
