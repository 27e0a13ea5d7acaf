"""Pacejka '94 against a published set, hand-worked numbers of its table, symmetry, and the rows of a fit."""

import numpy as np
import pytest

from toolkit.tires.global_data import measured
from toolkit.tires.global_fit import fit_global
from toolkit.tires.global_model import make_rows
from toolkit.tires.models import find
from toolkit.tires.models.pacejka94 import aligning, lateral

MODEL = find("pacejka94")
SA = np.radians(np.linspace(-12, 12, 25))
# Bakker, Nyborg, Pacejka, SAE 870421 (1987), a passenger tire; FZ in kN, deg, N and N·m. Its stiffness
# a3 sin(a4 arctan(a5 FZ)) has a4 = 1.82 where '94 has 2, its E is a parabola without a7 FZ^2.
LOADS = (1.11, 2.52, 3.70, 4.90, 6.10)
ALIGNING = (4.7, 14.2, 23.7, 33.8, 43.9)  # printed with the set, N·m/deg


def published_moment():
    # 1987's aligning part is '94's with c7 = -0.070, c8 = 0.643, c9 = -4.04.
    c = np.zeros(21)
    c[:10] = 2.40, -2.72, -2.28, -1.86, -2.73, 0.110, 0.0, -0.070, 0.643, -4.04
    return c


def test_published_aligning_set_gives_its_printed_stiffness():
    step = np.array([1e-6])
    for FZ, printed in zip(LOADS, ALIGNING, strict=True):
        slope = aligning(published_moment(), np.array([FZ]), step, 0 * step)[0] / step[0]
        assert -slope == pytest.approx(printed, abs=0.06)


def test_published_aligning_set_at_an_angle_by_hand():
    # FZ 3.7 kN, 4 deg: D = -2.72 3.7^2 - 2.28 3.7 = -45.673; BCD = (-1.86 3.7^2 - 2.73 3.7) exp(-0.407)
    # = -23.672; B = 0.215955; E = -0.070 3.7^2 + 0.643 3.7 - 4.04 = -2.6192; Bx = 0.863820,
    # arctan = 0.712375; inner = 0.863820 + 2.6192 0.151445 = 1.260485; arctan = 0.900006;
    # 2.4 x 0.900006 = 2.160014, sine 0.831490; y = -37.977.
    y = aligning(published_moment(), np.array([3.7]), np.array([4.0]), np.array([0.0]))[0]
    assert y == pytest.approx(-37.98, abs=0.02)


def test_lateral_stiffness_and_peak_are_their_table_entries():
    a = np.zeros(18)
    a[:5], a[5], a[15] = (1.4, -30.0, 1100.0, 1200.0, 6.0), 0.02, 0.001
    F, g, step = np.array([3.0, 3.0]), np.array([0.0, 4.0]), np.full(2, 1e-6)
    slope = lateral(a, F, step, g) / step
    # a3 sin(2 arctan(1/2)) = 1200 x 0.8 = 960; times 1 - 0.02 x 4 = 883.2.
    assert slope == pytest.approx([960.0, 883.2], rel=1e-6)
    # D = 3 (-90 + 1100) = 3030; with camber times 1 - 0.001 x 16.
    peak = lateral(a, *np.meshgrid([3.0], np.linspace(0, 40, 4001)), np.zeros((4001, 1))).max()
    assert peak == pytest.approx(3030.0, rel=1e-6)
    leaned = lateral(a, *np.meshgrid([3.0], np.linspace(0, 40, 4001)), np.full((4001, 1), 4.0)).max()
    assert leaned == pytest.approx(3030.0 * 0.984, rel=1e-6)


def test_shifts_have_their_units():
    a = np.zeros(18)
    a[:5], a[8], a[9], a[11], a[12] = (1.3, 0.0, 1000.0, 1000.0, 5.0), 0.1, 0.2, 5.0, 7.0
    F, zero = np.array([2.0]), np.zeros(1)
    assert lateral(a, F, -np.array([0.4]), zero)[0] == pytest.approx(17.0)  # H = 0.4 deg, V = 17 N
    a[13], a[14] = 1.5, 2.0  # (1.5 x 2 + 2) x 3 deg x 2 kN
    assert lateral(a, F, -np.array([0.4]), np.array([3.0]))[0] == pytest.approx(17.0 + 30.0)


def test_a_tire_without_shifts_is_odd_in_slip_and_camber():
    values = MODEL.values({"a13": 2.0, "a14": 5.0, "a10": 0.05, "a5": 0.01, "c13": 0.1, "c17": 0.5})
    for IA in (0.0, 0.06):
        one = MODEL.forces(values, make_rows(SA, 4000.0, IA=IA, FNOMIN=4000.0))
        other = MODEL.forces(values, make_rows(-SA, 4000.0, IA=-IA, FNOMIN=4000.0))
        assert one.FY == pytest.approx(-other.FY, abs=1e-9)
        assert one.MZ == pytest.approx(-other.MZ, abs=1e-9)


def test_no_load_gives_no_force_and_every_bound_a_finite_one():
    rows = make_rows(np.tile(SA, 3), np.repeat([0.0, 300.0, 60e3], 25), IA=0.1, FNOMIN=4000.0)
    assert not MODEL.forces(MODEL.values({}), rows).FY[:25].any()
    rng = np.random.default_rng(0)
    low = np.array([one.low for one in MODEL.parameters])
    high = np.array([one.high for one in MODEL.parameters])
    sets = low + (high - low) * rng.random((400, len(low)))
    sets = np.concatenate(
        [sets, low[None], high[None], np.where(rng.random((60, len(low))) < 0.5, low, high)]
    )
    with np.errstate(all="ignore"):
        made = MODEL.forces(list(sets.T[..., None]), rows)
    assert np.isfinite(made.FY).all()
    assert np.isfinite(made.MZ).all()


def test_its_own_curves_are_found_again():
    values = MODEL.values({
        "a0": 1.35, "a1": -25.0, "a2": 1050.0, "a3": 1250.0, "a4": 6.0, "a6": -0.1, "a7": -0.2, "a9": 0.1,
        "c0": 2.4, "c1": -2.7, "c2": -2.3, "c3": -1.9, "c4": -2.7, "c5": 0.11, "c7": -0.07, "c8": 0.64,
        "c9": -4.0,
    })  # fmt: skip
    FZ, angles = (one.ravel() for one in np.meshgrid([1100.0, 2500.0, 3700.0, 4900.0, 6100.0], SA))
    made = MODEL.forces(values, make_rows(angles, FZ, FNOMIN=3700.0))
    data = measured({"SA": angles, "FZ": FZ, "FY": made.FY, "MZ": made.MZ}, axes="adapted-SAE")
    fit = fit_global(MODEL, data, predict=False)
    for channel in ("FY", "MZ"):
        assert fit.fit(channel).converged
        assert fit.fit(channel).error_percent < 0.02
