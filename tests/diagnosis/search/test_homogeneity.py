"""Noise is the same in all runs and at all times, or in proportion to the signal."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.homogeneity import uneven
from toolkit.diagnosis.simulators.build_simulator import model_of

N = 400
T = 0.1 * np.arange(N)


def coloured(phi, rng):
    return math.sqrt(1 - phi**2) * lfilter([1], [1, -phi], rng.standard_normal(N + 2000))[2000:]


def case_of(folder, rest, *, runs=3):
    """Return a load cell whose run k leaves ``rest(k, load, rng)``."""
    text, frames = cell_case(0.01), {}
    for k in range(runs):
        rng = np.random.default_rng([11, k])
        load = (50 + 10 * np.sin(0.11 * T + k) + 7 * np.sin(0.43 * T + 2 * k)) * (1 + 0.5 * k)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": T, "L": load, "F": load + rest(k, load, rng)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, text, simulator=CELL, **{"r1__csv": None, **frames}))


def found(folder, rest, *, runs=3):
    """Return what is uneven of a case."""
    case = case_of(folder, rest, runs=runs)
    problem = problem_of(case, model_of(case, None, None))
    return uneven(problem, fit(problem), "F")


def wave(first, last):
    return np.where((first < T) & (T < last), np.sin(np.pi * (T - first) / (last - first)), 0.0)


def test_a_run_that_leaves_much_more_than_the_others_is_told(tmp_path):
    def rest(k, _, rng):
        return rng.normal(0, 0.1, N) + (k == 1) * 3 * wave(5, 35)

    part = found(tmp_path, rest)
    assert part.variables == ("time (louder in r1.csv)",)
    assert part.rest
    assert part.is_lawful
    assert part.noise_sd == pytest.approx(0.1, rel=0.08)


@pytest.mark.campaign("a whole diagnosis: what one run leaves is told in every run")
def test_what_only_one_run_leaves_is_not_told_as_noise(tmp_path):
    def rest(k, _, rng):
        return rng.normal(0, 0.1, N) + (k == 1) * 2 * wave(5, 35)

    answer = diagnose(case_of(tmp_path, rest), None).diagnosis
    assert (answer.verdict, answer.effects) == ("unknown", ())
    assert [by.variables for by in answer.depends_on] == [("time (louder in r1.csv)",)]


def test_a_stretch_of_a_single_run_is_told_with_its_time(tmp_path):
    part = found(tmp_path, lambda _k, _, rng: rng.normal(0, 0.1, N) + 3 * wave(20, 25), runs=1)
    (text,) = part.variables
    assert text.startswith("time (louder in r0.csv from 20 to 24.9 s")


NULLS = {
    "white": lambda _k, _, rng: rng.normal(0, 0.5, N),
    "AR(1) 0.9": lambda _k, _, rng: 0.5 * coloured(0.9, rng),
    "AR(1) 0.99": lambda _k, _, rng: 0.5 * coloured(0.99, rng),
    "heavy tails": lambda _k, _, rng: lfilter([1], [1, -0.7], 0.5 * rng.standard_t(3, N)),
    "in proportion": lambda _k, load, rng: 0.02 * load * coloured(0.8, rng),
    "zeros and gains of runs": lambda _k, load, rng: (
        rng.normal(0, 2) + load * rng.normal(0, 0.02) + 0.5 * coloured(0.8, rng)
    ),
    "rounded": lambda _k, load, rng: np.round((load + 0.3 * coloured(0.9, rng)) / 0.5) * 0.5 - load,
}


@pytest.mark.parametrize("null", NULLS)
def test_one_noise_is_even(tmp_path, null):
    assert found(tmp_path, NULLS[null]) is None
