"""The likeliest sizes of zeros and gains, of likelihoods whose top is set."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.diagnosis.fit.scatter_sizes import likeliest_sizes


@dataclass(frozen=True)
class Run:
    """A run that leaves 1e4 in its squares; 100 rows show its zero, and a quarter of that its gain."""

    rest: float
    inner: NDArray[np.float64]


RUNS = [Run(1e4, np.diag([100.0, 25.0])), Run(4e3, np.diag([50.0, 25.0]))]


@pytest.mark.parametrize(("zero", "gain"), [(0.3, 2.0), (1.7, 0.5), (5.0, 11.0)])
def test_the_top_of_a_likelihood_is_reached_to_its_last_step(zero: float, gain: float) -> None:
    def likelihood(of_zeros: float, of_gains: float) -> float:
        return -sum(
            math.log(max(size, 1e-9) / top) ** 2 for size, top in ((of_zeros, zero), (of_gains, gain))
        )

    # The last factor is 1.07: the nearest size lies within its root, or a step beyond where two are as near.
    assert likeliest_sizes(RUNS, likelihood) == pytest.approx((zero, gain), rel=0.07)


def test_runs_that_are_likeliest_without_scatter_have_none() -> None:
    assert likeliest_sizes(RUNS, lambda of_zeros, of_gains: -of_zeros - of_gains) == (0.0, 0.0)
    assert likeliest_sizes(RUNS, lambda of_zeros, of_gains: -of_zeros - abs(of_gains - 2.0))[0] == 0.0


def test_a_change_of_the_simulated_outputs_unit_changes_the_gains_alone() -> None:
    plain = likeliest_sizes(RUNS, lambda zero, gain: -((zero - 0.5) ** 2) - (gain - 3.0) ** 2)
    scaled = [Run(run.rest, run.inner * np.array([[1.0, 0.0], [0.0, 1e6]])) for run in RUNS]
    there = likeliest_sizes(scaled, lambda zero, gain: -((zero - 0.5) ** 2) - (1e3 * gain - 3.0) ** 2)
    assert there == pytest.approx((plain[0], plain[1] / 1e3), rel=1e-9)
