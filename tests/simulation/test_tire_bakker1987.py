import math

import numpy as np
import pytest

from toolkit.simulation.tire import ALIGNING, LATERAL, aligning_moment, lateral_force

# Load [kN], cornering stiffness [N/deg], aligning stiffness [N·m/deg] of the published coefficients, as
# worked out beside the data set apart from this code (data set bakker1987_mf_coeffs, PROVENANCE.txt).
PUBLISHED = [(1.11, 433, 4.7), (2.52, 830, 14.2), (3.70, 1003, 23.7), (4.90, 1070, 33.8), (6.10, 1075, 43.9)]


@pytest.mark.parametrize(("kN", "CF", "CM"), PUBLISHED)
def test_published_stiffness(kN, CF, CM):
    small = math.radians(1e-4)
    assert float(lateral_force(slip_angle=small, load=kN * 1e3)) / 1e-4 == pytest.approx(CF, rel=1e-3)
    assert float(aligning_moment(slip_angle=small, load=kN * 1e3)) / 1e-4 == pytest.approx(-CM, rel=5e-3)


def test_peak_is_D():
    # D = a1 Fz^2 + a2 Fz at 4 kN: -22.1 x 16 + 1011 x 4 = 3690.4 N
    angles = np.radians(np.linspace(0, 40, 4001))
    assert np.max(lateral_force(slip_angle=angles, load=4000.0)) == pytest.approx(3690.4, rel=1e-4)


def test_one_point_written_out():
    # The paper's formula in its own units, straightforwardly, at 3 kN and 5 deg.
    x, F = 5.0, 3.0
    a, C = LATERAL.a, LATERAL.C
    D = a[0] * F**2 + a[1] * F
    B = a[2] * math.sin(a[3] * math.atan(a[4] * F)) / (C * D)
    E = a[5] * F**2 + a[6] * F + a[7]
    y = D * math.sin(C * math.atan(B * ((1 - E) * x + E / B * math.atan(B * x))))
    assert float(lateral_force(slip_angle=math.radians(x), load=3000.0)) == pytest.approx(y, rel=1e-12)
    assert ALIGNING.C == 2.40


def test_odd_in_slip_and_camber_together():
    angle, camber = np.radians(np.linspace(-8, 8, 33)), math.radians(1.5)
    for kernel in (lateral_force, aligning_moment):
        plus = kernel(slip_angle=angle, load=4000.0, camber=camber)
        minus = kernel(slip_angle=-angle, load=4000.0, camber=-camber)
        np.testing.assert_allclose(plus, -minus, rtol=1e-12, atol=1e-9)


def test_no_load_no_force_and_vector_equals_scalar():
    loads = np.array([-100.0, 0.0, 2000.0])
    for kernel in (lateral_force, aligning_moment):
        found = kernel(slip_angle=0.05, load=loads)
        assert found[:2].tolist() == [0.0, 0.0]
        assert found[2] == kernel(slip_angle=0.05, load=2000.0)
