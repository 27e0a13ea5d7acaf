"""Many simulations at a time: the same as one by one, or not done together at all."""

import math

import numpy as np
import pytest

from toolkit.diagnosis.simulators.batch_integration import (
    NotTogetherError,
    columns_of,
    integrate_together,
    takes_columns,
)

T = np.linspace(0.0, 10.0, 201)
SETS = [{"k": 1.0}, {"k": 4.0}, {"k": 9.0}]


def swinging(t, x, u, p):
    return np.array([x[1], -p["k"] * x[0]])


def test_every_column_swings_at_its_own_frequency():
    p = columns_of(SETS)
    starts = np.array([[1.0, 1.0, 2.0], [0.0, 0.0, 0.0]])
    made = integrate_together(lambda t, x: swinging(t, x, {}, p), T, starts, np.full(2, 1e-8))
    # x = x0 cos(sqrt(k) t)
    exact = starts[0] * np.cos(np.sqrt([1.0, 4.0, 9.0]) * T[:, None])
    np.testing.assert_allclose(made[:, 0], exact, atol=2e-4)


def test_a_column_that_runs_off_stands_in_the_way_of_all():
    # x' = x^2 from 1 has no value at t = 1
    starts = np.array([[1.0, 0.05]])
    with np.errstate(over="ignore", invalid="ignore"), pytest.raises(NotTogetherError):
        integrate_together(lambda _, x: x * x, T, starts, np.full(1, 1e-10))


def with_math(t, x, u, p):
    return np.array([x[1], -p["k"] * math.sin(x[0])])


def branching(t, x, u, p):
    return np.array([x[1], -p["k"] if x[0] > 0 else p["k"]])


def mixing(t, x, u, p):
    return np.array([x[1], -p["k"] * np.sum(x)])


@pytest.mark.parametrize(
    ("rhs", "together"), [(swinging, True), (with_math, False), (branching, False), (mixing, False)]
)
def test_only_what_gives_the_same_is_done_together(rhs, together):
    assert takes_columns(rhs, 0.0, np.zeros(2), np.ones(2), {}, {"k": 2.0}) is together
