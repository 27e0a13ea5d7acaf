"""Integration from row to row against closed solutions; what cannot go on says so."""

import numpy as np
import pytest

from toolkit.diagnosis.simulators.integrate import IntegrationError, integrate

TIGHT = 1e-9


def test_an_oscillator_follows_its_closed_solution():
    t = np.linspace(0, 20, 201)
    made = integrate(lambda _, x: np.array([x[1], -9 * x[0]]), t, np.array([1.0, 0.0]), np.full(2, TIGHT))
    # A global error is the local tolerance times the number of steps.
    np.testing.assert_allclose(made[0], np.cos(3 * t), atol=2e-5)
    energy = made[1] ** 2 + 9 * made[0] ** 2
    np.testing.assert_allclose(energy, 9.0, rtol=2e-5)


def test_a_stiff_equation_is_handed_on_and_still_right():
    t = np.linspace(0, 5, 51)
    rate = 1e5
    made = integrate(
        lambda at, x: np.array([-rate * (x[0] - np.cos(at))]), t, np.array([0.0]), np.full(1, TIGHT)
    )
    exact = (rate**2 * np.cos(t) + rate * np.sin(t)) / (rate**2 + 1)
    np.testing.assert_allclose(made[0, 5:], exact[5:], atol=1e-4)


@pytest.mark.parametrize("short", [1e-5, 1e-7, 1e-9])
def test_where_one_row_is_stiff_the_next_are_not_tried_one_by_one(short):
    """A lag far shorter than a row follows its input, whose corners stand on the rows."""
    t, asked = np.linspace(0, 5, 501), []
    wave = np.interp(t, [0, 1, 3, 5], [0.0, 1.0, -1.0, 1.0])

    def rate(at, x):
        asked.append(at)
        return np.array([(np.interp(at, t, wave) - x[0]) / short])

    made = integrate(rate, t, np.array([0.0]), np.full(1, 1e-7))
    np.testing.assert_allclose(made[0, 1:], (wave - short * np.gradient(wave, t))[1:], atol=short + 1e-5)
    assert len(asked) < 60 * len(t)  # row by row it was 450 of each


def test_a_ramp_input_is_integrated_to_its_kink():
    t = np.array([0.0, 1.0, 2.0])
    made = integrate(lambda at, _: np.array([1 - abs(at - 1)]), t, np.array([0.0]), np.full(1, TIGHT))
    np.testing.assert_allclose(made[0], [0.0, 0.5, 1.0], atol=1e-9)


def test_what_runs_off_ends_with_an_error():
    with pytest.raises(IntegrationError):
        integrate(
            lambda _, x: np.array([min(x[0], 1e150) ** 2]),
            np.linspace(0, 3, 31),
            np.array([1.0]),
            np.full(1, TIGHT),
        )
