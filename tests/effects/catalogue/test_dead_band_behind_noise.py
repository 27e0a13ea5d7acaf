"""A dead band behind noise shows the mean of the band over that noise."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from tests.effects.rig import setting
from toolkit.effects.catalogue import effects
from toolkit.effects.catalogue.dead_band import NOISE

WIDTH = 4.0
Y = np.linspace(-9, 9, 37)


def banded(y, **more):
    return effects()["dead_band"].channel(y, {"width": WIDTH, **more}, setting(np.arange(len(y)) * 0.1))


def plain(x):
    """The band's own words: nothing within half the width, beyond it what is over."""
    return x - 2 if x > 2 else x + 2 if x < -2 else 0.0


@pytest.mark.parametrize("sd", [0.1, 0.7, 2.0, 15.0])
def test_it_is_the_mean_of_the_band_over_normal_noise(sd):
    def mean(y):
        density = lambda e: plain(y + sd * e) * np.exp(-0.5 * e * e) / np.sqrt(2 * np.pi)  # noqa: E731
        corners = sorted({-9.0, 9.0, *(float(np.clip((edge - y) / sd, -9, 9)) for edge in (-2, 2))})
        return sum(quad(density, a, b, epsabs=1e-12)[0] for a, b in itertools.pairwise(corners))

    np.testing.assert_allclose(banded(Y, **{NOISE: sd}), [mean(y) for y in Y], atol=1e-9 * max(sd, 1))


@pytest.mark.parametrize("sd", [1e-3, 1e-6, 1e-12, 0.0])
def test_without_noise_it_is_the_plain_band(sd):
    # at a corner the mean of what is over is sd / sqrt(2 pi)
    made = banded(Y, **{NOISE: sd})
    np.testing.assert_allclose(made, [plain(y) for y in Y], rtol=0, atol=0.4 * sd + 1e-14)
    assert np.isfinite(made).all()


def test_it_is_odd_rises_and_is_the_straight_shifted_line_far_outside():
    made = banded(Y, **{NOISE: 1.0})
    np.testing.assert_allclose(made, -made[::-1], atol=1e-14)
    assert (np.diff(made) > 0).all()  # a band alone stands still in its middle
    assert banded(np.array([1e4]), **{NOISE: 1.0}) == pytest.approx(1e4 - 2)


def test_without_width_the_mean_of_noise_is_nothing():
    made = effects()["dead_band"].channel(Y, {"width": 0.0, NOISE: 3.0}, setting(np.arange(37) * 0.1))
    np.testing.assert_allclose(made, Y, atol=1e-12)


def test_a_lost_row_stays_lost():
    y = np.where(np.arange(37) == 5, np.nan, Y)
    made = banded(y, **{NOISE: 1.0})
    assert np.flatnonzero(np.isnan(made)).tolist() == [5]
