"""Coloured noise: the exact Gaussian likelihood, Burg's estimate, gaps, and what a residual is worth."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.stats import multivariate_normal

from toolkit.diagnosis.fit.noise import (
    Autoregression,
    Memory,
    autocovariance,
    draws,
    fit_noise,
    layout,
    log_likelihood,
    memory_of,
    predictor,
    whiten,
)


def _one(n: int):
    return layout([np.arange(n, dtype=float)], [np.ones(n, dtype=bool)])


def _series(rng: np.random.Generator, phi: float, n: int) -> np.ndarray:
    x = np.empty(n)
    x[0] = rng.normal() / np.sqrt(1 - phi**2)
    for i in range(1, n):
        x[i] = phi * x[i - 1] + rng.normal()
    return x


@pytest.mark.parametrize("reflection", [(), (0.7,), (0.9, -0.4), (0.5, 0.3, -0.2)])
def test_likelihood_is_that_of_the_dense_gaussian(reflection):
    noise = Autoregression(reflection=reflection, sd=1.3)
    n = 12
    # Yule and Walker: the autocovariance that the predictor's own equations imply, solved densely.
    a = predictor(reflection)[-1]
    p = len(a)
    equations = np.zeros((p + 1, p + 1))
    for k in range(p + 1):
        equations[k, k] += 1
        for j in range(1, p + 1):
            equations[k, abs(k - j)] -= a[j - 1]
    gamma = np.zeros(n)
    gamma[: p + 1] = np.linalg.solve(equations, np.r_[1.3**2, np.zeros(p)])
    for k in range(p + 1, n):
        gamma[k] = sum(a[j - 1] * gamma[k - j] for j in range(1, p + 1))
    x = np.random.default_rng(1).normal(size=n)
    expected = multivariate_normal(np.zeros(n), toeplitz(gamma)).logpdf(x)
    assert log_likelihood(x, _one(n), noise) == pytest.approx(expected, rel=1e-10)
    np.testing.assert_allclose(autocovariance(noise, n), gamma, rtol=1e-10, atol=1e-12)
    assert noise.marginal_sd == pytest.approx(np.sqrt(gamma[0]), rel=1e-12)


@pytest.mark.parametrize("phi", [0.0, 0.9, 0.99])
def test_colour_is_found_within_its_own_standard_error(phi):
    rng = np.random.default_rng(7)
    n = 20_000
    made = fit_noise(_series(rng, phi, n), _one(n), floor=1e-12)
    first = made.reflection[0] if made.reflection else 0.0
    assert first == pytest.approx(phi, abs=4 * np.sqrt((1 - phi**2) / n) + 1e-12)
    assert made.sd == pytest.approx(1.0, abs=4 / np.sqrt(2 * n))


def test_a_gap_begins_a_new_segment_and_a_masked_row_splits_nothing_else():
    t = np.r_[np.arange(50.0), np.arange(100.0, 150.0)]
    kept = np.ones(100, dtype=bool)
    kept[10] = False
    where = layout([t], [kept])
    assert [one.stop - one.start for one in where.segments] == [49, 50]
    assert where.n == 99


@pytest.mark.parametrize("rests", [True, False])
def test_the_colour_is_that_of_all_rows_where_a_pause_stands_after_every_few(rests):
    """Read in bursts: the long segments, if any, are those at rest, whose residual is one constant."""
    rng = np.random.default_rng(5)
    burst, rest, phi = 6, 30, 0.6
    t, values = [], []
    clock = 0.0
    for k in range(200):
        if rests and k % 40 == 0:
            values += [0.3] * rest
            t += (clock + np.arange(rest)).tolist()
            clock += rest + 10
        x = rng.standard_normal() / np.sqrt(1 - phi**2)
        for _ in range(burst):
            values.append(x)
            x = phi * x + rng.standard_normal()
        t += (clock + np.arange(burst)).tolist()
        clock += burst + 10
    r = np.array(values)
    where = layout([np.array(t)], [np.ones(len(t), dtype=bool)])

    noise = fit_noise(r, where, floor=1e-9)

    assert noise.marginal_sd == pytest.approx(float(np.sqrt(np.mean(r**2))), rel=0.1)
    assert noise.reflection[0] == pytest.approx(phi, abs=0.1)


def test_whitening_columns_is_whitening_each():
    rng = np.random.default_rng(3)
    noise = Autoregression(reflection=(0.8, 0.1), sd=2.0)
    where = layout([np.arange(30.0), np.arange(25.0)], [np.ones(30, bool), np.ones(25, bool)])
    x = rng.normal(size=(55, 3))
    whole = whiten(x, where, noise)
    for j in range(3):
        np.testing.assert_allclose(whole[:, j], whiten(x[:, j], where, noise), rtol=1e-12)


def test_rows_of_a_smooth_noise_are_worth_less():
    # AR(1): the variance of a mean of n rows is (1 + phi) / (1 - phi) times that of white noise.
    assert Autoregression(reflection=(0.9,), sd=1.0).correlation_rows == pytest.approx(1.9 / 0.1, rel=1e-9)
    assert Autoregression(reflection=(), sd=1.0).correlation_rows == 1.0


def test_drawn_noise_is_stationary_from_its_first_value_and_white_after_whitening():
    """A gap begins a segment anew: its first value has the noise's whole spread, near a unit root too."""
    where = layout([np.arange(40.0), np.arange(2.0)], [np.ones(40, dtype=bool), np.ones(2, dtype=bool)])
    for reflection in ((0.9, -0.4, 0.2), (0.9999,), ()):
        noise = Autoregression(reflection=reflection, sd=0.7)
        series = draws(noise, where, 20_000, np.random.default_rng(1))
        np.testing.assert_allclose(series.std(axis=1), noise.marginal_sd, rtol=0.03)
        white = whiten(series, where, noise)
        np.testing.assert_allclose(white @ white.T / 20_000, np.eye(42), atol=0.04)


