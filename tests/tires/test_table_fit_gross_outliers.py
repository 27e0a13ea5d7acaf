"""Gross outliers that least squares follows are told; noise, a model's misfit and heavy tails are not."""

import numpy as np
import pytest

from toolkit.tires.fit import Curve, fit_curves, value_at
from toolkit.tires.models.magic_formula import value
from toolkit.tires.table_fit import gross_outliers

SA = np.radians(np.arange(-12.0, 12.5, 0.75))
TRUTH = {"FY": (10.5, 1.35, -3150.0, -0.6, 0.003, -30.0), "MZ": (12.0, 2.4, 84.0, -2.0, 0.002, 0.3)}


def curve(channel, noise=0.005, seed=3, change=lambda y: y):
    y = value(TRUTH[channel], SA)
    y = y + np.random.default_rng(seed).normal(0, noise * np.abs(y).max(), len(y))
    return Curve(SA=SA, y=change(y), channel=channel, load_N=3000.0, axes="SAE")


def found(*curves, loss="linear"):
    return gross_outliers(curves, fit_curves(curves, loss=loss))


def spoiled(rows, factor):
    def change(y):
        y = y.copy()
        y[list(rows)] *= factor
        return y

    return change


@pytest.mark.parametrize("channel", ["FY", "MZ"])
@pytest.mark.parametrize(("rows", "factor"), [((4, 12, 27), -3.0), ((6, 25, 30), 4.0), ((14,), 2.0)])
def test_a_tenth_of_the_rows_several_times_too_large_is_told_with_its_worst_row(channel, rows, factor):
    one = curve(channel, change=spoiled(rows, factor))
    (finding,) = found(one)
    assert (finding.rule, finding.level) == ("gross-outliers", "warning")
    assert finding.where == f"{channel} at 3000 N (674 lbf)"
    assert finding.message.startswith(f"{len(rows)} of {len(SA)} rows")
    truth = value(TRUTH[channel], SA)
    worst = max(rows, key=lambda row: abs(one.y[row] - truth[row]))
    assert f"at {np.degrees(SA[worst]):.2f} deg" in finding.message


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.05])
@pytest.mark.parametrize("seed", range(10))
def test_normal_noise_is_no_outlier(noise, seed):
    assert found(curve("FY", noise, seed), curve("MZ", noise, seed)) == ()


def test_what_a_robust_fit_has_bounded_is_not_told_again():
    assert found(curve("FY", change=spoiled((4, 12, 27), -3.0)), loss="robust") == ()


def test_a_model_that_misses_the_tire_finds_no_outliers_in_it():
    # A line with a step at its middle: every row is as far off as its neighbours.
    stepped = Curve(SA=SA, y=-2e4 * SA - 500 * np.sign(SA + 1e-9), channel="FY", load_N=3000.0, axes="SAE")
    assert found(stepped) == ()


@pytest.mark.parametrize("seed", range(4))
def test_outliers_of_twenty_peaks_do_not_take_the_robust_fit_with_them(seed):
    # A tenth of a moment's rows shifted by 500 N·m where its peak is 25: squares see nothing but them.
    rng = np.random.default_rng(seed)
    angles = np.radians(np.linspace(-10, 10, 41))
    x = 13.0 * (angles + 0.002)
    true = 24.0 * np.sin(2.0 * np.arctan(x + 0.7 * (x - np.arctan(x))))
    y = true + rng.normal(0, 0.3, len(angles))
    y[rng.choice(len(angles), 4, replace=False)] += 500.0
    (fit,) = fit_curves([Curve(SA=angles, y=y, channel="MZ", load_N=1500.0)], loss="robust")
    assert fit.converged
    assert np.sqrt(np.mean((value_at(fit, angles) - true) ** 2)) < 0.3
