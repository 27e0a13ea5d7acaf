"""A tank with an outlet: inflow Q [l/s], level H [m]."""

import math

import numpy as np


def rhs(t, x, u, p):
    """Return the rate of the level."""
    return np.array([(u["Q"] * 1e-3 - p["outlet"] * math.sqrt(max(x[0], 0.0))) / p["area"]])


def outputs(x, u, p):
    """Return the level."""
    return {"H": x[0]}


def initial(p):
    """Return the level at which the tank stands before the test."""
    return np.array([p["level0"]])
