"""TMeasy: numbers worked out by hand, the conditions that define its curve, and a published parameter set."""

import json
from fractions import Fraction

import numpy as np
import pytest

from tests.conftest import SHARED_DATA
from toolkit.tires.global_model import make_rows
from toolkit.tires.models.tmeasy import MODEL, curve, lever

# Project Chrono, VW_microbus van_TMeasyTireFull.json (BSD-3): values at payload 1900 N and at twice that.
VAN_N = 1900.0
VAN = {
    "dFx0": (34910.7021, 73974.3082), "FxM": (2145.5102, 4140.6407), "FxS": (1522.8229, 2922.8487),
    "sxM": (0.13913, 0.13913), "sxS": (0.66667, 0.66667),
    "dFy0": (30366.8749, 48833.5824), "FyM": (1901.7234, 3471.9636), "FyS": (1583.8391, 2938.7727),
    "syM": (0.14852, 0.18504), "syS": (0.96524, 1.0714),
    "nL0": (0.178, 0.19), "sy0": (0.16337, 0.20355), "syE": (0.96524, 1.0714),
}  # fmt: skip
SIMPLE = {"dF0": 20.0, "FM": 1.0, "sM": 0.15, "FS": 0.8, "sS": 0.65}


def from_payload(one, two, payload_N, length_m):
    """Turn values at payload and twice payload, as published, into the model's parameters (its docstring)."""
    made = {}
    for name, value in one.items():
        base, own, change = name, value, two[name]
        for sliding, peak, distance in (("S", "M", "D"), ("E", "0", "ED")):
            if name.endswith(sliding):
                before = name[:-1] + peak
                sign = -1 if name[0] == "F" else 1
                base = name[:-1] + distance
                own, change = sign * (value - one[before]), sign * (two[name] - two[before])
        if name == "nL0":
            base, own, change = "n0", value * length_m, change * length_m
        force = name[0] in "dF"
        made[base] = own / payload_N if force else own
        made[f"{base}_Z"] = change / (2 * own if force else own) - 1
    return made


def van():
    one, two = ({name: pair[i] for name, pair in VAN.items()} for i in (0, 1))
    return MODEL.values(from_payload(one, two, payload_N=VAN_N, length_m=0.12))


def at(SA, FZ, **more):
    return MODEL.forces(van(), make_rows(SA, FZ, FNOMIN=VAN_N, **more))


def test_numbers_worked_out_by_hand():
    # s = 1/20: n = 1/3, F = 1 / (1 + 1/3 (1/3 + 3 - 2)) = 9/13.
    assert curve(0.05, **SIMPLE) == pytest.approx(float(Fraction(9, 13)), rel=1e-14)
    # a = (20/3)^2 / 3 = 400/27; s* = 0.15 + 0.2/(a 0.5) = 0.177; b = a 0.027/0.473 = 400/473.
    assert curve(0.16, **SIMPLE) == pytest.approx(1 - float(Fraction(400, 27)) * 1e-4, rel=1e-14)
    assert curve(0.40, **SIMPLE) == pytest.approx(0.8 + float(Fraction(400, 473)) * 0.0625, rel=1e-13)
    assert curve(0.65, **SIMPLE) == curve(3.0, **SIMPLE) == 0.8


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_published_set_meets_the_conditions_of_the_curve(axis, which):
    dF0, FM, FS, sM, sS = (VAN[n.replace("_", axis)][which] for n in ("dF_0", "F_M", "F_S", "s_M", "s_S"))
    F = lambda s: curve(np.asarray(s), dF0=dF0, FM=FM, sM=sM, FS=FS, sS=sS)  # noqa: E731
    assert F(1e-9) / 1e-9 == pytest.approx(dF0, rel=1e-6)
    assert F(sM) == pytest.approx(FM, rel=1e-14)
    assert F(sS) == pytest.approx(FS, rel=1e-14)
    h = 1e-5
    for s in (sM, sS):
        for side in (-1, 1):  # level on both sides
            assert (F(s + side * h) - F(s)) / h == pytest.approx(0, abs=2e-3 * FM / sM)
    second = [(F(sM) - 2 * F(sM + k * h) + F(sM + 2 * k * h)) / h**2 for k in (-1, 1)]
    assert second[0] == pytest.approx(second[1], rel=1e-2)  # the curvature does not jump at the peak
    s = np.linspace(0, 1.2 * sS, 20001)
    assert np.abs(np.diff(F(s))).max() < 1.01 * dF0 * s[1]  # no jump, and nowhere steeper than at zero
    assert np.abs(np.diff(F(s), 2)).max() < 20 * FM / sM**2 * s[1] ** 2  # and no kink


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("which", [0, 1])
def test_the_published_peaks_and_sliding_forces_come_back_at_both_loads(axis, which):
    load = VAN_N * (1 + which)
    for force, slip in (("F_M", "s_M"), ("F_S", "s_S")):
        F, s = (VAN[name.replace("_", axis)][which] for name in (force, slip))
        if axis == "y":
            assert at(-np.arctan(s), load).FY[0] == pytest.approx(F, rel=1e-12)
        else:
            assert at(0.0, load, KAPPA=s / (1 - s)).FX[0] == pytest.approx(F, rel=1e-12)


