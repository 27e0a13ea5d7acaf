"""Noise of the sensor and of the process, told apart on residuals of which both are known."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.simulators.build_simulator import model_of

N = 2000


def parts_of(folder, residuals, *, case=None, conditions=("", ""), digits=9):
    """Return the noise of a load cell whose runs leave the given residuals."""
    text = case or cell_case(0.01)
    frames = {}
    for i, (residual, condition) in enumerate(zip(residuals, conditions, strict=False)):
        t = np.arange(len(residual)) * 0.1
        L = 50 + 30 * np.sin(0.05 * t)
        frames[f"r{i}__csv"] = pd.DataFrame({"t": t, "L": L, "F": np.round(L + residual, digits)})
        text += f'[[recording.run]]\nfile = "r{i}.csv"\n{condition}\n'
    opened = read_case(write_case(folder, text, simulator=CELL, **{"r1__csv": None, **frames}))
    problem = problem_of(opened, model_of(opened, None, None))
    return noise_parts(problem, fit(problem), "F")


def coloured(phi, sd, seed):
    white = np.random.default_rng(seed).standard_normal(N + 500)
    return sd * math.sqrt(1 - phi**2) * lfilter([1], [1, -phi], white)[500:]


def test_white_noise_is_the_sensors(tmp_path):
    parts = parts_of(tmp_path, [np.random.default_rng(0).normal(0, 0.4, N)] * 1)
    assert parts.how == "differences"
    # A median of 2 000 correlated values is known to some 3 %.
    assert parts.sensor_sd == pytest.approx(0.4, rel=0.1)
    assert parts.process_sd < 0.45 * parts.sensor_sd


def test_a_smooth_rest_is_no_sensors(tmp_path):
    rng = np.random.default_rng(1)
    slow = 3 * np.sin(0.02 * np.arange(N)) ** 3
    parts = parts_of(tmp_path, [slow + rng.normal(0, 0.1, N)])
    assert parts.sensor_sd == pytest.approx(0.1, rel=0.1)
    assert parts.process_sd == pytest.approx(math.sqrt(np.mean(slow**2)), rel=0.1)


def test_noise_with_a_long_memory_is_mostly_the_processs(tmp_path):
    parts = parts_of(tmp_path, [coloured(0.99, 1.0, 2)])
    # The autocovariance phi^k gives third differences (20 - 30 phi + 12 phi^2 - 2 phi^3) times it.
    phi = 0.99
    assert parts.sensor_sd == pytest.approx(
        math.sqrt((20 - 30 * phi + 12 * phi**2 - 2 * phi**3) / 20), rel=0.15
    )
    assert parts.process_sd > 5 * parts.sensor_sd


def test_a_certificate_comes_first(tmp_path):
    case = cell_case(0.01).replace('unit = "N", role = "output"', 'unit = "N", role = "output", sd = 0.5')
    parts = parts_of(tmp_path, [np.random.default_rng(3).normal(0, 0.5, N)], case=case)
    assert (parts.sensor_sd, parts.how) == (0.5, "stated")
    assert parts.is_sensor


def test_a_repeat_shows_what_no_physics_repeats(tmp_path):
    rng = np.random.default_rng(4)
    same = np.cumsum(rng.normal(0, 0.2, N))  # left out of the simulation, and the same in both
    runs = [same + rng.normal(0, 0.3, N), same + 1.0 + rng.normal(0, 0.3, N)]
    parts = parts_of(tmp_path, runs, conditions=("", 'repeat_of = "r0.csv"'))
    assert parts.how == "repeats"
    assert parts.sensor_sd == pytest.approx(0.3, rel=0.06)
    assert not parts.is_sensor


def test_printed_digits_are_the_least_noise(tmp_path):
    parts = parts_of(tmp_path, [np.zeros(N)], digits=1)
    # A step of 0.1 leaves its root of twelve.
    assert parts.sensor_sd == pytest.approx(0.1 / math.sqrt(12), rel=0.05)
    assert (parts.how, parts.is_sensor) == ("resolution", True)


def test_both_together_are_the_residual(tmp_path):
    residual = coloured(0.9, 1.0, 5)
    parts = parts_of(tmp_path, [residual])
    assert parts.total_sd == pytest.approx(math.sqrt(np.mean(residual**2)), rel=0.02)
