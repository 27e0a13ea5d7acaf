"""Functions of one state for columns of states: the same as one by one, or not at all."""

import math

import numpy as np
import pytest

from toolkit.diagnosis.simulators.columnwise import columnwise

RNG = np.random.default_rng(1)
T = np.linspace(0.0, 1.0, 12)
X = RNG.normal(size=(2, 12))
U = {"u": RNG.normal(size=12)}
P = {"k": 2 + RNG.normal(size=12) ** 2}


def swinging(t, x, u, p):
    return np.array([x[1], -p["k"] * x[0]])


def falling(t, x, u, p):
    return [x[1], -9.81]


def with_math(t, x, u, p):
    return [x[1], -p["k"] * math.sin(x[0]) + float(u["u"])]


def helped(t, x, u, p):
    return [x[1], -root(p["k"])]


def root(k):
    return math.sqrt(k)


def branching(t, x, u, p):
    if x[0] > 0 and u["u"] > 0:
        return [x[1], -p["k"]]
    return [max(x[1], 0.0), p["k"] if t > 0.5 else 0.0]


def mixing(t, x, u, p):
    return [x[1], -p["k"] * np.sum(x)]


def counting(t, x, u, p):
    return [x[1], float(int(10 * x[0]))]


@pytest.mark.parametrize("rhs", [swinging, falling, with_math, helped, branching])
def test_what_is_asked_of_a_state_is_asked_of_columns(rhs):
    made = columnwise(rhs, lambda f, t, x, u, p: f(t, x, u, p), T, X, U, P)
    assert made is not None
    # on states that it was not tried on
    x, u = RNG.normal(size=(2, 40)), {"u": RNG.normal(size=40)}
    t, p = np.linspace(0, 1, 40), {"k": 2 + RNG.normal(size=40) ** 2}
    alone = [rhs(t[k], x[:, k], {"u": u["u"][k]}, {"k": p["k"][k]}) for k in range(40)]
    np.testing.assert_allclose(made(t, x, u, p), np.array(alone).T, rtol=1e-14)


@pytest.mark.parametrize("rhs", [mixing, counting])
def test_what_gives_something_else_for_columns_is_not_taken(rhs):
    assert columnwise(rhs, lambda f, t, x, u, p: f(t, x, u, p), T, X, U, P) is None
