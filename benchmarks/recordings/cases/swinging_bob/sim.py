"""A mathematical pendulum."""

import math


def initial(p, run):
    """Return angle and rate at the first row, which is the top of a swing."""
    return [run["angle0"] + p["start"], p["speed"]]


def rhs(t, x, u, p):
    """Return the rates of angle and rate."""
    return [x[1], -9.81 * math.sin(x[0]) / p["length"]]


def outputs(x, u, p):
    """Return the angle."""
    return {"angle": x[0]}
