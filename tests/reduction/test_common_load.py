"""Common load: exact on parabolas, and uncertain by what the neighbours leave open."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.reduction.common_load import Slope, carry, slopes

loads = st.lists(st.integers(1, 100), min_size=3, max_size=6, unique=True)


@given(loads, st.floats(-3, 3), st.floats(-2, 2), st.floats(-1, 1), st.randoms())
def test_a_parabola_has_its_own_slope(steps: list[int], a: float, b: float, c: float, random: object) -> None:
    random.shuffle(steps)  # type: ignore[attr-defined]
    FZ = np.array(steps, dtype=float)
    found = slopes(FZ, a + b * FZ + c * FZ**2)
    np.testing.assert_allclose([s.value for s in found if s], b + 2 * c * FZ, atol=1e-9)


def test_a_line_is_certain() -> None:
    found = slopes(np.array([1.0, 2.0, 5.0]), np.array([3.0, 5.0, 11.0]))
    assert [s.u for s in found if s] == pytest.approx([0, 0, 0], abs=1e-12)


def test_one_load_cannot_be_carried() -> None:
    assert slopes(np.array([1000.0]), np.array([5.0])) == (None,)
    assert carry(5.0, 0.1, slope=None, delta_FZ=10.0) == (5.0, 0.1)


def test_doubled_load_cannot_be_carried() -> None:
    assert slopes(np.array([1000.0, 1000.0, 2000.0]), np.array([5.0, 5.1, 7.0])) == (None, None, None)


def test_two_loads() -> None:
    one, other = slopes(np.array([1000.0, 2000.0]), np.array([5.0, 7.0]))
    assert one == other == Slope(value=0.002, u=0.001)


def test_carry() -> None:
    value, u = carry(100.0, 3.0, slope=Slope(value=0.5, u=0.04), delta_FZ=-100.0)
    assert value == 50.0
    assert u == pytest.approx(5.0)


@given(st.lists(st.integers(1, 100), min_size=5, max_size=5, unique=True), st.floats(-1, 1))
def test_five_loads_give_a_cubic_its_own_slope(steps: list[int], c: float) -> None:
    FZ = np.array(steps, dtype=float)
    found = slopes(FZ, c * FZ**3)
    np.testing.assert_allclose([s.value for s in found if s], 3 * c * FZ**2, atol=1e-6, rtol=1e-6)
    np.testing.assert_allclose([s.u for s in found if s], 0.0, atol=1e-6)


def test_the_uncertainty_of_a_slope_is_a_rectangle_of_what_the_next_order_changes() -> None:
    """A quartic on five even loads: at an end the cubic is wrong by the product of the four gaps, 4! = 24."""
    FZ = np.arange(5.0)
    found = slopes(FZ, FZ**4)
    assert found[0] is not None
    assert found[0].u == pytest.approx(abs(found[0].value - 0.0) / np.sqrt(3))
    # (x - 1)(x - 2)(x - 3) at x = 0: the term that the quartic adds to the cubic's slope there.
    assert found[0].value == pytest.approx(6.0)
