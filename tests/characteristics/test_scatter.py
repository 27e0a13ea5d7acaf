"""The scatter of conditions about the curves: variances that were drawn are found again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.stats import chi2

from tests.characteristics.tire_factory import LOAD, M15, at_load, reduced_test
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.groups import directions_of
from toolkit.characteristics.scatter import Scatter, scatter_of
from toolkit.reduction.model import ReducedTest

THREE = (2000.0, LOAD, 6000.0)


def scatter(reduced: ReducedTest) -> tuple[Scatter, tuple]:
    found = characterise(reduced, machine=M15, record=None)
    directions = directions_of(reduced, found.fits)
    return scatter_of(directions), directions


def noisy(sd: tuple[float, float], seed: int) -> ReducedTest:
    rng = np.random.default_rng(seed)
    base = reduced_test(loads=THREE)
    return dataclasses.replace(base, conditions=tuple(
        dataclasses.replace(c, FY_common=c.FY_common + float(a), MZ_common=c.MZ_common + float(b))
        for c, (a, b) in zip(base.conditions, rng.normal(size=(len(base.conditions), 2)) * sd, strict=True)
    ))  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_the_channels_is_found(seed: int) -> None:
    """Six curves with seven degrees of freedom each: the variance follows chi-square of 42."""
    sd = (8.0, 0.3)
    found, directions = scatter(noisy(sd, seed))
    for channel, true in zip(("FY", "MZ"), sd, strict=True):
        mean = np.mean([found.each(one, channel) for one in directions])
        low, high = chi2.ppf([1e-4, 1 - 1e-4], 42) / 42
        assert low < mean / true**2 < high


def test_an_error_of_the_load_of_each_block_is_no_error_where_the_force_is_none() -> None:
    """Blocks at loads wrong by 20 N each: FY scatters by 20 N dFY/dFZ, much at 4 deg and little at zero."""
    rng = np.random.default_rng(4)
    base = reduced_test(loads=THREE)
    shifted = []
    for c in base.conditions:
        error = float(rng.normal(0.0, 20.0))
        here, up, down = (np.array(at_load(c.FZ + d)) for d in (0.0, 1.0, -1.0))
        FY, MZ = (1 + error * (up - down) / 2 / here).tolist()
        shifted.append(dataclasses.replace(c, FY_common=c.FY_common * FY, MZ_common=c.MZ_common * MZ))
    found, directions = scatter(dataclasses.replace(base, conditions=tuple(shifted)))
    # Load errors: 78 blocks, 36 of whose freedoms the curves take.
    low, high = np.sqrt(chi2.ppf([1e-4, 1 - 1e-4], 42) / 42)
    assert low < np.sqrt(found.variances[2]) / 20.0 < high
    for one in directions:
        u = np.sqrt(found.each(one, "FY"))
        assert u[np.argmin(abs(one.group.SA))] < 0.35 * u.max()


def test_perfect_curves_leave_no_scatter() -> None:
    found, directions = scatter(reduced_test(loads=THREE))
    for one in directions:
        assert np.sqrt(found.each(one, "FY")).max() < 1e-6
