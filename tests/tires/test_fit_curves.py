"""Fits without start values: published coefficients, coverage, scaling, symmetry, real data, bad input."""

import csv
from pathlib import Path

import numpy as np
import pytest

from toolkit.errors import FitError
from toolkit.tires.evaluate import value_at
from toolkit.tires.fit import MIN_POINTS, fit_curves, why_not
from toolkit.tires.model import Curve
from toolkit.tires.models.magic_formula import slope, value

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
PROTOCOL = np.radians([0, 1, -1, -2, 2, 4, -4, -6, 6, 8, -8, -10, 10]) - np.radians(0.3)

# Bakker, Nyborg, Pacejka, SAE 870421 (1987), table of coefficients: Fz in kN, angle in deg, FY in N, MZ in
# N·m; adapted-SAE signs. Stiffness at 1.11 to 6.10 kN as printed with the set, N/deg and N·m/deg.
LOADS_KN = (1.11, 2.52, 3.70, 4.90, 6.10)
CORNERING = (433, 830, 1003, 1070, 1075)
ALIGNING = (4.7, 14.2, 23.7, 33.8, 43.9)


def bakker_lateral(Fz):
    a1, a2, a3, a4, a5, a6, a7, a8 = -22.1, 1011, 1078, 1.82, 0.208, 0.0, -0.354, 0.707
    C, D = 1.30, a1 * Fz**2 + a2 * Fz
    BCD = np.degrees(a3 * np.sin(a4 * np.arctan(a5 * Fz)))
    return BCD / (C * D), C, D, a6 * Fz**2 + a7 * Fz + a8, 0.0, 0.0


def bakker_aligning(Fz):
    a1, a2, a3, a4, a5, a6, a7, a8 = -2.72, -2.28, -1.86, -2.73, 0.110, -0.070, 0.643, -4.04
    C, D = 2.40, a1 * Fz**2 + a2 * Fz
    BCD = np.degrees((a3 * Fz**2 + a4 * Fz) / np.exp(a5 * Fz))
    return BCD / (C * D), C, D, a6 * Fz**2 + a7 * Fz + a8, 0.0, 0.0


def curve(parameters, SA, channel="FY", noise=None, **others):
    y = value(parameters, SA)
    return Curve(SA=SA, y=y if noise is None else y + noise, channel=channel, load_N=4000.0, **others)


def test_published_coefficients_are_recovered_from_their_own_curves():
    SA = np.radians(np.linspace(-15, 15, 31))
    truths = [("FY", bakker_lateral(Fz)) for Fz in LOADS_KN] + [
        ("MZ", bakker_aligning(Fz)) for Fz in LOADS_KN
    ]
    fits = fit_curves([curve(truth, SA, channel) for channel, truth in truths])
    stiffness = [*CORNERING, *(-one for one in ALIGNING)]
    for fit, (_, truth), printed in zip(fits, truths, stiffness, strict=True):
        assert fit.converged
        assert fit.error_percent < 1e-6
        assert np.allclose(fit.values[:4], truth[:4], rtol=1e-6)
        assert abs(fit.values[4]) < 1e-9
        assert abs(fit.values[5]) < 1e-9 * abs(truth[2])
        digits = 1.0 if printed > 0 else 0.06
        assert np.radians(fit.slope_at_zero.value) == pytest.approx(printed, abs=digits)


def test_intervals_cover_the_truth():
    # 200 curves of the machine's protocol; a 95 % interval of a binomial proportion of 200 at 0.95 is
    # 0.95 +- 0.04 (2.6 standard deviations: a false alarm once in a hundred seeds).
    rng = np.random.default_rng(20)
    truths, curves = [], []
    for _ in range(200):
        truth = (
            rng.uniform(8, 16),
            rng.uniform(1.1, 1.6),
            -4000.0,
            rng.uniform(-2, 0.5),
            rng.normal(0, 0.005),
            30.0,
        )
        truths.append(truth)
        curves.append(curve(truth, PROTOCOL, noise=rng.normal(0, 30, len(PROTOCOL))))
    fits = fit_curves(curves)
    hits = {"slope": [], "value": [], "Sh": []}
    for fit, truth in zip(fits, truths, strict=True):
        for name, estimate, true in (
            ("slope", fit.slope_at_zero, slope(truth, 0.0)),
            ("value", fit.value_at_zero, value(truth, 0.0)),
        ):
            if estimate is not None:
                hits[name].append(abs(estimate.value - true) <= estimate.expanded()[0])
        Sh = fit.parameters[4]
        if Sh.standard_error is not None:
            hits["Sh"].append(abs(Sh.value - truth[4]) <= 2.365 * Sh.standard_error)  # t(7 dof, 95 %)
    for name, covered in hits.items():
        assert len(covered) >= 180, name
        assert 0.90 <= np.mean(covered) <= 0.99, name
    assert np.mean([fit.converged for fit in fits]) > 0.9


