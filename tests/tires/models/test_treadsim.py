"""TreadSim: the plain brush as its limit, balances that must hold, and the convergence of its grid."""

import numpy as np
import pytest
from scipy.integrate import quad

from toolkit.tires.bristles import _TOLERANCE
from toolkit.tires.global_model import make_rows
from toolkit.tires.models import brush
from toolkit.tires.models.treadsim import BRISTLES, MODEL, forces

F0 = 4000.0
PLAIN = {"C": 18.0, "C_Z": -0.3, "MU": 0.95, "A": 0.07, "A_P": 0.6}
SA = np.radians(np.linspace(-15, 15, 61))


def at(given, SA=SA, FZ=F0, *, bristles=BRISTLES, lines=5, **more):
    values = MODEL.values({**PLAIN, **given})
    return forces(values, make_rows(SA, FZ, FNOMIN=F0, **more), bristles=bristles, lines=lines)


def shape(u, N, SKEW):
    return (1 - abs(u) ** N) * (1 + SKEW * u)


def shaped(weight, N=2.0, SKEW=0.0):
    whole = quad(lambda u: shape(u, N, SKEW), -1, 1)[0]
    return quad(lambda u: weight(u, shape(u, N, SKEW) / whole), -1, 1)[0]


@pytest.mark.parametrize("load", [800.0, 4000.0, 9000.0])
@pytest.mark.parametrize("KAPPA", [0.0, 0.05, -0.1])
def test_a_rigid_carcass_and_a_parabola_are_the_plain_brush(load, KAPPA):
    rows = make_rows(SA, load, KAPPA=KAPPA, FNOMIN=F0)
    plain = brush.forces(brush.MODEL.values(PLAIN), rows)
    o = at({}, FZ=load, KAPPA=KAPPA)
    np.testing.assert_allclose(o.FX, plain.FX, atol=1e-4 * 0.95 * load)
    np.testing.assert_allclose(o.FY, plain.FY, atol=1e-4 * 0.95 * load)
    top = 27 / 256 * 0.95 * load * 0.07 * (load / F0) ** 0.6  # the largest moment of a brush
    np.testing.assert_allclose(o.MZ, plain.MZ, atol=2e-4 * top)


@pytest.mark.parametrize("N", [1.0, 2.0, 5.0, 12.0])
@pytest.mark.parametrize("SKEW", [-0.4, 0.0, 0.6])
def test_twice_the_bristles_change_less_than_is_stated(N, SKEW):
    given = {"N": N, "SKEW": SKEW, "YAW": 0.3, "BEND": 0.2, "MU_V": 0.05, "MU_P": 0.2}
    one, two = at(given), at(given, bristles=2 * BRISTLES)
    assert np.abs(one.FY - two.FY).max() < 1e-3 * np.abs(two.FY).max()
    assert np.abs(one.MZ - two.MZ).max() < 5e-3 * np.abs(two.MZ).max()


def test_the_grid_converges_faster_than_the_square_of_the_step():
    given = {"YAW": 0.3, "BEND": 0.2}
    best = at(given, bristles=1280)
    coarse, fine = (np.abs(at(given, bristles=n).FY - best.FY).max() for n in (20, 160))
    assert fine < coarse / 8**2 / 2


@pytest.mark.parametrize(("N", "SKEW"), [(2.0, 0.0), (4.0, 0.5), (8.0, -0.3)])
def test_where_all_slides_the_force_is_friction_times_load_at_the_centroid_of_pressure(N, SKEW):
    given = {"N": N, "SKEW": SKEW, "C": 100.0}
    o = at(given, SA=np.radians([60.0, -60.0]))
    np.testing.assert_allclose(o.FY, [-0.95 * F0, 0.95 * F0], rtol=1e-9)
    centroid = shaped(lambda u, q: u * q, N, SKEW)
    np.testing.assert_allclose(o.MZ, 0.07 * centroid * o.FY, rtol=2e-3, atol=1e-5 * 0.07 * F0)


def test_friction_falls_with_sliding_speed():
    V, MU_V = 20.0, 0.04
    angle = np.radians([40.0, 60.0, 80.0])
    o = at({"MU_V": MU_V, "C": 100.0}, SA=angle, V=V)
    np.testing.assert_allclose(-o.FY, 0.95 * F0 / (1 + MU_V * V * np.sin(angle)), rtol=1e-9)
    still = at({"MU_V": MU_V, "C": 100.0}, SA=angle, V=0.0)
    np.testing.assert_allclose(-still.FY, 0.95 * F0, rtol=1e-9)


