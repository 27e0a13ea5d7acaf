"""The state of a tire beyond a quarter turn of its slip angle."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tires.test_tir_checks import tire
from toolkit.tires.slip import ANGLES, Angles
from toolkit.tires.tir_evaluate import evaluate_tir


def forces(SA_deg: object, *, V: object = 16.0, angles: Angles = "star", KAPPA: float = 0.0):
    return evaluate_tir(tire(), SA=np.radians(SA_deg), FZ=4000.0, V=V, KAPPA=KAPPA, angles=angles)[0]


@pytest.mark.parametrize("angles", ANGLES)
def test_the_force_goes_on_through_a_quarter_turn_against_the_sliding(angles):
    # Vy = -V sin(alpha) has one sign from 0 to 180 deg, and so has the force that resists it.
    FY = forces([60, 85, 89.9, 89.9999, 90.0001, 90.1, 95, 120], angles=angles).FY
    assert (FY < -1000).all()
    assert FY[4] == pytest.approx(FY[3], rel=1e-6)
    assert FY == pytest.approx(FY[::-1], rel=1e-9)  # the tire has no built-in side


@pytest.mark.parametrize("angles", ANGLES)
@pytest.mark.parametrize("SA", [-170.0, -100.0, 91.0, 130.0, 177.0])
def test_half_a_turn_more_is_the_same_tire_rolling_the_other_way(angles, SA):
    # (Vx, Vy) = V (cos(alpha), -sin(alpha)): alpha and V, or alpha +- 180 deg and -V, are one motion.
    there, back = forces(SA, angles=angles), forces(SA - np.copysign(180.0, SA), V=-16.0, angles=angles)
    for channel in ("FX", "FY", "MZ"):
        assert getattr(there, channel) == pytest.approx(getattr(back, channel), rel=1e-9, abs=1e-9)


def test_within_a_quarter_turn_the_sign_is_that_of_the_speed():
    ahead, back = forces(5.0), forces(5.0, V=-16.0)
    assert ahead.FY == pytest.approx(-back.FY)
