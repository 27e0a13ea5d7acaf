"""Force-like terms of an equation of motion: direction, symmetry, energy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from toolkit.effects.catalogue import effect

PLACES = [(x, v) for x in (-0.7, 0.0, 0.4) for v in (-2.0, -0.1, 0.0, 0.1, 2.0)]


def force(name, x, v, **values):
    return effect(name).term.force(x, v, values)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("coulomb_friction", {"coulomb": 3.0}),
        ("viscous_damping", {"viscous": 2.0}),
        ("quadratic_drag", {"drag": 0.5}),
    ],
)
def test_friction_is_odd_in_the_velocity_and_never_gives_energy(name, values):
    for x, v in PLACES:
        assert force(name, x, v, **values) == pytest.approx(-force(name, x, -v, **values), abs=1e-12)
        # taken from m a: the power that it takes, force times velocity, is not negative
        assert force(name, x, v, **values) * v >= 0


def test_sizes_by_their_equations():
    assert force("coulomb_friction", 0.0, 2.0, coulomb=3.0) == pytest.approx(3.0)
    assert force("coulomb_friction", 0.0, 20.0, coulomb=3.0) == pytest.approx(3.0)
    assert force("viscous_damping", 0.0, -2.0, viscous=1.5) == pytest.approx(-3.0)
    assert force("quadratic_drag", 0.0, -2.0, drag=1.5) == pytest.approx(-6.0)
    assert force("cubic_stiffness", -0.5, 1.0, k3=8.0) == pytest.approx(-1.0)
    assert abs(force("constant_force", 0.1, 0.2, force=4.0)) == pytest.approx(4.0)


def test_ripple_repeats_with_the_position_and_does_no_net_work():
    values = {"amplitude": 2.0, "period": 0.3, "phase": 25.0}
    for x, v in PLACES:
        assert force("periodic_ripple", x + 0.3, v, **values) == pytest.approx(
            force("periodic_ripple", x, -v, **values), abs=1e-9
        )
    work = sum(force("periodic_ripple", 0.3 * i / 360, 1.0, **values) for i in range(360))
    assert work == pytest.approx(0, abs=1e-9)
    largest = max(abs(force("periodic_ripple", 0.3 * i / 3600, 1.0, **values)) for i in range(3600))
    assert largest == pytest.approx(2.0, rel=1e-5)


def test_stiffness_conserves_energy():
    # k3 x^3 is the slope of k3 x^4 / 4, whatever the velocity
    step = 1e-5
    for x, v in PLACES:
        slope = 8.0 / 4 * ((x + step) ** 4 - (x - step) ** 4) / (2 * step)
        assert force("cubic_stiffness", x, v, k3=8.0) == pytest.approx(slope, abs=1e-7)


def test_overflow_is_no_force_and_stops_what_rises_at_the_level():
    term = effect("overflow").term
    assert term.force is None
    assert term.limit(0.05, 1.0, {"level": 0.1}) == 1.0
    assert term.limit(0.1 - 0.25e-3, 1.0, {"level": 0.1}) == pytest.approx(0.25)
    assert all(term.limit(level, 1.0, {"level": 0.1}) == 0.0 for level in (0.1, 3.0))
    assert math.isinf(effect("overflow").parameters[0].off)


def test_recorded_dry_friction_turns_over_one_row_about_the_reversal():
    # v falls through zero at 0.53 of a row after row 5; a row shows the mean of sign(v) over its interval
    t = 0.04 * np.arange(12)
    v = 0.2 - t * 0.2 / (5.53 * 0.04)
    made = effect("coulomb_friction").term.recorded(t, v, {"coulomb": 3.0, "presliding": 0.0})
    assert made[:6] == pytest.approx(np.full(6, 3.0))
    assert made[6] == pytest.approx(
        3.0 * (0.03 - 0.97)
    )  # 5.5 to 5.53 before the reversal, the rest behind it
    assert made[7:] == pytest.approx(np.full(5, -3.0))


def test_recorded_dry_friction_follows_the_bristle_equation():
    # z' = (v - |v| z)/presliding in ten thousand small steps, and its means over one interval of rows
    t, reach, finer = 0.02 * np.arange(150), 0.004, 400
    v = 0.05 * np.interp(t, t, np.sin(7.0 * t + 1.0) + 0.4 * np.sin(17.0 * t))
    fine = np.linspace(t[0], t[-1], (len(t) - 1) * finer + 1)
    speed = np.interp(0.5 * (fine[1:] + fine[:-1]), t, v)
    z = [float(np.sign(v[0]))]
    for one in speed:
        way = math.copysign(1.0, one)
        z.append(way + (z[-1] - way) * math.exp(-abs(one) * (fine[1] - fine[0]) / reach))
    area = np.concatenate([[0.0], np.cumsum(0.5 * (np.array(z)[1:] + np.array(z)[:-1]))]) * (
        fine[1] - fine[0]
    )
    inner = slice(1, -1)
    means = (np.interp(t[inner] + 0.01, fine, area) - np.interp(t[inner] - 0.01, fine, area)) / 0.02
    made = effect("coulomb_friction").term.recorded(t, v, {"coulomb": 2.0, "presliding": reach})
    # a piece is a quarter of a row: its speed is taken as even
    assert made[inner] == pytest.approx(2.0 * means, abs=0.02)
