"""Single rows that stand far off are left out of every fit; what answers a sharp move of an input is kept."""

from types import SimpleNamespace

import numpy as np
import pytest

from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.fit.problem import Problem, without_outliers

T = np.arange(400) * 0.05
RAMP = np.interp(T % 5.0, [0.0, 2.4, 2.5, 4.9, 5.0], [0.0, 8.0, 0.0, -8.0, 0.0])  # jumps back within two rows


def problem_of(residual):
    run = Run(name="r", t=T, columns={"SA": RAMP}, conditions={}, declared={}, simulated={})
    case = SimpleNamespace(drivers=(SimpleNamespace(name="SA", role="input"),))
    whole = np.ones(len(T), dtype=bool)
    return Problem(
        case=case, model=None, runs=(run,), free=(), known={}, observed={"FY": residual}, kept={"FY": whole},
        floor={"FY": 1e-6}, slices=(slice(0, len(T)),),
    )  # fmt: skip


@pytest.fixture
def noise():
    return np.random.default_rng(3).normal(size=len(T))


def test_a_row_far_off_its_neighbours_is_left_out(noise):
    noise[[120, 233]] += 40.0
    kept = without_outliers(problem_of(noise), {"FY": noise}).kept["FY"]
    assert np.flatnonzero(~kept).tolist() == [120, 233]


def test_what_answers_a_sharp_move_is_no_outlier(noise):
    sharp = np.flatnonzero(np.abs(np.diff(RAMP)) > 3)
    noise[sharp] += 40.0
    assert without_outliers(problem_of(noise), {"FY": noise}).kept["FY"].all()
