"""LuGre: closed forms for uniform and trapezoidal pressure, and the limits of its friction law."""

import numpy as np
import pytest
from scipy.integrate import quad

from toolkit.tires.global_model import make_rows
from toolkit.tires.models.lugre import MODEL, centroid, filled

F0 = 4000.0
GIVEN = {"C": 18.0, "MU": 0.95, "L": 0.14}


def at(SA, FZ=F0, given=None, **more):
    return MODEL.forces(MODEL.values({**GIVEN, **(given or {})}), make_rows(SA, FZ, FNOMIN=F0, **more))


@pytest.mark.parametrize("K", [1e-6, 0.3, 2.0, 8.0, 20.0])
def test_a_uniform_pressure_has_its_closed_form(K):
    whole, moment = filled(K, 0.0, 0.0)
    # int 1 - e^-Kt = 1 - (1 - e^-K)/K; int (1 - e^-Kt)(1/2 - t), by parts.
    fill = 1 + np.expm1(-K) / K
    if K > 0.1:
        lever = -(0.5 * -np.expm1(-K) / K - (1 - (1 + K) * np.exp(-K)) / K**2)
    else:
        lever, fill = K * (1 / 4 - 1 / 3), K / 2
    assert whole == pytest.approx(fill, rel=1e-6)
    assert moment == pytest.approx(lever, rel=1e-5)


@pytest.mark.parametrize(("front", "rear"), [(0.2, 0.3), (0.5, 0.5), (0.05, 0.6), (0.9, 0.1)])
@pytest.mark.parametrize(("K", "within"), [(0.1, 1e-10), (3.0, 1e-10), (10.0, 1e-10), (40.0, 1e-5)])
def test_a_trapezoid_agrees_with_adaptive_quadrature(front, rear, K, within):
    p = lambda t: min(1.0, t / front, (1 - t) / rear) / (1 - (front + rear) / 2)  # noqa: E731
    points = [front, 1 - rear]
    whole = quad(lambda t: p(t) * (1 - np.exp(-K * t)), 0, 1, points=points, epsabs=1e-13)[0]
    moment = quad(lambda t: p(t) * (1 - np.exp(-K * t)) * (0.5 - t), 0, 1, points=points, epsabs=1e-13)[0]
    found = filled(K, front, rear)
    assert found[0] == pytest.approx(whole, rel=within)
    assert found[1] == pytest.approx(moment, abs=within)
    assert centroid(front, rear) == pytest.approx(quad(lambda t: p(t) * t, 0, 1, points=points)[0])


@pytest.mark.parametrize("TOP", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("FRONT", [0.1, 0.5, 0.8])
def test_the_slope_at_zero_is_C_whatever_the_pressure(TOP, FRONT):
    h = 1e-7
    for load in (1000.0, 4000.0):
        o = at([-h, h], load, {"TOP": TOP, "FRONT": FRONT, "C_Z": -0.3})
        C = 18.0 * np.exp(-0.3 * (load / F0 - 1))
        assert -np.diff(o.FY)[0] / (2 * h) == pytest.approx(C * load, rel=1e-5)


def test_the_trail_of_a_uniform_pressure_is_a_sixth_of_the_length():
    o = at(1e-6, given={"TOP": 1.0})
    assert -o.MZ[0] / o.FY[0] == pytest.approx(0.14 / 6, rel=1e-4)


def test_stiff_bristles_leave_coulomb_friction_at_the_centroid():
    given = {"C": 200.0, "TOP": 0.2, "FRONT": 0.3}
    o = at(np.radians([-70.0, 70.0]), given=given)
    np.testing.assert_allclose(o.FY, [0.95 * F0, -0.95 * F0], rtol=1e-5)
    front, rear = 0.8 * 0.3, 0.8 * 0.7
    behind = centroid(front, rear) - 0.5
    np.testing.assert_allclose(o.MZ, -behind * 0.14 * o.FY, rtol=1e-3)


def test_friction_falls_from_static_to_coulomb_by_the_stribeck_law():
    R, VS, V = 0.6, 4.0, 20.0
    angle = np.arcsin([VS / V, 0.8])
    o = at(angle, given={"C": 200.0, "R": R, "VS": VS}, V=V)
    g = 0.95 * (R + (1 - R) * np.exp(-np.sqrt(V * np.sin(angle) / VS)))
    assert g[0] == pytest.approx(0.95 * (0.6 + 0.4 / np.e))
    np.testing.assert_allclose(-o.FY / F0, g, rtol=2e-3)


def test_viscous_friction_adds_in_proportion_to_the_sliding_speed():
    one, other = (at(np.radians(8.0), given={"S2": value}, V=20.0) for value in (0.0, 0.01))
    np.testing.assert_allclose(one.FY - other.FY, F0 * 0.01 * 20.0 * np.sin(np.radians(8.0)), rtol=1e-12)


def test_equal_slips_give_equal_forces_in_every_direction():
    angle = np.linspace(0, 2 * np.pi, 9)[:-1]
    sx, sy = 0.06 * np.cos(angle), 0.06 * np.sin(angle)
    o = at(np.arctan(sy / (1 - sx)), KAPPA=sx / (1 - sx))
    np.testing.assert_allclose(np.hypot(o.FX, o.FY), -at(np.arctan(0.06)).FY[0], rtol=1e-12)
    np.testing.assert_allclose(o.FX * sy + o.FY * sx, 0.0, atol=1e-9)
