"""A driven pendulum: angle TH [rad], drive moment M [N·m]."""

import math

import numpy as np


def rhs(t, x, u, p):
    """Return the rates of angle and angular velocity."""
    return np.array([x[1], -p["k"] * math.sin(x[0]) - p["c"] * x[1] + p["b"] * u["M"]])


def outputs(x, u, p):
    """Return the measured angle."""
    return {"TH": x[0]}


def initial(p):
    """Return the pendulum at rest."""
    return np.array([0.0, 0.0])
