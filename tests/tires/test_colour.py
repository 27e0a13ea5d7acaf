"""Coloured noise: covariances against exact matrices, degrees of freedom, and what the intervals cover."""

import numpy as np
import pytest

from toolkit.estimate import coverage_factor
from toolkit.tires.colour import noise_of
from toolkit.tires.fit import Curve, fit_curves
from toolkit.tires.models.magic_formula import slope, value


def autoregression(rng, rho, shape, sd=1.0):
    noise = rng.normal(0.0, sd, shape)
    for k in range(1, shape[-1]):
        noise[..., k] = rho * noise[..., k - 1] + np.sqrt(1 - rho**2) * noise[..., k]
    return noise


def fitted(columns, y):
    # Linear least squares of each series by columns (p, n): coefficients, residuals, sums of squares.
    coefficients = y @ columns.T @ np.linalg.inv(columns @ columns.T)
    residual = y - coefficients @ columns
    return coefficients, residual, np.vecdot(residual, residual)


def judged(columns, y):
    coefficients, residual, cost = fitted(columns, y)
    many = len(y)
    lengths = np.full(many, y.shape[1])
    noise = noise_of(
        residual, np.repeat(columns[None], many, axis=0), lengths, cost, np.full(many, np.nan)
    )  # fmt: skip
    return coefficients, noise


@pytest.mark.parametrize("rho", [0.5, 0.8, 0.9])
def test_the_mean_of_an_autoregression_has_its_known_variance(rho):
    # Var(mean) = s^2/n^2 sum rho^|i-j|: half of what is reported lies above, and t intervals cover 95 %.
    n, many, sd = 200, 1000, 3.0
    rng = np.random.default_rng(int(100 * rho))
    columns = np.ones((1, n))
    means, noise = judged(columns, autoregression(rng, rho, (many, n), sd))
    assert len(noise.coloured) == many
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    true = sd**2 * np.sum(rho**lag) / n**2
    said = 1.0 / noise.information[:, 0, 0]
    assert np.median(said) == pytest.approx(true, rel=0.1)
    dof = noise.dof_of(np.ones((many, 1, 1)))[:, 0]
    factor = np.array([coverage_factor(one) for one in dof])
    share = np.mean(np.abs(means[:, 0]) <= factor * np.sqrt(said))
    assert 0.93 <= share <= 0.97


@pytest.mark.parametrize("n", [21, 39])
def test_the_mean_of_few_rows_that_repeat_each_other_is_covered(n):
    # Three repeats of 7 or 13 steps. Taken for white, every other mean of AR(0.9) would lie outside.
    rng = np.random.default_rng(n)
    means, noise = judged(np.ones((1, n)), autoregression(rng, 0.9, (1000, n)))
    said = noise.variance / n
    factor = np.array([coverage_factor(dof) for dof in noise.dof])
    said[noise.coloured] = 1.0 / noise.information[:, 0, 0]
    factor[noise.coloured] = np.array(
        [coverage_factor(dof) for dof in noise.dof_of(np.ones((len(noise.coloured), 1, 1)))[:, 0]]
    )
    assert np.mean(np.abs(means[:, 0]) <= factor * np.sqrt(said)) >= 0.93


def test_a_padded_curve_is_judged_as_it_is_alone():
    rng = np.random.default_rng(8)
    columns = np.stack([np.ones(120), np.linspace(-1, 1, 120), np.sin(np.arange(120) / 9)])
    _, residual, cost = fitted(columns, autoregression(rng, 0.8, (1, 120)))
    nothing = np.array([np.nan])
    alone = noise_of(residual, columns[None], np.array([120]), cost, nothing)
    wide = noise_of(
        np.pad(residual, ((0, 0), (0, 40))), np.pad(columns, ((0, 0), (0, 40)))[None], np.array([120]), cost,
        nothing,
    )  # fmt: skip
    assert wide.information == pytest.approx(alone.information, rel=1e-9)
    assert wide.dof == pytest.approx(alone.dof, rel=1e-9)


