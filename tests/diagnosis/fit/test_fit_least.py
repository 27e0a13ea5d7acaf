"""A fit that cannot reach what it is compared with is not carried to its end."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.errors import FitError

CASE = case_text(
    "python", parameters={"gain": (1.0, "1", 1.0)}, inputs={"L": "N"}, outputs={"F": "N"}, runs=1,
)  # fmt: skip
SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["gain"] * inputs["L"]})
"""


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """A gain of two under noise that is correlated from row to row: the noise is estimated in rounds."""
    rng = np.random.default_rng(4)
    noise = np.zeros(400)
    for i in range(1, 400):
        noise[i] = 0.9 * noise[i - 1] + rng.normal(0, 0.1)
    load = np.sin(np.arange(400) / 9)
    frame = pd.DataFrame({"t": np.arange(400) * 0.01, "L": load, "F": 2.0 * load + noise})
    case = read_case(write_case(tmp_path_factory.mktemp("c"), CASE, simulator=SIMULATOR, r0__csv=frame))
    return problem_of(case, model_of(case, None))


@pytest.fixture
def simulations(monkeypatch):
    """Count the simulations of a problem."""
    counted = []
    simulate = Problem.simulate
    monkeypatch.setattr(Problem, "simulate", lambda *a, **k: counted.append(1) or simulate(*a, **k))
    return counted


def test_a_fit_that_reaches_the_least_is_the_fit_without_one(problem):
    free = fit(problem)
    held = fit(problem, least=free.log_posterior - 1)
    assert (held.p, held.log_posterior) == (free.p, free.log_posterior)
    assert held.covariance.tolist() == free.covariance.tolist()


def test_a_fit_that_cannot_reach_the_least_ends_early_and_claims_no_uncertainty(problem, simulations):
    free = fit(problem)
    whole = len(simulations)
    simulations.clear()
    hopeless = fit(problem, least=free.log_posterior + 1e4)
    assert len(simulations) < whole
    assert hopeless.covariance.size == 0
    assert hopeless.log_posterior <= free.log_posterior + 1e-6
    assert math.isfinite(hopeless.log_posterior)


def test_a_fit_beyond_numbers_is_refused_and_ends_no_diagnosis(problem):
    bend = next(each for each in candidates(problem) if each.active.effect.name == "nonlinearity")
    values = bend.starts[0].reached((), {}) | {"quadratic": 1e200, "cubic": 1e200}
    with pytest.raises(FitError, match="no usable output"), np.errstate(over="ignore", invalid="ignore"):
        fit(problem, (replace(bend.active, values=values),), plain=True)
