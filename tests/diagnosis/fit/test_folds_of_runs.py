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
from toolkit.diagnosis.fit.folds import HeldOut, folds_of, hold_out
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.fit.run_scatter import held_out_beside_scatter
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

HEAD = case_text(
    "python", parameters={"gain": (1.0, "1", 0.01)}, inputs={"L": "N"}, outputs={"F": "N"}, runs=5
)


def off_by(folder: Path, zeros: tuple[float, ...], runs: tuple[str, ...]) -> tuple[Problem, HeldOut]:
    """Return runs with these zeros, r2.csv off by 4 N more in its first half, and a zero of some held out."""
    t, frames = np.arange(60) * 0.1, {}
    for k, zero in enumerate(zeros):
        load = 100 * np.sin(t + k)
        off = zero + (np.where(np.arange(60) < 30, 4.0, 0.0) if k == 2 else 0.0)
        noise = np.random.default_rng(k).normal(0, 0.05, 60)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": load, "F": load + off + noise})
    case = read_case(write_case(folder, HEAD, simulator=CELL, **frames))
    problem = problem_of(case, model_of(case, None, None))
    offset = AppliedEffect(
        effect=effects()["zero_offset"], channel="F", values={"offset": 0.0}, runs=frozenset(runs)
    )
    made = fit(problem, (offset,))
    return problem, hold_out(problem, folds_of(problem, made), made.active, made)


def halves(problem: Problem, held_out: HeldOut) -> tuple[float, float]:
    """Return the zeros of both halves of r2.csv as they are foretold."""
    foretold = held_out.simulated["F"][problem.slices[2]] - problem.runs[2].columns["L"]
    return float(foretold[:30].mean()), float(foretold[30:].mean())


@pytest.mark.parametrize(
    ("runs", "predicted"), [(("r2.csv",), (0.0, 4.0)), (("r1.csv", "r2.csv"), (0.0, 0.0))]
)
def test_a_size_of_one_run_is_not_what_was_learned_of_the_rows_that_are_held_out(
    tmp_path: Path, runs: tuple[str, ...], predicted: tuple[float, float]
) -> None:
    """Of r2.csv the first half is off by 4 N and the second by none; each is foretold by the other.

    Where another run has the effect too, that run foretells both.
    """
    problem, held_out = off_by(tmp_path, (0.0, 0.0, 0.0, 0.0, 0.0), runs)
    assert halves(problem, held_out) == pytest.approx(predicted, abs=0.2)


def test_nor_is_it_beside_zeros_that_move_from_run_to_run(tmp_path: Path) -> None:
    problem, held_out = off_by(tmp_path, (-3.0, 2.0, 0.0, 1.0, -2.0), ("r2.csv",))
    beside = held_out_beside_scatter(problem, held_out)
    assert not np.array_equal(beside.simulated["F"], held_out.simulated["F"])
    assert halves(problem, beside) == pytest.approx((0.0, 4.0), abs=0.2)