def test_every_quantity_has_the_variance_and_the_degrees_of_its_own_frequency():
    # The spectrum of an autoregression, (1 - rho^2)/(1 - 2 rho cos w + rho^2): by it a level, at w = 0, and
    # an alternation, at w = pi, are uncertain in the ratio ((1 + rho)/(1 - rho))^2; and where
    # cos w = 2 rho/(1 + rho^2) it does not change with rho, so that not knowing rho costs nothing there.
    n, rho, many = 1200, 0.9, 60
    w = np.arccos(2 * rho / (1 + rho**2))
    columns = np.stack([np.ones(n), (-1.0) ** np.arange(n), np.sqrt(2) * np.sin(w * np.arange(n))])
    _, noise = judged(columns, autoregression(np.random.default_rng(5), rho, (many, n)))
    variance = np.einsum("kpp->kp", np.linalg.inv(noise.information))
    assert np.median(variance[:, 0] / variance[:, 1]) == pytest.approx(19.0**2, rel=0.25)
    level, _, between = np.median(noise.dof_of(np.repeat(np.eye(3)[None], many, axis=0)), axis=0)
    assert between > 1.5 * level


def test_white_noise_and_few_rows_keep_the_classical_variance():
    rng = np.random.default_rng(6)
    for n, many in ((15, 40), (30, 40), (300, 40)):
        columns = np.stack([np.ones(n), np.linspace(-1, 1, n)])
        y = rng.normal(0, 1, (many, n))
        _, noise = judged(columns, y)
        _, _, cost = fitted(columns, y)
        white = np.setdiff1d(np.arange(many), noise.coloured)
        assert len(white) == many if n < 18 else len(white) > 0.7 * many
        assert noise.variance[white] == pytest.approx(cost[white] / (n - 2))
        assert np.all(noise.dof[white] == n - 2)
        assert np.all(noise.time[white] == 1)


def test_known_uncertainties_are_a_floor_without_degrees_of_freedom():
    columns = np.ones((1, 100))
    _, residual, cost = fitted(columns, autoregression(np.random.default_rng(7), 0.7, (1, 100)))
    noise = noise_of(residual, columns[None], np.array([100]), cost, np.array([50.0]))
    assert np.isinf(noise.dof[0])
    assert np.isinf(noise.dof_of(np.ones((1, 1, 1)))[0, 0])
    assert noise.variance[0] == pytest.approx(50.0)


TRUTH = (10.0, 1.3, -4000.0, -1.0, 0.002, 30.0)


LESS = pytest.mark.campaign("noise of less colour, which asks less than that of every run")


@pytest.mark.parametrize("rho", [pytest.param(0.0, marks=LESS), pytest.param(0.5, marks=LESS), 0.9])
def test_intervals_of_a_thousand_curves_cover(rho):
    n, many = 150, 1000
    SA = np.radians(np.linspace(-12.0, 12.0, n))
    rng = np.random.default_rng(20 + int(10 * rho))
    y = value(TRUTH, SA) + autoregression(rng, rho, (many, n), 60.0)
    fits = fit_curves([Curve(SA=SA, y=row, channel="FY", load_N=4000.0) for row in y])

    def share(pairs):
        told = [(one, true) for one, true in pairs if one is not None]
        return np.mean([abs(one.value - true) <= one.expanded()[0] for one, true in told])

    slopes = share([(fit.slope_at_zero, slope(TRUTH, 0.0)) for fit in fits])
    levels = share([(fit.value_at_zero, value(TRUTH, 0.0)) for fit in fits])
    # Three standard deviations of a share of a thousand are 2 %.
    assert 0.93 <= slopes <= 0.97
    assert 0.93 <= levels <= 0.985
    shifts = [
        abs(fit.parameters[4].value - TRUTH[4])
        <= coverage_factor(fit.parameters[4].dof) * fit.parameters[4].standard_error
        for fit in fits
        if fit.parameters[4].standard_error is not None
    ]
    assert 0.93 <= np.mean(shifts) <= 0.985
