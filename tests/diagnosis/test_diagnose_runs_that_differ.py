"""Effects that are right in every run, in runs that differ a little: they are named, with what remains."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.answer.answer import Dependence
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose


def repetitions(folder, *, quadratic, seed, offset=2e-3, gain=4e-4, noise=4e-4):
    """Return a cell loaded and unloaded three times; zero and gain move between the repetitions."""
    rng = np.random.default_rng(seed)
    L = np.concatenate([np.linspace(1, 10, 10), np.linspace(10, 1, 10)])
    text, frames = cell_case(0.02), {}
    for k, zero in enumerate((1.0, -1.0, 0.5)):
        F = 1.001 * (1 + gain * rng.normal()) * L + quadratic * L**2
        F = F + offset * zero + rng.normal(0, noise, L.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": np.arange(L.size) * 30.0, "L": L, "F": F})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return diagnose(read_case(write_case(folder, text, simulator=CELL, **frames)), None).diagnosis


DRAWS = pytest.mark.campaign("further draws of the same cell: the first is held in every run")


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=DRAWS) for seed in (2, 3))])
def test_a_curved_cell_is_named_though_its_zero_moves(tmp_path, seed):
    answer = repetitions(tmp_path, quadratic=3e-4, seed=seed)
    (effect,) = answer.effects
    assert "nonlinearity" in (effect.name, *effect.equivalent_to)
    # What remains is that the runs differ, and the answer says so.
    assert answer.remaining == "unknown"
    assert Dependence(channel="F", variables=("run",)) in answer.depends_on
    assert answer.fit.held_out[0].augmented_rmse < 0.8 * answer.fit.held_out[0].refitted_rmse


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=DRAWS) for seed in (2, 3))])
def test_runs_that_only_differ_are_given_no_name(tmp_path, seed):
    answer = repetitions(tmp_path, quadratic=0.0, seed=seed)
    assert answer.effects == ()
    assert answer.verdict in ("nothing", "unknown")
