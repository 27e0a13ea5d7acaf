"""An equation that gives no number says at which time and state."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.diagnosis.simulators.integrate import IntegrationError, integrate

T = np.linspace(0.0, 2.0, 21)
ATOL = np.array([1e-7])


def test_rates_that_are_no_number_are_told_with_time_and_state():
    def rate(_t, x):
        return np.array([-1.0]) if x[0] > 0.5 else np.array([np.nan])

    with pytest.raises(IntegrationError, match=r"rhs gives nan for state 1 at t = 0\.\d+ s, x = \[0\.\d+\]"):
        integrate(rate, T, np.array([1.0]), ATOL)


def test_the_first_rates_are_asked_as_well():
    def rate(_t, x):
        return np.full(1, np.inf)

    with pytest.raises(IntegrationError, match=r"rhs gives inf for state 1 at t = 0 s, x = \[1\]"):
        integrate(rate, T, np.array([1.0]), ATOL)
