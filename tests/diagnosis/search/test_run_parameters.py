"""Runs that disagree about a parameter: told by name, values and distance; noise of any colour is none."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.run_scatter import run_parameter
from toolkit.diagnosis.policy import SCATTER
from toolkit.diagnosis.search.run_parameters import errors_apart, with_disagreement
from toolkit.diagnosis.search.time_budget import TimeBudget
from toolkit.diagnosis.simulators.build_simulator import model_of

ROWS = 150
CASE = case_text(
    "python", title="Warm water", parameters={"rate": (1.0, "1/min", 0.3), "zero": (0.0, "K", 0.3)},
    inputs={"T0": "K"}, outputs={"T": "K"}, runs=3,
)  # fmt: skip
COOLING = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"T": p["zero"] + inputs["T0"] * np.exp(-p["rate"] * np.asarray(inputs["t"]) / 60)})
"""


def case_of(folder, *, rates=(1.0, 1.0, 1.0), phi=0.0, sd=0.03, seed=1):
    frames, t = {}, np.arange(ROWS) * 1.0
    for k, (rate, start) in enumerate(zip(rates, (30.0, 34.0, 27.0), strict=True)):
        rng = np.random.default_rng([seed, k])
        noise = lfilter([1], [1, -phi], rng.standard_normal(ROWS + 999))[999:] * math.sqrt(1 - phi**2)
        T = start * np.exp(-rate * t / 60) + sd * noise
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "T0": np.full(ROWS, start), "T": T})
    return read_case(write_case(folder, CASE, simulator=COOLING, **frames))


def test_runs_that_disagree_are_told_by_their_own_values(tmp_path):
    """Three cups that lose heat at 1.2, 0.8 and 1 of their warmth a minute: who wrote one mass for all?"""
    answer = diagnose(case_of(tmp_path, rates=(1.2, 0.8, 1.0)), None).diagnosis
    assert (answer.verdict, answer.remaining, answer.effects) == ("unknown", "unknown", ())
    (finding,) = [each for each in answer.findings if each.rule == "runs-disagree"]
    assert finding.where.endswith("rate")
    values = finding.message.split("[1/min]: ")[1].split(";")[0].split(", ")
    assert [text.split()[0] for text in values] == ["r0.csv", "r1.csv", "r2.csv"]
    assert [float(text.split()[1]) for text in values] == pytest.approx([1.2, 0.8, 1.0], abs=0.01)
    (sentence,) = [text for text in answer.next_measurements if "disagree" in text]
    assert "about rate: measure it by itself as it was in r1.csv and in r0.csv" in sentence


@pytest.mark.parametrize("phi", [0.0, 0.9, 0.99])
def test_runs_that_only_have_noise_agree(tmp_path, phi):
    """Noise that remembers two thirds of a run: zeros of the runs take most of it, and agree even so."""
    for seed in range(8):
        case = case_of(tmp_path / str(seed), phi=phi, sd=0.3, seed=seed)
        problem = problem_of(case, model_of(case, None, None))
        search = SimpleNamespace(problem=problem, refitted=fit(problem), skipped=())
        budget = TimeBudget(600.0, lambda _: None, alarm=False)
        assert with_disagreement(search, search.refitted, budget) is search


def test_the_distance_is_that_of_the_difference_of_two_values(tmp_path):
    """White noise of 0.03 K: by the formula of least squares, linear in the rate and the zero known.

    Its colour is not known, and might be such that as many rows are worth half.
    """
    case = case_of(tmp_path, rates=(1.2, 0.8, 1.0))
    problem = problem_of(case, model_of(case, None, None))
    problem = replace(problem, free=problem.free[:1])
    own = run_parameter(problem, fit(problem), least=SCATTER.halved)
    assert own is not None
    t = np.arange(ROWS) / 60
    errors = [
        0.03 / math.sqrt(np.sum((start * t * np.exp(-rate * t)) ** 2))
        for rate, start in ((1.2, 30.0), (0.8, 34.0))
    ]
    assert errors_apart(own) == pytest.approx(0.4 / math.hypot(*errors) / math.sqrt(2), rel=0.1)
