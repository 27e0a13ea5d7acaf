"""Algorithm A against published figures of Huber's proposal 2, of which it is the form of ISO 13528."""

from __future__ import annotations

import numpy as np
import pytest
from statsmodels.robust.scale import Huber

from toolkit.comparison.robust import algorithm_a

# Copper in wholemeal flour [ug/g], Analytical Methods Committee, Analyst 114 (1989) 1693; robust figures:
# Venables and Ripley, Modern Applied Statistics with S, 5.5 (hubers, k = 1.5).
COPPER = [
    2.9, 3.1, 3.4, 3.4, 3.7, 3.7, 2.8, 2.5, 2.4, 2.4, 2.7, 2.2, 5.28, 3.37, 3.03, 3.03, 28.95, 3.77, 3.4, 2.2,
    3.5, 3.6, 3.7, 3.7,
]  # fmt: skip
NORMAL = 1.13339
"""The factor without the standard's rounding to 1.134."""


def test_copper_in_flour() -> None:
    values = np.array(COPPER)
    assert values.mean() == pytest.approx(4.2804, abs=5e-5)  # the published mean: the data are these
    robust = algorithm_a(values, factor=NORMAL)
    assert robust.mean == pytest.approx(3.2055, abs=6e-4)
    assert robust.sd == pytest.approx(0.67365, abs=6e-4)
    assert robust.u == pytest.approx(1.25 * robust.sd / np.sqrt(24))
    # The standard's own factor widens it by less than the 0.3 % that is known of it.
    assert robust.sd < algorithm_a(values).sd < 1.003 * robust.sd


@pytest.mark.parametrize("seed", range(5))
def test_it_is_hubers_proposal_2(seed: int) -> None:
    """statsmodels solves the same equations by another way."""
    rng = np.random.default_rng(seed)
    values = rng.normal(10, 1, 25)
    values[:3] += rng.uniform(5, 50, 3)
    mean, sd = Huber(c=1.5, tol=1e-10, maxiter=1000)(values)
    robust = algorithm_a(values, factor=NORMAL)
    assert robust.mean == pytest.approx(float(mean), rel=1e-5)
    assert robust.sd == pytest.approx(float(sd), rel=2e-4)


def test_unit_and_origin_do_not_matter() -> None:
    values = np.array(COPPER)
    there, here = algorithm_a(values), algorithm_a(1000 * values + 5e4)
    assert here.mean == pytest.approx(1000 * there.mean + 5e4, rel=1e-9)
    assert here.sd == pytest.approx(1000 * there.sd, rel=1e-6)


def test_results_that_are_nearly_all_the_same_have_no_spread() -> None:
    assert algorithm_a(np.array([5.0] * 9 + [6.0])).sd == 0
    assert algorithm_a(np.array([5.0] * 5)).sd == 0
