"""The formula against its limits, numeric derivatives and symmetries."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from toolkit.tires.models.magic_formula import MODEL, jacobian, slope, slope_jacobian, value

SHAPES = st.tuples(
    st.floats(2.0, 40.0),
    st.floats(0.2, 3.5),
    st.floats(-9e3, 9e3).filter(lambda D: abs(D) > 1.0),
    st.floats(-15.0, 1.0),
    st.floats(-0.05, 0.05),
    st.floats(-500.0, 500.0),
)


def test_slope_is_BCD_where_the_shifted_angle_is_zero():
    B, C, D, E, Sh, Sv = 11.0, 1.4, -5200.0, -3.0, 0.01, 40.0
    assert slope((B, C, D, E, Sh, Sv), -Sh) == pytest.approx(B * C * D, rel=1e-14)
    assert value((B, C, D, E, Sh, Sv), -Sh) == pytest.approx(Sv, abs=1e-12)


def test_peak_is_D_and_asymptote_is_D_sin_C_half_pi():
    B, C, D, E = 12.0, 1.3, -4000.0, -0.5
    SA = np.linspace(0, 1.5, 200_001)
    assert np.abs(value((B, C, D, E, 0, 0), SA)).max() == pytest.approx(4000.0, rel=1e-9)
    assert value((B, C, D, E, 0, 0), 1e9) == pytest.approx(D * np.sin(C * np.pi / 2), rel=1e-6)


def test_curvature_factor_one_levels_off_at_the_angle_of_arctan_of_arctan():
    # E = 1: the argument of the outer arctangent tends to pi/2 (Pacejka 2012, 4.3.1).
    B, C, D = 20.0, 1.2, 100.0
    limit = D * np.sin(C * np.arctan(np.pi / 2))
    assert value((B, C, D, 1.0, 0, 0), 1e9) == pytest.approx(limit, rel=1e-6)


@given(SHAPES, st.floats(-0.25, 0.25))
@settings(max_examples=60, deadline=None)
def test_derivatives_agree_with_differences(shape, SA):
    step = 1e-6
    rise = (value(shape, SA + step) - value(shape, SA - step)) / (2 * step)
    scale = abs(shape[0] * shape[1] * shape[2])
    assert slope(shape, SA) == pytest.approx(rise, abs=1e-6 * scale)
    for derivative, function in ((jacobian, value), (slope_jacobian, slope)):
        exact = derivative(shape, SA)
        for i, p in enumerate(shape):
            h = 1e-6 * max(abs(p), 1e-2)
            up, down = (tuple(p + s * h if j == i else q for j, q in enumerate(shape)) for s in (1, -1))
            numeric = (function(up, SA) - function(down, SA)) / (2 * h)
            size = abs(function(shape, SA)) + scale
            assert exact[i] == pytest.approx(numeric, abs=2e-6 * size / max(abs(p), 1e-2))


@given(SHAPES, st.floats(-0.25, 0.25))
@settings(max_examples=40, deadline=None)
def test_mirrored_tire_mirrors_the_curve(shape, SA):
    B, C, D, E, Sh, Sv = shape
    assert value((B, C, D, E, -Sh, -Sv), -SA) == pytest.approx(-value(shape, SA), rel=1e-12, abs=1e-9)


def test_vector_equals_scalar():
    shape = (10.0, 1.5, -3000.0, 0.2, 0.002, 15.0)
    SA = np.linspace(-0.2, 0.2, 17)
    for function in (value, slope):
        assert np.array_equal(function(shape, SA), [float(function(shape, one)) for one in SA])
    assert jacobian(shape, SA).shape == slope_jacobian(shape, SA).shape == (6, 17)


def test_every_parameter_has_unit_bounds_and_text():
    assert [spec.name for spec in MODEL.parameters] == ["B", "C", "D", "E", "Sh", "Sv"]
    assert [spec.unit_of("MZ") for spec in MODEL.parameters] == ["1/rad", "1", "N*m", "1", "rad", "N*m"]
    assert all(spec.bounds and spec.text for spec in MODEL.parameters)
