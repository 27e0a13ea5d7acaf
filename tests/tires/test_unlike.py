"""Rows that scatter unlike: variances by restricted likelihood, intervals of fits with a noisy slip angle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.special import stdtrit

from toolkit.tires.fit import fit_curves
from toolkit.tires.global_data import measured
from toolkit.tires.global_fit import fit_global
from toolkit.tires.model import Curve
from toolkit.tires.models import find
from toolkit.tires.unlike import unlike_rows


def design(n):
    """Return a polynomial's columns (6, n) and what a unit of each variance gives a row (2, n)."""
    x = np.linspace(-1, 1, n)
    return np.vander(x, 6).T, np.stack([np.ones(n), (3 / (1 + (4 * x) ** 2)) ** 2])


def residuals(rng, count, sd_of_input, n=61):
    X, parts = design(n)
    noise = rng.standard_normal((count, n)) * np.sqrt([1.0, sd_of_input**2] @ parts)
    return noise - noise @ np.linalg.pinv(X) @ X


def estimate(r):
    X, parts = design(r.shape[1])
    return unlike_rows(
        r, np.broadcast_to(X, (len(r), *X.shape)), np.broadcast_to(parts, (len(r), *parts.shape))
    )


def test_the_variances_are_those_of_the_largest_restricted_likelihood():
    for r in residuals(np.random.default_rng(1), 5, 1.0, n=39)[:, None]:
        X, parts = design(39)

        def against(theta, X=X, parts=parts, r=r):
            v = np.maximum(theta, 1e-9) @ parts
            normal = X / v @ X.T
            left = r[0] - np.linalg.solve(normal, X @ (r[0] / v)) @ X
            return 0.5 * (np.log(v).sum() + np.linalg.slogdet(normal)[1] + np.sum(left**2 / v))

        options = {"xatol": 1e-9, "fatol": 1e-11}
        best = minimize(against, [1.0, 1.0], method="Nelder-Mead", options=options).x
        assert estimate(r).variances[0] == pytest.approx(np.maximum(best, 0), rel=5e-3, abs=5e-3)


def test_rows_that_scatter_about_alike_may_be_taken_together():
    r = residuals(np.random.default_rng(6), 200, 1.0)
    X, parts = design(61)
    error = []
    for row in r:

        def score(theta, row=row):
            v = theta @ parts
            P = np.diag(1 / v) - (X / v).T @ np.linalg.solve(X / v @ X.T, X / v)
            moved = P @ row
            return [part @ moved**2 - np.trace(P * part) for part in parts]

        unlike = estimate(row[None])
        if (unlike.variances[0] > 0.05).all():
            # The likelihood's own equations, over what they scatter by.
            error.append(
                np.linalg.norm(np.linalg.cholesky(unlike.covariance[0]).T @ score(unlike.variances[0])) / 2
            )
    assert len(error) > 150
    assert np.median(error) < 0.1


def test_variances_are_unbiased_and_their_covariance_says_how_they_scatter():
    unlike = estimate(residuals(np.random.default_rng(2), 400, 1.0))
    assert unlike.variances.mean(axis=0) == pytest.approx([1.0, 1.0], abs=0.08)
    stated = np.sqrt(np.diagonal(unlike.covariance.mean(axis=0)))
    assert unlike.variances.std(axis=0) == pytest.approx(stated, rel=0.2)


def test_another_unit_scales_the_variances():
    r = residuals(np.random.default_rng(3), 3, 1.0)
    assert estimate(1e4 * r).variances == pytest.approx(1e8 * estimate(r).variances, rel=1e-9)


_DEG = np.pi / 180
_LOADS = (1100.0, 2500.0, 3700.0, 4900.0, 6100.0)


def force(SA, FZ):
    """Return FY of a passenger tire [N], FNOMIN 4000 N, by the equations of Magic Formula 5.2 written out."""
    dfz = FZ / 4000.0 - 1
    K = -19.0 * 4000.0 * np.sin(2 * np.arctan(FZ / (2.1 * 4000.0)))
    D, C = (1.02 - 0.15 * dfz) * FZ, 1.4
    x = np.tan(SA) + 0.001
    z = K / (C * D) * x
    return D * np.sin(C * np.arctan(z + 0.8 * (z - np.arctan(z)))) + 0.01 * FZ


def slope(FZ):
    """Return dFY/dSA at zero slip angle [N/rad]."""
    return (force(1e-6, FZ) - force(-1e-6, FZ)) / 2e-6


def recording(rng):
    """Return true slip angle [rad], load and force of 61 rows a load, and the slip angle as it is read."""
    SA = np.tile(np.linspace(-10, 10, 61) * _DEG, len(_LOADS))
    FZ = np.repeat(_LOADS, 61)
    return (
        SA + 0.1 * _DEG * rng.standard_normal(len(SA)),
        FZ,
        force(SA, FZ) + 30.0 * rng.standard_normal(len(SA)),
    )


def holds(estimate, truth):
    return abs(estimate.value - truth) <= stdtrit(estimate.dof, 0.975) * estimate.u


def test_forces_and_stiffnesses_of_single_loads_hold_where_the_slip_angle_is_noisy():
    """Rows taken alike held the force at zero in 85 of 100, the stiffness in 82 to 87."""
    rng = np.random.default_rng(4)
    curves = [
        Curve(SA=SA[load == FZ], y=FY[load == FZ], channel="FY", load_N=load, axes="ISO-W")
        for SA, FZ, FY in (recording(rng) for _ in range(40))
        for load in _LOADS
    ]
    fits = fit_curves(curves)
    assert 0.91 <= np.mean([holds(fit.value_at_zero, force(0.0, fit.load_N)) for fit in fits]) <= 0.985
    assert 0.91 <= np.mean([holds(fit.slope_at_zero, slope(fit.load_N)) for fit in fits]) <= 0.985


def test_stiffnesses_over_all_loads_hold_where_the_slip_angle_is_noisy():
    """Rows taken alike held the stiffness at 6100 N in 71 of 100."""
    rng, model, held = np.random.default_rng(5), find("mf52"), []
    for _ in range(40):
        SA, FZ, FY = recording(rng)
        data = measured({"SA": SA, "FZ": FZ, "FY": FY}, axes="ISO-W", rated_load_N=4000.0)
        (fit,) = fit_global(model, data, predict=False).fits
        held.append([holds(load.stiffness, slope(load.load_N)) for load in fit.loads])
    assert (np.mean(held, axis=0) >= 0.875).all()
