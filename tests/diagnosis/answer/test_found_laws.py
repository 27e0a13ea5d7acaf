"""A law's parameters as an answer tells them: an interval holds nothing that cannot be."""

import math

import pytest

from toolkit.diagnosis.answer.found_laws import _interval


def test_the_interval_of_a_time_constant_is_one_of_its_logarithm():
    """1600 s with 2400 s to each side would be -800 to 4000 s: relative errors of 1.5 on a logarithm."""
    low, high = _interval(1600.0, 2400.0, positive=True)
    assert 0 < low < 1600 < high
    assert low * high == pytest.approx(1600.0**2)
    assert math.log(high / low) == pytest.approx(2 * 2400 / 1600)


def test_a_narrow_interval_is_the_same_on_either_scale():
    assert _interval(100.0, 0.1, positive=True) == pytest.approx(
        _interval(100.0, 0.1, positive=False), abs=1e-3
    )


@pytest.mark.parametrize(("value", "half"), [(1.0, 20.0), (0.0, 1.0), (1.0, math.inf), (1.0, math.nan)])
def test_what_the_data_leave_open_has_no_interval(value, half):
    assert _interval(value, half, positive=True) is None


def test_an_amplitude_may_have_either_sign():
    assert _interval(1.0, 3.0, positive=False) == (-2.0, 4.0)