def test_friction_falls_with_pressure():
    n = 0.25
    o = at({"MU_P": n, "C": 150.0}, SA=np.radians(70.0), FZ=[2000.0, 4000.0, 8000.0])
    mu = -o.FY / [2000.0, 4000.0, 8000.0]
    # A length that grows as FZ^0.6 leaves FZ^0.4 to the pressure.
    np.testing.assert_allclose(mu / mu[1], np.array([0.5, 1.0, 2.0]) ** (-0.4 * n), rtol=1e-9)
    # 2 q is the pressure over its mean; friction goes as its power.
    mean = shaped(lambda _, q: (2 * q) ** -n * q if q > 0 else 0.0)
    assert mu[1] == pytest.approx(0.95 * mean, rel=2e-3)


def test_a_carcass_that_yaws_is_a_rigid_one_at_the_slip_that_is_left():
    YAW, skewed = 0.4, {"SKEW": 0.3, "N": 3.0}
    inner = np.tan(SA)
    rigid = at(skewed)
    turned = YAW * 3 / (18.0 * F0 * 0.07) * rigid.MZ
    soft = at({**skewed, "YAW": YAW}, SA=np.arctan(inner + turned))
    np.testing.assert_allclose(soft.FY, rigid.FY, rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(soft.MZ, rigid.MZ, rtol=1e-7, atol=1e-6)


@pytest.mark.parametrize(("YAW", "BEND"), [(0.0, 0.0), (0.5, 0.0), (0.0, 0.8), (0.5, 0.8)])
def test_the_slope_at_zero_is_that_of_tread_and_carcass_in_series(YAW, BEND):
    h = 1e-5
    o = at({"YAW": YAW, "BEND": BEND}, SA=[-h, h], bristles=400)
    slope = -np.diff(o.FY)[0] / (2 * h)
    assert slope == pytest.approx(18.0 * F0 / (1 + YAW) / (1 + BEND), rel=1e-3)


def test_bending_makes_the_trail_longer_and_yaw_does_not():
    trail = {}
    for name, given in (("rigid", {}), ("yaw", {"YAW": 0.5}), ("bend", {"BEND": 0.5})):
        o = at(given, SA=np.radians(0.2))
        trail[name] = -o.MZ[0] / o.FY[0]
    assert trail["bend"] > 1.1 * trail["rigid"]
    assert trail["yaw"] == pytest.approx(trail["rigid"], rel=0.1)


def test_lateral_displacement_takes_the_longitudinal_force_aside():
    LAT = 0.02
    one, other = (at({"LAT": value}, SA=np.radians(3.0), KAPPA=0.05) for value in (0.0, LAT))
    aside = LAT * one.FY / F0
    np.testing.assert_allclose(other.MZ - one.MZ, -aside * one.FX, rtol=1e-9)


def test_camber_thrust_and_moment_of_a_tread_that_adheres():
    g, EPS, R, B = 0.002, 0.3, 0.32, 0.09
    o = at({"EPS": EPS, "B": B, "MU": 6.0}, SA=0.0, IA=g, UNLOADED_RADIUS=R, lines=40, bristles=160)
    curved = (1 - EPS) * np.sin(g) / R
    # The contact line bends by x^2/2 of that: FY = C FZ a curved/3 towards the lean; the right of the
    # tread rolls slower by y of it: MZ = C FZ curved B^2/3.
    assert o.FY[0] == pytest.approx(18.0 * F0 * 0.07 * curved / 3, rel=2e-3)
    assert o.MZ[0] == pytest.approx(18.0 * F0 * curved * B**2 / 3, rel=2e-3)
    assert o.FX[0] == pytest.approx(0.0, abs=1e-6 * F0)
    mirrored = at({"EPS": EPS, "B": B, "MU": 6.0}, SA=0.0, IA=-g, UNLOADED_RADIUS=R, lines=40, bristles=160)
    assert mirrored.FY[0] == pytest.approx(-o.FY[0], rel=1e-9)


def test_no_bristle_carries_more_than_friction_allows():
    rng = np.random.default_rng(7)
    for _ in range(10):
        given = {"C": rng.uniform(5, 60), "N": rng.uniform(1, 12), "SKEW": rng.uniform(-0.8, 0.8),
                 "YAW": rng.uniform(0, 1), "BEND": rng.uniform(0, 1)}  # fmt: skip
        o = at(given, KAPPA=rng.uniform(-0.3, 0.3), IA=rng.uniform(-0.1, 0.1))
        assert np.hypot(o.FX, o.FY).max() <= 0.95 * F0 * (1 + 1e-3)


def test_the_carcass_is_in_balance_at_every_state():
    # The stated balance, put in as data: the belt turned by MZ and bent by FY gives the same forces again.
    YAW, BEND = 0.8, 1.0
    o = at({"YAW": YAW, "BEND": BEND, "N": 4.0, "SKEW": 0.3})
    from toolkit.tires.bristles import Tread, across, middles, summed

    u = middles(BRISTLES)
    q = shape(u, 4.0, 0.3)
    q = q / summed(q)
    count = len(SA)
    ones, none = np.ones(count), np.zeros(count)
    tread = Tread(
        limit=0.95 * q[:, None] * ones, half_C=9.0 * ones, fade=none, yaw=none, bend=none,
        curve=none, cone=none, edge=ones,
    )  # fmt: skip
    slopes = np.stack([YAW * 3 / (18.0 * F0 * 0.07) * o.MZ, -BEND * 3 / (18.0 * F0) * o.FY])
    made = across(tread, np.tan(SA), slopes)
    np.testing.assert_allclose(made[1] * F0, o.FY, atol=1e3 * _TOLERANCE * 18 * F0)
    np.testing.assert_allclose(made[2] * F0 * 0.07, o.MZ, atol=1e3 * _TOLERANCE * 18 * F0)


FREE = ("C", "A", "N", "SKEW", "MU", "MU_V", "YAW", "BEND", "EPS", "SH", "SV", "LAT")


@pytest.mark.parametrize("IA", [0.0, 0.03])
@pytest.mark.parametrize("change", [1e-6, 1e-4, 1.0])
def test_copies_that_are_asked_together_give_what_each_gives_alone(IA, change):
    # Near copies start from the balance of the first; it must not show in what they come to.
    base = MODEL.values({**PLAIN, "N": 4.0, "YAW": 0.4, "BEND": 0.3, "MU_V": 0.03, "LAT": 0.01})
    copies = np.repeat(base[None], len(FREE) + 2, axis=0)
    for row, name in enumerate(FREE, start=1):
        place = MODEL.names.index(name)
        copies[row, place] += change * MODEL.parameters[place].size
    rows = make_rows(SA, np.linspace(1500.0, 6000.0, len(SA)), IA=IA, FNOMIN=F0)
    together = forces([column[:, None] for column in copies.T], rows)
    assert together.FY.shape == (len(copies), len(SA))
    for row, values in enumerate(copies):
        alone = forces(values.tolist(), rows)
        for channel, size in (("FX", F0), ("FY", F0), ("MZ", 0.07 * F0)):
            np.testing.assert_allclose(together[channel][row], alone[channel], atol=2e-9 * size)


def test_lines_left_of_the_middle_are_the_image_of_those_right_of_it():
    # A slip along of 1e-30 is none, yet every line is then followed by itself.
    given = {"B": 0.09, "YAW": 0.3, "BEND": 0.2, "MU_V": 0.05, "SKEW": 0.3}
    for lines in (1, 4, 5):
        half, every = (at(given, IA=0.05, KAPPA=k, lines=lines) for k in (0.0, 1e-30))
        np.testing.assert_allclose(half.FX, every.FX, atol=1e-9 * F0)
        np.testing.assert_allclose(half.FY, every.FY, atol=1e-9 * F0)
        np.testing.assert_allclose(half.MZ, every.MZ, atol=1e-9 * 0.07 * F0)


def test_a_sharpened_balance_answers_with_the_derivative_of_its_forces():
    from toolkit.tires.bristles import Tread, balance, middles, sharpened, summed

    q = shape(middles(BRISTLES), 4.0, 0.3)
    ones = np.ones(len(SA))
    tread = Tread(
        limit=0.95 * (q / summed(q))[:, None] * ones, half_C=9.0 * ones, fade=0.2 * ones, yaw=0.02 * ones,
        bend=0.03 * ones, curve=0.0 * ones, cone=0.0 * ones, edge=ones,
    )  # fmt: skip
    sx, sy = 0.0 * ones, np.tan(SA)
    found = sharpened(tread, sx, sy, balance(tread, sx, sy))
    # Out of balance by slopes of the contact line that are put in from outside, the answer is theirs.
    h = 1e-5
    moved = [balance(tread, sx, sy + side * h) for side in (-1, 1)]
    direct = (moved[1].slopes - moved[0].slopes) / (2 * h)
    # d slopes/d sy = inverse F_sy, and slipping by sy is turning by -yaw: F_sy = -(1 - inverse^-1).
    inverse = np.moveaxis(found.inverse, 2, 0)
    expected = -(inverse @ (np.eye(2) - np.linalg.inv(inverse)))[:, :, 0].T
    smooth = np.abs(np.degrees(SA)) < 3.0
    np.testing.assert_allclose(direct[:, smooth], expected[:, smooth], atol=2e-3)
