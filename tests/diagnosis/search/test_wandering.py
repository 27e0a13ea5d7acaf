"""Bodies whose heat wanders, that a constant heats, whose sensor has a zero: what a constant is worth."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import expm

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Joint, Step, best_step
from toolkit.diagnosis.search.screen import LinearisedFit, best_of
from toolkit.diagnosis.search.superfluous import told_from_none
from toolkit.diagnosis.search.wandering import may_wander, outdoes_wandering
from toolkit.diagnosis.simulators.build_simulator import model_of

PLACES = {"constant_force": "T2", "zero_offset": "T3"}
BETWEEN, AROUND, CAPACITY = 2.0, 0.25, 400.0  # W/K, W/K, J/K
SENSOR, ROW, PARTS = 0.1, 10.0, 10  # K, s, steps of the plant between two rows
WARM = """schema = 1
title = "Three warm bodies in a row"
[simulation]
kind = "ode"
path = "sim.py"
states = ["T1", "T2", "T3"]
[simulation.parameters.h]
value = 0.25
unit = "W/K"
sd = 0.0125
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
P = { unit = "W", role = "input" }
T1 = { unit = "degC", role = "output", sd = 0.1 }
T3 = { unit = "degC", role = "output", sd = 0.1 }
"""
SIMULATOR = """
import numpy as np
def initial(p):
    return np.full(3, 20.0)
def rhs(t, x, u, p):
    q, r = 2.0 * (x[0] - x[1]), 2.0 * (x[1] - x[2])
    return (np.array([u["P"] - q, q - r, r]) - p["h"] * (x - 20.0)) / 400.0
def outputs(x, u, p):
    return {"T1": x[0], "T3": x[2]}
"""


def warm(
    folder: Path, *, heat: float = 0.0, zero: float = 0.0, stirred: float, sought: str = "constant_force"
) -> tuple[Problem, Fit, Fit]:
    """Return recorded bodies and two fits, without and with a constant.

    Parameters
    ----------
    heat : of the middle body [K/s]
    zero : of the last one's thermometer [K]
    stirred : Brownian heat of every body [K/s^0.5]; the plant is carried on by its matrix exponential
    sought : the constant of the second fit
    """
    chain = np.array([[-1.0, 1, 0], [1, -2, 1], [0, 1, -1]]) * BETWEEN - np.eye(3) * AROUND
    step, toml, frames, t = ROW / PARTS, WARM, {}, np.arange(240) * ROW
    carried = expm(chain / CAPACITY * step)
    for run in range(3):
        rng = np.random.default_rng(1000 + run)
        power = 20 + 15 * np.sin(t / 150 + run)
        x = np.zeros((t.size, 3))
        for k in range(t.size - 1):
            x[k + 1] = x[k]
            for part in range(PARTS):
                heated = power[k] + (power[k + 1] - power[k]) * (part + 0.5) / PARTS
                x[k + 1] = carried @ x[k + 1] + np.array([heated / CAPACITY, heat, 0.0]) * step
                x[k + 1] += stirred * np.sqrt(step) * rng.normal(size=3)
        read = 20 + x[:, ::2] + rng.normal(0, SENSOR, (t.size, 2)) + [0.0, zero]
        frames[f"r{run}__csv"] = pd.DataFrame({"t": t, "P": power, "T1": read[:, 0], "T3": read[:, 1]})
        toml += f'[[recording.run]]\nfile = "r{run}.csv"\n'
    case = read_case(write_case(folder, toml, simulator=SIMULATOR, **frames))
    problem = problem_of(case, model_of(case, None, None))
    bare = fit(problem)
    place = (sought, PLACES[sought], None, None)
    listed = next(each for each in candidates(problem) if each.key == place)
    constant = replace(listed.active, values=dict(listed.starts[0].values))
    return problem, bare, fit(problem, (constant,), start=bare.p)


@pytest.fixture(scope="module")
def warmed(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., tuple[Problem, Fit, Fit]]:
    """Return bodies and their fits, recorded once for all that look at them."""

    @functools.cache
    def recorded(**how: float) -> tuple[Problem, Fit, Fit]:
        return warm(tmp_path_factory.mktemp("warm"), **how)

    return recorded


@pytest.mark.parametrize(
    ("heat", "stirred", "is_one"), [(0.0, 0.02, False), (0.0015, 0.0, True), (0.01, 0.01, True)]
)
def test_a_constant_is_one_where_it_is_more_than_the_mean_of_what_wanders(
    warmed: Callable[..., tuple[Problem, Fit, Fit]], heat: float, stirred: float, is_one: bool
) -> None:
    problem, bare, made = warmed(heat=heat, stirred=stirred)
    assert may_wander(problem, made.active[0])
    assert made.log_posterior - bare.log_posterior > 15  # to free simulations it is one each time
    assert outdoes_wandering(problem, bare, made) is is_one


@pytest.mark.parametrize(("zero", "stirred", "is_one"), [(0.0, 0.02, False), (0.1, 0.0, True)])
def test_a_zero_of_a_sensor_is_one_where_it_is_more_than_what_wanders(
    tmp_path: Path, zero: float, stirred: float, is_one: bool
) -> None:
    problem, bare, made = warm(tmp_path, zero=zero, stirred=stirred, sought="zero_offset")
    assert may_wander(problem, made.active[0])
    assert made.log_posterior - bare.log_posterior > 15
    assert outdoes_wandering(problem, bare, made) is is_one


@pytest.mark.parametrize(("heat", "stirred", "named"), [(0.0, 0.02, 0), (0.0015, 0.0, 1)])
def test_the_mean_of_what_wanders_is_no_step_and_no_name(
    warmed: Callable[..., tuple[Problem, Fit, Fit]], heat: float, stirred: float, named: int
) -> None:
    problem, bare, made = warmed(heat=heat, stirred=stirred)
    folds = folds_of(problem, bare)
    before, unseen = hold_out(problem, folds, (), bare), hold_out(problem, folds, made.active, made)
    steps = [Step(active=made.active[0], p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=())]
    told, _, left = told_from_none(problem, folds, made, unseen, steps, trust=1.0)
    assert len(left) == len(told.active) == named
    listed = [each for each in candidates(problem) if each.key == made.active[0].key]
    (scored,) = best_of(LinearisedFit.of(problem, bare).score(listed[0]))
    joint = (Joint(scored=scored, fit=made, score=made.log_posterior),)
    step = best_step(problem, folds, bare, before, joint, {id(scored): 0.0}, 0.0, before)
    assert (step is not None) is bool(named)