def test_a_change_of_the_unit_of_y_scales_D_Sv_and_nothing_else():
    rng = np.random.default_rng(3)
    one = curve((10.0, 2.3, 120.0, -1.5, 0.003, 4.0), PROTOCOL, "MZ", rng.normal(0, 1.0, 13))
    other = Curve(SA=one.SA, y=one.y * 1000.0, channel="MZ", load_N=4000.0)
    a, b = fit_curves([one, other])
    factor = np.array([1, 1, 1000, 1, 1, 1000])
    assert np.allclose(np.array(a.values) * factor, b.values, rtol=1e-4)
    assert b.error_percent == pytest.approx(a.error_percent, rel=1e-6)
    assert b.slope_at_zero.u == pytest.approx(1000 * a.slope_at_zero.u, rel=1e-3)


def test_mirrored_data_give_the_mirrored_fit():
    rng = np.random.default_rng(4)
    one = curve((12.0, 1.4, -4000.0, -1.0, 0.004, 50.0), PROTOCOL, "FY", rng.normal(0, 25, 13))
    a, b = fit_curves([one, Curve(SA=-one.SA, y=-one.y, channel="FY", load_N=4000.0)])
    assert b.error_percent == pytest.approx(a.error_percent, rel=1e-6)
    assert b.slope_at_zero.value == pytest.approx(a.slope_at_zero.value, rel=1e-4)
    assert b.value_at_zero.value == pytest.approx(-a.value_at_zero.value, rel=1e-3)


def test_a_batch_gives_what_each_curve_gives_alone():
    rng = np.random.default_rng(5)
    curves = [
        curve(
            (11.0, 1.3, -3000.0, -0.5, 0.002, 0.0),
            np.radians(np.linspace(-12, 12, n)),
            noise=rng.normal(0, 20, n),
        )
        for n in (13, 21, 9, 200)
    ]
    for alone, together in zip([fit_curves([one])[0] for one in curves], fit_curves(curves), strict=True):
        assert together.error_percent == pytest.approx(alone.error_percent, rel=1e-5)
        assert np.allclose(value_at(together, PROTOCOL), value_at(alone, PROTOCOL), atol=2.0)


def test_robust_loss_bears_ten_percent_of_gross_outliers():
    rng = np.random.default_rng(6)
    SA = np.radians(np.linspace(-12, 12, 60))
    truth = (11.0, 1.4, -4000.0, -0.5, 0.002, 20.0)
    noise = rng.normal(0, 20, 60)
    noise[rng.choice(60, 6, replace=False)] += rng.choice([-3000.0, 3000.0], 6)
    one = curve(truth, SA, noise=noise)
    plain, robust = fit_curves([one])[0], fit_curves([one], loss="robust")[0]
    inner = np.radians(np.linspace(-10, 10, 41))
    miss = np.abs(value_at(robust, inner) - value(truth, inner)).max()
    assert robust.loss == "robust"
    assert miss < 40.0 < np.abs(value_at(plain, inner) - value(truth, inner)).max()


def test_stated_uncertainties_weigh_the_rows():
    rng = np.random.default_rng(7)
    SA = np.radians(np.linspace(-12, 12, 31))
    truth = (11.0, 1.4, -4000.0, -0.5, 0.002, 20.0)
    sigma = np.where(np.abs(SA) < np.radians(5), 5.0, 300.0)
    one = curve(truth, SA, noise=rng.normal(0, sigma), sigma=sigma)
    fit = fit_curves([one])[0]
    assert abs(fit.value_at_zero.value - value(truth, 0.0)) < 4 * fit.value_at_zero.u < 30.0
    assert fit.value_at_zero.dof == np.inf or fit.value_at_zero.dof == fit.dof
    assert "weighted" in fit.message


def test_rows_that_repeat_themselves_do_not_narrow_the_interval():
    # Each noise value stands for ten rows: the standard error must be about sqrt(10) of the naive one.
    rng = np.random.default_rng(8)
    SA = np.radians(10 * np.sin(np.linspace(0, 4 * np.pi, 600)))
    truth = (11.0, 1.4, -4000.0, -0.5, 0.002, 20.0)
    white = fit_curves([curve(truth, SA, noise=rng.normal(0, 40, 600))])[0]
    held = fit_curves([curve(truth, SA, noise=np.repeat(rng.normal(0, 40, 60), 10))])[0]
    ratio = held.value_at_zero.u / white.value_at_zero.u
    assert 2.0 < ratio < 5.0
    assert "autocorrelated" in held.message
    assert "autocorrelated" not in white.message