def _segmented(seed: int):
    """Return a series of an autoregression in segments of 1 to 39 values, each from its own beginning."""
    rng = np.random.default_rng(seed)
    lengths = [*range(1, 40), *rng.integers(1, 40, 60).tolist()]
    times = np.concatenate([np.arange(n) + 100.0 * i for i, n in enumerate(lengths)])
    where = layout([times], [np.ones(len(times), dtype=bool)])
    return np.concatenate([_series(rng, 0.8, n) for n in lengths]), where


def test_the_colour_of_many_segments_is_that_of_the_recursion_in_each_of_them():
    values, where = _segmented(4)
    made = fit_noise(values, where, floor=1e-9)
    forward = backward = [values[segment] for segment in where.segments if segment.stop - segment.start >= 24]
    for reflection in made.reflection:  # Burg (1975): the harmonic mean of both predictions' errors
        forward, backward = [f[1:] for f in forward], [b[:-1] for b in backward]
        pairs = list(zip(forward, backward, strict=True))
        k = 2 * sum(f @ b for f, b in pairs) / sum(f @ f + b @ b for f, b in pairs)
        assert reflection == pytest.approx(k, rel=1e-10)
        forward, backward = [f - k * b for f, b in pairs], [b - k * f for f, b in pairs]
    assert made.reflection[0] == pytest.approx(0.8, abs=0.1)


@pytest.mark.parametrize("order", [1, 2, 8])
def test_segments_are_whitened_as_each_is_alone(order):
    values, where = _segmented(5)
    noise = Autoregression(reflection=tuple(0.9 * (-0.8) ** k for k in range(order)), sd=0.7)
    both = np.stack([values, values[::-1]], axis=1)
    alone = [whiten(both[s], _one(s.stop - s.start), noise) for s in where.segments]
    np.testing.assert_allclose(whiten(both, where, noise), np.concatenate(alone), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(
        whiten(values, where, noise), np.concatenate(alone)[:, 0], rtol=1e-10, atol=1e-12
    )


def test_rows_with_a_memory_are_worth_the_values_that_it_leaves_independent():
    x = np.random.default_rng(3).normal(size=40)
    each = fit_noise(x, _one(40), floor=1e-12)
    repeated = fit_noise(np.repeat(x, 5), _one(200), floor=1e-12, memory=Memory(rows=5.0))
    assert repeated.marginal_sd == pytest.approx(np.sqrt(np.mean(x**2)))
    white = Autoregression(reflection=(), sd=each.marginal_sd)
    of_rows = log_likelihood(np.repeat(x, 5), _one(200), repeated)
    assert of_rows == pytest.approx(log_likelihood(x, _one(40), white))
    assert not repeated.is_coloured
    assert repeated.correlation_rows == 5.0


def test_changes_with_a_memory_are_worth_the_values_that_it_leaves_independent():
    """Of what only drifts its changes are weighed: where it stands says nothing."""
    steps = np.random.default_rng(3).normal(size=40)
    drifting = 7.0 + np.concatenate([[0.0], np.cumsum(np.repeat(steps, 5))])
    where, memory = _one(201), Memory(rows=5.0, apart=1)
    noise = fit_noise(drifting, where, floor=1e-12, memory=memory)
    assert noise.marginal_sd == pytest.approx(np.sqrt(np.mean(steps**2)))
    assert memory.independent(where) == pytest.approx(40.0)
    white = Autoregression(reflection=(), sd=noise.marginal_sd)
    assert log_likelihood(drifting, where, noise) == pytest.approx(log_likelihood(steps, _one(40), white))
    assert whiten(drifting, where, noise)[0] == 0.0


def test_no_change_reaches_over_a_gap():
    parts = layout([np.r_[np.arange(4.0), np.arange(100.0, 103.0)]], [np.ones(7, dtype=bool)])
    memory = Memory(rows=1.0, apart=2)
    changes = memory.weighed(np.array([0.0, 1.0, 4.0, 9.0, 50.0, 60.0, 75.0]), parts)
    assert changes.tolist() == [0, 0, 4, 8, 0, 0, 25]
    assert memory.counted(parts) == 3


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_a_memory_is_bartletts_of_the_mean_for_noise_that_does_not_swing(phi):
    noise = Autoregression(reflection=(phi,), sd=1.0)
    assert memory_of(noise, 400) == pytest.approx((1 + phi) / (1 - phi), rel=1e-9)


def test_what_swings_has_no_mean_and_a_memory_all_the_same():
    noise = Autoregression(reflection=(-0.9,), sd=1.0)
    assert noise.correlation_rows == 1.0
    # 1 + 2 sum of phi^2k
    assert memory_of(noise, 400) == pytest.approx((1 + 0.81) / (1 - 0.81), rel=1e-9)
