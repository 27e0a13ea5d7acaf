"""Unseen rows of an effect that acts in one run alone: nothing outside of that run tells its size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

HEAD = case_text(
    "python", parameters={"gain": (1.0, "1", 0.01)}, inputs={"L": "N"}, outputs={"F": "N"}, runs=4
)


@pytest.mark.parametrize(
    ("runs", "predicted"), [(("r2.csv",), (0.0, 4.0)), (("r1.csv", "r2.csv"), (0.0, 0.0))]
)
def test_a_size_of_one_run_is_not_what_was_learned_of_the_rows_that_are_held_out(
    tmp_path: Path, runs: tuple[str, ...], predicted: tuple[float, float]
) -> None:
    """Of r2.csv the first half is off by 4 N and the second by none; each is foretold by the other.

    Where another run has the effect too, that run foretells both.
    """
    t, frames = np.arange(60) * 0.1, {}
    for k in range(4):
        load = 100 * np.sin(t + k)
        off = np.where(np.arange(60) < 30, 4.0, 0.0) if k == 2 else 0.0
        noise = np.random.default_rng(k).normal(0, 0.05, 60)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": load, "F": load + off + noise})
    case = read_case(write_case(tmp_path, HEAD, simulator=CELL, **frames))
    problem = problem_of(case, model_of(case, None, None))
    offset = AppliedEffect(
        effect=effects()["zero_offset"], channel="F", values={"offset": 0.0}, runs=frozenset(runs)
    )
    made = fit(problem, (offset,))
    held_out = hold_out(problem, folds_of(problem, made), made.active, made)
    rows = problem.slices[2]
    foretold = held_out.simulated["F"][rows] - problem.runs[2].columns["L"]
    halves = foretold[:30].mean(), foretold[30:].mean()
    assert halves == pytest.approx(predicted, abs=0.2)
