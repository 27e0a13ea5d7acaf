"""A step that was read off the digits is moved by no fit: what is fitted beside it is smooth."""

import numpy as np
import pytest

from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect

STEP = 6.3


@pytest.fixture
def problem(tmp_path):
    frames = {f"r{i}__csv": carriage(seed=i) for i in range(2)}
    for frame in frames.values():
        frame["F"] = STEP * np.round(frame["F"] / STEP)
    case = read_case(write_case(tmp_path, HEAD + TWO, **frames))
    return problem_of(case, model_of(case, None, None))


def test_neither_the_step_nor_what_is_fitted_beside_it_moves(problem):
    friction = AppliedEffect(
        effect=effect("coulomb_friction"), channel="F", values={"coulomb": 15.0, "presliding": 0.01}
    )
    steps = AppliedEffect(effect=effect("quantisation"), channel="F", values={"step": STEP})
    smooth = fit(problem, (friction,))
    stepped = fit(problem, (friction, steps))
    assert stepped.active[1].values["step"] == STEP
    assert stepped.p == smooth.p
    assert stepped.active[0].values == smooth.active[0].values
    np.testing.assert_array_equal(stepped.covariance, smooth.covariance)
    assert stepped.simulated["F"] == pytest.approx(STEP * np.round(smooth.simulated["F"] / STEP))


def test_nor_do_they_move_where_a_fold_is_held_out(problem):
    steps = AppliedEffect(effect=effect("quantisation"), channel="F", values={"step": STEP})
    whole = fit(problem, (steps,))
    held = hold_out(problem, folds_of(problem, whole), (steps,), whole)
    assert [trained.active[0].values["step"] for _, trained in held.fits] == [STEP] * len(held.fits)