def test_a_narrow_range_says_what_it_does_not_determine_and_still_gives_the_stiffness():
    rng = np.random.default_rng(9)
    truth = (10.0, 1.3, -4000.0, 0.0, 0.0, 0.0)
    fit = fit_curves([curve(truth, np.radians(np.linspace(-3, 3, 13)), noise=rng.normal(0, 15, 13))])[0]
    assert {"C", "D", "E"} <= set(fit.not_determined)
    assert all(p.standard_error is None for p in fit.parameters if p.name in fit.not_determined)
    assert "peak is not reached" in fit.message
    assert fit.slope_at_zero.value == pytest.approx(slope(truth, 0.0), abs=4 * fit.slope_at_zero.u)


def test_slip_angles_of_one_sign_are_a_stated_limitation():
    rng = np.random.default_rng(10)
    SA = np.radians(np.linspace(0, 10, 15))
    fit = fit_curves([curve((11.0, 1.4, -4000.0, -0.5, 0.0, 0.0), SA, noise=rng.normal(0, 40, 15))])[0]
    assert "one sign" in fit.message
    assert {"Sh", "Sv"} & set(fit.not_determined)


def test_parameters_stay_in_their_bounds():
    rng = np.random.default_rng(11)
    curves = [
        Curve(SA=PROTOCOL, y=rng.normal(0, 1, 13) + k * PROTOCOL, channel="FY", load_N=1.0) for k in range(20)
    ]
    span = np.ptp(PROTOCOL)
    for one, fit in zip(curves, fit_curves(curves), strict=True):
        B, C, D, E, Sh, Sv = fit.values
        top = np.abs(one.y).max() * (1 + 1e-9)
        assert 0.05 * 0.999 <= B * span <= 50 * 1.001
        assert 0 < C <= 4
        assert -20 * 1.001 <= E <= 1 + 1e-9
        assert abs(D) <= 3 * top
        assert abs(Sv) <= top
        assert abs(Sh) <= np.radians(10) * (1 + 1e-9)


SA9 = np.radians(np.linspace(-8, 8, 9))
Y9 = -3000 * np.tanh(10 * SA9)


@pytest.mark.parametrize(
    ("SA", "y", "rule"),
    [
        (SA9[:3], Y9[:3], "too-few-points"),
        (SA9[: MIN_POINTS - 1], Y9[: MIN_POINTS - 1], "too-few-points"),
        (np.repeat(SA9[:3], 5), np.repeat(Y9[:3], 5), "too-few-points"),
        (np.full(9, 0.02), Y9, "constant-column"),
        (SA9, np.full(9, 12.0), "constant-column"),
        (SA9, np.zeros(9), "constant-column"),
        (SA9, np.where(np.arange(9) == 4, np.nan, Y9), "not-finite"),
        (np.where(np.arange(9) == 2, np.inf, SA9), Y9, "not-finite"),
        (SA9, Y9[:8], "lengths"),
    ],
)
def test_what_cannot_be_fitted_is_a_clear_error(SA, y, rule):
    bad = Curve(SA=SA, y=y, channel="FY", load_N=1000.0)
    with pytest.raises(FitError) as caught:
        fit_curves([bad])
    assert caught.value.rule == rule == why_not(bad).rule
    assert caught.value.where
    assert caught.value.next_step


def test_unknown_loss_is_a_clear_error():
    with pytest.raises(FitError, match="unknown loss"):
        fit_curves([Curve(SA=SA9, y=Y9, channel="FY", load_N=1.0)], loss="huber")


def test_no_curves_give_no_fits():
    assert fit_curves([]) == ()


def test_pooled_error_on_a_real_tire_binned_by_a_quarter_degree():
    # A plain solver reaches about 1.05 % on these data (issue list of the project, binned by 0.25 deg).
    path = DATA / "ttc_cornering" / "cornering_IA0_P83kPa.csv"
    if not path.is_file():
        pytest.skip("the cornering data set is not beside this checkout")
    from toolkit.tires.global_data import load_blocks

    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    SA, FY, FZ = (np.array([float(row[key]) for row in rows]) for key in ("SA_deg", "FY_N", "FZ_N"))
    curves = []
    for block in load_blocks(-FZ):
        place = np.floor(SA[block] / 0.25).astype(int)
        place -= place.min()
        count = np.bincount(place)
        mean = [np.bincount(place, one[block])[count > 0] / count[count > 0] for one in (SA, FY)]
        curves.append(Curve(SA=np.radians(mean[0]), y=mean[1], channel="FY", load_N=float(-FZ[block].mean())))
    fits = fit_curves(curves)
    assert [round(fit.load_N, -1) for fit in fits] == [520, 1080, 1640, 2200, 2730]
    assert all(fit.converged for fit in fits)
    top = sum(
        (fit.error_percent / 100) ** 2 * np.sum(one.y**2) for fit, one in zip(fits, curves, strict=True)
    )
    pooled = 100 * np.sqrt(top / sum(np.sum(one.y**2) for one in curves))
    assert pooled < 1.05
