"""Effects that go: a law of a cell that no cell has, where the others take nearly all without it."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.bends import is_outsized
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.superfluous import pruned
from toolkit.diagnosis.simulators.build_simulator import model_of

N = 300


@pytest.mark.parametrize(
    ("zero", "stays"), [(300.0, ["zero_offset"]), (0.5, ["zero_offset", "nonlinearity"])]
)
def test_a_bend_that_no_cell_has_goes_where_the_others_take_nearly_all(tmp_path, zero, stays):
    """A bend of a third of full scale, beside a zero that is far larger, or smaller."""
    text, frames = cell_case(0.01), {}
    for run in range(3):
        rng, t = np.random.default_rng(run), np.arange(N) * 0.1
        load = 50 + 30 * np.sin(0.2 * t + run)
        force = load + zero + 0.004 * load**2 + rng.normal(0, 0.05, N)
        frames[f"r{run}__csv"] = pd.DataFrame({"t": t, "L": load, "F": force})
        text += f'[[recording.run]]\nfile = "r{run}.csv"\n'
    case = read_case(write_case(tmp_path, text, simulator=CELL, **{"r1__csv": None, **frames}))
    problem = problem_of(case, model_of(case, None, None))
    refitted, listed = fit(problem), candidates(problem)
    sizes = {"zero_offset": {"offset": zero}, "nonlinearity": {"quadratic": 0.004, "cubic": 0.0}}
    active = [
        replace(each.active, values=dict(each.active.values) | sizes[each.name])
        for each in listed
        if each.name in sizes and each.active.channel == "F" and each.active.runs is None
    ]
    made = fit(problem, active)
    folds = folds_of(problem, refitted)
    assert {each.effect.name: is_outsized(problem, each) for each in made.active} == {
        "zero_offset": False,
        "nonlinearity": True,
    }
    steps = [Step(active=each, p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=()) for each in made.active]
    unseen, without = (hold_out(problem, folds, each.active, each) for each in (made, refitted))
    _, _, kept = pruned(problem, folds, made, unseen, without, steps, listed)
    assert sorted(step.active.effect.name for step in kept) == sorted(stays)
