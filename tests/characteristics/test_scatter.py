"""The scatter of conditions about the curves: variances that were drawn are found again."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2

from tests.characteristics.tire_factory import LOAD, M15, at_load, reduced_test, tire
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.groups import directions_of
from toolkit.characteristics.scatter import Scatter, scatter_of, weights_of
from toolkit.reduction.model import ReducedTest
from toolkit.tires.models import model

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


@pytest.mark.parametrize(("cause", "freedoms"), [("channel", 14), ("slip angle", 28)])
def test_what_all_loads_of_a_file_share_has_the_freedoms_of_one_load(cause: str, freedoms: int) -> None:
    """One error a file: three loads are three readings of the same 13 errors, from which 6 parameters go.

    Of both directions 14 freedoms are left, as of a single load, and as many more where FY and MZ show the
    same error of the slip angle; each block by itself would give three times as many.
    """
    rng = np.random.default_rng(11)
    base = reduced_test(loads=THREE, u=(0.5, 0.02))
    error = {file: rng.normal(size=2) for file in sorted({c.file for c in base.conditions})}
    moved = []
    for c in base.conditions:
        FY, MZ = (c.FY, c.MZ) + error[c.file] * (8.0, 0.3)
        if cause == "slip angle":
            SA = np.array([c.SA + error[c.file][0] * np.radians(0.05)])
            FY, MZ = np.concatenate(tire(SA, reverse=c.rotation == "reverse", load=c.FZ))
        rows = rng.normal(size=2) * (0.5, 0.02)
        moved.append(dataclasses.replace(c, FY_common=float(FY + rows[0]), MZ_common=float(MZ + rows[1])))
    found, directions = scatter(dataclasses.replace(base, conditions=tuple(moved)))
    for one in directions:
        fit = one.fit.FY
        assert fit is not None
        weights = {"FY": model(fit.model).jacobian(fit.values, 0.0) @ weights_of(one, "FY")}
        u, dof = found.of(one, weights)
        assert dof < 1.3 * freedoms
        slope = found.directions[one.group.load_N, one.group.rotation].by_channel["FY"][3]
        drawn = 8.0 if cause == "channel" else np.radians(0.05) * slope
        low, high = np.sqrt(chi2.ppf([1e-4, 1 - 1e-4], 14) / 14)
        assert low < u / np.linalg.norm(drawn * weights["FY"]) < high


def test_what_the_form_of_a_moment_misses_is_no_error_of_the_force() -> None:
    """A wave in MZ over the slip angle, odd, the same in all loads and directions: no Magic Formula has it.

    FY lies on its curves: nothing of the wave may be told as an error of the slip angle, which would move FY
    by 60 kN/rad. What is read of MZ at zero slip is as sure as without it, for the wave is none there.
    """
    base = reduced_test(loads=THREE, u=(0.5, 0.01))
    waved = dataclasses.replace(base, conditions=tuple(
        dataclasses.replace(
            c,
            MZ_common=c.MZ_common + 0.8 * (c.FZ / LOAD) ** 2 * math.sin(126.0 * (c.step_SA or 0.0)),
        )
        for c in base.conditions
    ))  # fmt: skip
    found, directions = scatter(waved)
    assert found.variances[8] > 0
    for one in directions:
        assert np.sqrt(found.each(one, "FY")).max() < 0.5
    u = {
        name: row.estimate.u
        for name in ("CRAT", "conicity")
        if (row := characterise(waved, machine=M15, record=None).at(name, LOAD, "both")) is not None
        and row.estimate is not None
    }
    plain = characterise(base, machine=M15, record=None)
    for name, value in u.items():
        row = plain.at(name, LOAD, "both")
        assert row is not None
        assert row.estimate is not None
        assert value < 3 * row.estimate.u


def test_a_form_that_changes_its_sign_is_none_at_zero_slip_whatever_the_steps() -> None:
    """The tire's own part is that of a step at the step, half of it half way to zero, and none at zero."""
    angles = (-10.0, -8.0, -6.0, -4.0, -2.0, 2.0, 4.0, 6.0, 8.0, 10.0)
    found, directions = scatter(reduced_test(angles=angles, loads=THREE))
    found = dataclasses.replace(found, variances=np.eye(10)[7])
    first = directions[0]
    none = {"FY": np.zeros(len(angles))}
    own = {
        at: sum(e.share for e in found.form(first, none, ("FY", math.radians(at)))) for at in (0.0, 1.0, 2.0)
    }
    assert own[0.0] == 0.0
    assert own[1.0] == pytest.approx(own[2.0] / 2)
    assert own[2.0] != 0.0
