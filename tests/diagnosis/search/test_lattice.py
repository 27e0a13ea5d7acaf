"""The step of a coarse channel is known to the digits that a file prints, and no better."""

import numpy as np
import pytest

from toolkit.diagnosis.search.lattice import lattice_of


def printed(values, form):
    return np.array([float(form % one) for one in values])


@pytest.mark.parametrize("form", ["%.2f", "%.4f", "%.10g"])
def test_the_true_step_lies_within_the_interval(form):
    rng = np.random.default_rng(7)
    for _ in range(50):
        step, start = rng.uniform(20, 30), rng.uniform(-300, 300)
        found = lattice_of(printed(start + step * rng.integers(0, 40, 200), form), 1.0)
        assert found is not None
        # plus what a double itself cannot hold
        assert abs(found.step - step) <= found.half_width + 1e-15 * 1500


def test_it_is_no_wider_than_half_a_place_at_each_end():
    # steps of 100 printed as whole numbers from 0 to 5000: one place over fifty steps
    values = 100.0 * np.random.default_rng(1).permutation(np.arange(51))
    found = lattice_of(values, 1.0)
    assert found is not None
    assert found.step == pytest.approx(100.0, abs=1e-12)
    assert found.half_width == pytest.approx(1 / 50)


def test_negative_values_and_zero_have_a_step_too():
    found = lattice_of(printed(0.25 * np.arange(-39, 40), "%.2f"), 0.01)
    assert found is not None
    assert found.step == pytest.approx(0.25)
    assert 0 < found.half_width <= 0.01 / 78 * (1 + 1e-9)


def test_four_plateaus_have_a_common_step_by_chance():
    rng = np.random.default_rng(5)
    for _ in range(400):
        plateaus = printed(rng.uniform(0, 10, 4), "%.1f")
        assert lattice_of(np.repeat(plateaus, 10), 0.01) is None


def test_steps_of_five_last_places_are_steps():
    # A converter of 0.5 whose file drops trailing zeros: 24.5, 25, 25.5
    values = 0.5 * np.random.default_rng(6).integers(40, 60, 200)
    found = lattice_of(values, 0.15)
    assert found is not None
    assert found.step == 0.5
