"""Scores of unseen runs against the multivariate normal density, written out as a full matrix."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal, multivariate_t

from toolkit.diagnosis.fit import folds
from toolkit.diagnosis.fit.folds import UnseenRun, _scores, scattered_scores
from toolkit.diagnosis.fit.noise import Autoregression, autocovariance, layout, log_likelihood

ROWS = 40


def unseen(residual, simulated, noise):
    return UnseenRun.of(residual, simulated, layout([np.arange(ROWS)], [np.ones(ROWS, dtype=bool)]), noise)


def runs(offsets, gains, noise, *, seed=0):
    rng = np.random.default_rng(seed)
    simulated = np.linspace(1.0, 3.0, ROWS)
    covariance = np.array(
        [[autocovariance(noise, ROWS)[abs(i - j)] for i in range(ROWS)] for j in range(ROWS)]
    )
    root = np.linalg.cholesky(covariance)
    residuals = [
        offset + gain * simulated + root @ rng.standard_normal(ROWS)
        for offset, gain in zip(offsets, gains, strict=True)
    ]
    return simulated, residuals, covariance


@pytest.mark.parametrize("reflection", [(), (0.7, -0.2)])
def test_the_score_of_a_run_is_the_density_of_its_residual_with_a_zero_and_a_gain_of_its_own(reflection):
    noise = Autoregression(reflection=reflection, sd=0.5)
    simulated, residuals, covariance = runs((3.0, -4.0, 5.0), (1.0, 0.5, -2.0), noise)
    zero, gain = 2.0, 1.5
    size = math.sqrt(np.mean(simulated**2))
    scatter = zero**2 * np.ones((ROWS, ROWS)) + gain**2 * np.outer(simulated, simulated) / size**2
    full = covariance + scatter
    # The noise of the unseen rows is the likeliest: its square is the residuals' mean in that metric.
    square = np.mean([r @ np.linalg.solve(full, r) for r in residuals]) / ROWS
    expected = [
        multivariate_normal(np.zeros(ROWS), max(square, 1.0) * full).logpdf(residual)
        for residual in residuals
    ]
    found = _scores([unseen(residual, simulated, noise) for residual in residuals], zero, gain)
    assert found == pytest.approx(expected, rel=1e-9)


def test_runs_that_agree_to_their_noise_are_scored_as_by_the_noise_of_the_training_rows():
    noise = Autoregression(reflection=(), sd=0.5)
    simulated, residuals, _ = runs((0.0,) * 8, (0.0,) * 8, noise)
    where = layout([np.arange(ROWS)], [np.ones(ROWS, dtype=bool)])
    plain = sum(log_likelihood(residual, where, noise) for residual in residuals)
    found = sum(scattered_scores([unseen(r, simulated, noise) for r in residuals], by_run=True))
    # Three quantities are the likeliest ones: half a chi-squared of three degrees more, 99.9 % of it.
    assert plain <= found <= plain + 8.2


def test_a_zero_that_moves_between_the_runs_costs_its_logarithm_and_not_its_square():
    noise = Autoregression(reflection=(), sd=0.1)
    off = (0.5, -0.4, 0.6, -0.5)  # some 30 standard errors of a run's mean
    simulated, residuals, _ = runs(off, (0.0,) * 4, noise)
    _, level, _ = runs((0.0,) * 4, (0.0,) * 4, noise)
    moved, still = (
        sum(scattered_scores([unseen(r, simulated, noise) for r in each], by_run=True))
        for each in (residuals, level)
    )
    # Per run half the logarithm of 1 + n (scatter/sd)^2, about 3.5, where the plain score loses 450 or more.
    each = 0.5 * math.log(1 + ROWS * (0.5 / 0.1) ** 2)
    assert still - moved == pytest.approx(4 * each, rel=0.35)


def test_blocks_of_a_run_have_no_zero_of_their_own():
    noise = Autoregression(reflection=(), sd=0.1)
    simulated, residuals, _ = runs((0.5, -0.4, 0.6, -0.5), (0.0,) * 4, noise)
    unseen_runs = [unseen(residual, simulated, noise) for residual in residuals]
    assert sum(scattered_scores(unseen_runs, by_run=True)) > 10 + sum(
        scattered_scores(unseen_runs, by_run=False)
    )


def test_units_of_the_output_do_not_change_what_one_hypothesis_gains_over_another():
    noise = Autoregression(reflection=(0.5,), sd=0.1)
    gains = []
    for factor in (1.0, 1000.0):
        scaled = Autoregression(reflection=(0.5,), sd=0.1 * factor)
        totals = []
        for off in ((0.5, -0.4, 0.6), (0.0, 0.0, 0.0)):
            simulated, residuals, _ = runs(off, (0.0,) * 3, noise)
            listed = [unseen(factor * r, factor * simulated, scaled) for r in residuals]
            totals.append(sum(scattered_scores(listed, by_run=True)))
        gains.append(totals[1] - totals[0])
    assert gains[0] == pytest.approx(gains[1], rel=1e-9)


def test_no_runs_have_no_score():
    assert scattered_scores([], by_run=True) == ()


def test_the_score_of_runs_that_are_not_equally_loud_is_students_density_of_their_residuals():
    noise = Autoregression(reflection=(0.7, -0.2), sd=0.5)
    simulated, residuals, covariance = runs((3.0, -4.0, 5.0), (1.0, 0.5, -2.0), noise)
    residuals = [4.0 * residuals[0], 2.0 * residuals[1], residuals[2]]
    zero, gain, freedom = 2.0, 1.5, 4.0
    size = math.sqrt(np.mean(simulated**2))
    full = covariance + zero**2 + gain**2 * np.outer(simulated, simulated) / size**2

    def densities(square):
        of_runs = multivariate_t(np.zeros(ROWS), square * full, df=freedom)
        return [of_runs.logpdf(residual) for residual in residuals]

    likeliest = minimize_scalar(
        lambda square: -sum(densities(square)), bounds=(1.0, 100.0), method="bounded"
    ).x
    found = _scores([unseen(residual, simulated, noise) for residual in residuals], zero, gain, freedom)
    assert found == pytest.approx(densities(likeliest), rel=1e-5)


def test_an_effect_that_halves_the_errors_of_quiet_runs_is_not_lost_to_a_loud_one():
    simulated, residuals, _ = runs((0.0,) * 3, (0.0,) * 3, Autoregression(reflection=(), sd=1.0))
    loud = np.array([1.0, 1.0, 10.0])
    scores = []
    for left in (np.array([3.0, 3.0, 1.1]), np.array([1.0, 1.0, 1.0])):  # of each run's own noise
        sizes = loud * left
        trained = [math.sqrt(np.mean(np.delete(sizes, k) ** 2)) for k in range(3)]
        listed = [
            unseen(size * r, simulated, Autoregression(reflection=(), sd=sd))
            for size, r, sd in zip(sizes, residuals, trained, strict=True)
        ]
        scores.append(sum(scattered_scores(listed, by_run=True)))
    # By the noise of each run it gains log 3 of every value of the quiet ones. Its training rows do not tell
    # how quiet they are, which may cost it a part, and not all.
    assert scores[1] - scores[0] > 0.5 * ROWS * 2 * math.log(3)


def test_loudness_that_differs_by_chance_alone_keeps_the_score_of_one_noise(monkeypatch):
    """A degree chosen among twelve has to be worth the logarithm of twelve: 1.5 to 1 in 40 rows is not."""
    noise = Autoregression(reflection=(), sd=1.0)
    simulated, residuals, _ = runs((0.0,) * 3, (0.0,) * 3, noise)
    listed = [
        unseen(size * r / np.std(r), simulated, noise)
        for size, r in zip((1.0, 1.0, 1.5), residuals, strict=True)
    ]
    chosen = scattered_scores(listed, by_run=True)
    monkeypatch.setattr(folds, "SCATTER", replace(folds.SCATTER, loudness=(math.inf,)))
    assert chosen == scattered_scores(listed, by_run=True)