@pytest.mark.parametrize("load", [0.0, 700.0, 1900.0, 3000.0, 3800.0, 5000.0])
def test_between_the_loads_forces_follow_the_parabola_through_zero(load):
    peak = np.polyval(np.polyfit([0, VAN_N, 2 * VAN_N], [0, *VAN["FyM"]], 2), load)
    at_peak = np.polyval(np.polyfit([VAN_N, 2 * VAN_N], VAN["syM"], 1), load)
    assert at(-np.arctan(at_peak), load).FY[0] == pytest.approx(peak, rel=1e-9, abs=1e-9)


def test_a_slope_too_small_for_the_peak_is_kept_and_the_peak_moved():
    given = {"dFy0": 8.0, "FyM": 1.0, "syM": 0.1, "FyD": 0.1, "syD": 0.75}  # 2 FM/sM = 20
    rows = make_rows(-np.arctan([1e-8, 0.1, 0.25, 0.4]), 1000.0, FNOMIN=1000.0)
    FY = MODEL.forces(MODEL.values(given), rows).FY / 1000
    assert FY[0] == pytest.approx(8e-8)
    assert FY[1] < FY[2] == pytest.approx(1.0)
    assert FY[3] < 1.0


def test_a_cubic_joins_peak_and_sliding_where_no_parabolas_do():
    short = {"dF0": 20.0, "FM": 1.0, "sM": 0.15, "FS": 0.5, "sS": 0.2}
    assert curve(0.175, **short) == pytest.approx(0.75)  # halfway down in the middle
    s = np.linspace(0.15, 0.2, 101)
    assert np.all(np.diff(curve(s, **short)) <= 1e-15)


def test_the_trail_falls_through_zero_at_s0_and_is_gone_at_sE():
    s0, sE = 0.16337, 0.96524
    n = lambda s: lever(np.asarray(s), s0=s0, sE=sE)  # noqa: E731
    assert n(0.0) == 1.0
    assert n(s0) == pytest.approx(0.0, abs=1e-15)
    assert n(sE) == n(2.0) == 0.0
    s = np.linspace(s0, sE, 200)[1:-1]
    assert np.all(n(s) < 0)
    # w = s0/sE = 1 leaves the smooth cubic alone: 1/2 in the middle, level at the end.
    assert lever(0.5 * s0, s0=s0, sE=s0) == pytest.approx(0.5)
    h = 1e-7
    assert (n(s0 + h) - n(s0)) / h == pytest.approx((n(s0) - n(s0 - h)) / h, rel=1e-4)  # no kink at s0
    # With sE far out only the line is left.
    assert lever(0.25 * s0, s0=s0, sE=1e9) == pytest.approx(0.75)


def test_the_aligning_moment_is_the_published_trail_times_the_force():
    SA = np.radians(0.01)
    o = at(SA, [VAN_N, 2 * VAN_N])
    trail = -o.MZ / o.FY
    lengths = 0.12 * np.sqrt([1, 2])
    first = 1 - (1 - 0.16337 / 0.96524) * np.tan(SA) / 0.16337
    assert trail[0] == pytest.approx(0.178 * lengths[0] * first, rel=1e-4)
    assert trail[1] == pytest.approx(0.19 * lengths[1], rel=1e-3)


def test_combined_slip_has_the_pure_curves_at_its_ends_and_turns_between():
    SA = np.radians([0, 0, 5.0])
    KAPPA = np.array([0.08, 0.0, 0.0])
    o = at(SA, VAN_N, KAPPA=KAPPA)
    assert o.FY[0] == o.FX[2] == 0
    assert o.FX[0] > 0 > o.FY[2]
    both = at(np.radians(5.0), VAN_N, KAPPA=0.08)
    assert 0 < both.FX[0] < o.FX[0]
    assert o.FY[2] < both.FY[0] < 0
    # All slides: the force points along the normalised slip, by Rill's factors from the published numbers.
    (dFx, FxM, sxM, FxS), (dFy, FyM, syM, FyS) = (
        [VAN[name.replace("_", axis)][0] for name in ("dF_0", "F_M", "s_M", "F_S")] for axis in "xy"
    )
    hx = sxM / (sxM + syM) + (FxM / dFx) / (FxM / dFx + FyM / dFy)
    hy = syM / (sxM + syM) + (FyM / dFy) / (FxM / dFx + FyM / dFy)
    assert hx + hy == pytest.approx(2.0)
    far = at(np.arctan(30.0), VAN_N, KAPPA=9.0)
    phi = np.arctan2(3.0 / hy, 0.9 / hx)
    size = np.hypot(FxS * np.cos(phi), FyS * np.sin(phi))
    assert far.FX[0] == pytest.approx(size * np.cos(phi), rel=1e-12)
    assert far.FY[0] == pytest.approx(-size * np.sin(phi), rel=1e-12)


@pytest.mark.skipif(not SHARED_DATA.is_dir(), reason="no shared data")
def test_the_numbers_above_are_those_of_the_published_file():
    text = (SHARED_DATA / "chrono_tmeasy_examples" / "van_TMeasyTireFull.json").read_text()
    read = json.loads("\n".join(line.split("//")[0] for line in text.splitlines()))["Parameters"]
    assert read["Vertical"]["Nominal Vertical Force [N]"] == VAN_N
    lateral = read["Lateral"]
    assert lateral["Initial Slopes dFy/dsy [N]"] == list(VAN["dFy0"])
    assert lateral["Maximum Fy Load [N]"] == list(VAN["FyM"])
    assert lateral["Sliding Fy Load [N]"] == list(VAN["FyS"])
    assert read["Longitudinal"]["Maximum Fx Load [N]"] == list(VAN["FxM"])
    assert read["Aligning"]["Normalized Trail at Zero Slip sy"] == list(VAN["nL0"])
