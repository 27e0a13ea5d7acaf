"""Zeros of runs are one value a run: hundreds of rows make no law of them, many runs do."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.diagnosis.fit.among_runs import tells_runs_apart_alone


def runs(count, law, rng, *, zero=0.5, gain=0.0, left=0.4):
    """Return runs with zeros and gains of their own; a law is taken away, and but ``left`` of these."""
    made = []
    # What all have alike is no difference: about their means.
    zeros, gains = (
        size * (each - each.mean())
        for size, each in zip((zero, gain), rng.normal(size=(2, count)), strict=True)
    )
    for one_zero, one_gain in zip(zeros, gains, strict=True):
        simulated = np.sin(np.linspace(0, 12, 200) + rng.uniform(0, 6))
        own = one_zero + one_gain * simulated
        noise = 0.3 * rng.normal(size=200)
        made.append((simulated, own + law(simulated) + noise, left * own + noise))
    return made


@pytest.mark.parametrize("differing", [{"zero": 0.5}, {"zero": 0.0, "gain": 0.5}])
def test_zeros_or_gains_of_four_runs_make_no_law(differing):
    listed = runs(4, lambda y: 0 * y, np.random.default_rng(1), **differing)
    assert tells_runs_apart_alone(listed, cost=2, tests=300)


def test_what_bends_within_the_runs_is_a_law_beside_their_zeros():
    listed = runs(4, lambda y: y**3 - 0.75 * y, np.random.default_rng(1), left=1.0)
    assert not tells_runs_apart_alone(listed, cost=2, tests=300)


@pytest.mark.parametrize("common", [lambda y: 0.5 + 0 * y, lambda y: 0.5 * y])
def test_a_zero_and_a_gain_that_all_runs_share_are_no_difference_of_runs(common):
    listed = runs(3, common, np.random.default_rng(1), left=1.0, zero=0.1)
    assert not tells_runs_apart_alone(listed, cost=2, tests=300)


def test_thirty_runs_are_evidence_of_their_zeros():
    listed = runs(30, lambda y: 0 * y, np.random.default_rng(1), left=0.1)
    assert not tells_runs_apart_alone(listed, cost=2, tests=300)
