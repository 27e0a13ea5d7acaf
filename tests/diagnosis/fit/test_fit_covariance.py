"""The covariance of a joint fit: least squares under white noise, and a number where data tell nothing."""

import warnings

import numpy as np
import pytest

from toolkit.diagnosis.fit.fit import covariance
from toolkit.diagnosis.fit.noise import Autoregression, Layout

SD = 0.5


def of(columns, sizes):
    rows = np.arange(len(columns))
    return covariance(
        {"F": columns},
        np.zeros((0, columns.shape[1])),
        np.asarray(sizes),
        {"F": Layout(index=rows, segments=(slice(0, len(rows)),))},
        {"F": Autoregression(reflection=(), sd=SD)},
        plain=False,
    )


def test_of_white_noise_it_is_that_of_least_squares():
    columns = np.random.default_rng(1).normal(size=(40, 2))
    sizes = np.array([2.0, 0.1])
    design = columns / sizes
    assert of(columns, sizes) == pytest.approx(SD**2 * np.linalg.inv(design.T @ design), rel=1e-9)


def test_a_parameter_that_moves_nothing_is_open_and_a_number():
    columns = np.column_stack([np.ones(40), np.zeros(40)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = of(columns, [1.0, 1e180])
    assert np.isfinite(found).all()
    assert found[1, 1] > 1e300
    assert found[0, 0] == pytest.approx(SD**2 / 40)
