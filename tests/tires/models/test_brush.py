"""The brush: its limits, and the sums over bristles that its formulas stand for."""

import numpy as np
import pytest

from toolkit.tires.global_model import make_rows
from toolkit.tires.models.brush import MODEL

F0 = 4000.0
GIVEN = {"C": 18.0, "C_Z": -0.4, "MU": 0.95, "MU_Z": -0.1, "A": 0.07, "A_P": 0.6}
VALUES = MODEL.values(GIVEN)


def at(SA, FZ=F0, **more):
    return MODEL.forces(VALUES, make_rows(SA, FZ, FNOMIN=F0, **more))


def followed(SA, FZ, *, points=200_001):
    """Bristles one by one: adhesion up to the parabola's friction, then friction (Pacejka 3.2)."""
    dfz = FZ / F0 - 1
    a = 0.07 * (FZ / F0) ** 0.6
    cp = 18.0 * np.exp(-0.4 * dfz) * FZ / (2 * a * a)
    mu = 0.95 * np.exp(-0.1 * dfz)
    x = np.linspace(a, -a, points)
    q = 0.75 * FZ / a * (1 - (x / a) ** 2)
    shear = np.minimum(cp * np.tan(abs(SA)) * (a - x), mu * q) * -np.sign(SA)
    return np.trapezoid(shear, -x), np.trapezoid(shear * x, -x)


@pytest.mark.parametrize("load", [1000.0, 4000.0, 9000.0])
@pytest.mark.parametrize("degrees", [-9.0, -0.2, 1.0, 4.0, 8.0, 14.0])
def test_forces_are_the_sums_over_the_bristles(load, degrees):
    FY, MZ = followed(np.radians(degrees), load)
    o = at(np.radians(degrees), load)
    assert o.FY[0] == pytest.approx(FY, rel=1e-7)
    assert o.MZ[0] == pytest.approx(MZ, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("load", [500.0, 4000.0, 8000.0])
def test_slopes_at_zero_are_the_stiffnesses_and_the_trail_a_third_of_a(load):
    h = 1e-8
    o = at([-h, h], load)
    CF = -np.diff(o.FY)[0] / (2 * h)
    assert CF == pytest.approx(18.0 * np.exp(-0.4 * (load / F0 - 1)) * load, rel=1e-6)
    assert np.diff(o.MZ)[0] / (2 * h) / CF == pytest.approx(0.07 * (load / F0) ** 0.6 / 3, rel=1e-6)


def test_all_slides_from_the_angle_where_theta_sigma_is_one():
    limit = np.arctan(3 * 0.95 / 18.0)
    o = at([0.999 * limit, limit, 1.5 * limit])
    np.testing.assert_allclose(-o.FY[1:], 0.95 * F0, rtol=1e-13)
    np.testing.assert_allclose(o.MZ[1:], 0.0, atol=1e-12)
    assert -o.FY[0] < 0.95 * F0
    assert o.MZ[0] > 0


def test_equal_slips_give_equal_forces_in_every_direction_and_against_the_slip():
    angle = np.linspace(0, 2 * np.pi, 13)[:-1]
    for size in (0.02, 0.08, 0.3):
        sx, sy = size * np.cos(angle), size * np.sin(angle)
        KAPPA = sx / (1 - sx)
        o = at(np.arctan(sy * (1 + KAPPA)), KAPPA=KAPPA)
        pure = at(np.arctan(size)).FY[0]
        np.testing.assert_allclose(np.hypot(o.FX, o.FY), -pure, rtol=1e-12)
        np.testing.assert_allclose(o.FX * sy + o.FY * sx, 0.0, atol=1e-9)
        assert np.all(
            o.FX * sx - o.FY * sy > 0
        )  # drive forwards, and the ground pushes against the side slip


def test_lateral_force_grows_to_the_end_and_the_trail_falls():
    SA = np.radians(np.linspace(0.1, 9.0, 60))
    o = at(SA)
    assert np.all(np.diff(-o.FY) > 0)
    assert np.all(np.diff(-o.MZ / o.FY) < 0)
