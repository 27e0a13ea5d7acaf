"""The noise that errors are held against: never what effects or laws have left, unless that is noise."""

from types import SimpleNamespace as Of

import numpy as np
import pytest

from toolkit.diagnosis.answer.answer import HeldOutChannel
from toolkit.diagnosis.answer.held_out_errors import with_laws
from toolkit.diagnosis.fit.sensor_noise import ChannelNoise
from toolkit.diagnosis.fit.structure import RUNS


def noise_beside(*structure, stated=None, laws=None):
    """Return the noise of an output with 0.007 left and a sensor's noise of 0.001; of laws their rms."""
    problem = Of(observed={"y": np.zeros(4)}, stated_sd=lambda _: stated, judged=lambda _, values: values)
    search = Of(problem=problem, structure=tuple(Of(output="y", variables=each) for each in structure))
    listed = () if laws is None else (Of(predicts=True),)
    found = Of(listed=listed, held_out=Of(simulated={"y": np.full(4, laws or 0.0)}))
    errors = HeldOutChannel(
        channel="y", unit="A", nominal_rmse=0.1, refitted_rmse=0.1, augmented_rmse=0.007,
        noise_floor=0.007 if stated is None else stated,
        noise=ChannelNoise(sensor_sd=stated or 0.001, process_sd=0.0069, how="differences"),
    )  # fmt: skip
    (told,) = with_laws(search, found, (errors,))
    return told.noise_floor


def test_what_is_shown_to_be_noise_is_the_noise():
    assert noise_beside() == 0.007


@pytest.mark.parametrize("variables", [("U",), ("time (a line at 2 Hz)",), ("a floor above a tenth",)])
def test_what_effects_leave_of_structure_is_no_noise(variables):
    assert noise_beside(variables) == 0.001


def test_zeros_that_move_between_runs_say_nothing_of_the_noise_within():
    assert noise_beside(RUNS) == 0.007
    assert noise_beside(RUNS, ("U",)) == 0.001


@pytest.mark.parametrize("structure", [(), (("U",),)])
def test_what_laws_leave_is_no_measure_of_them(structure):
    assert noise_beside(*structure, laws=0.003) == 0.001


def test_a_stated_noise_stays():
    assert noise_beside(("U",), stated=0.002, laws=0.001) == 0.002
