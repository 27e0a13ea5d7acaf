"""A car that coasts: the drag of the air and the rolling resistance, which ends with the motion."""

import math


def initial(p, run):
    """Return place and speed as the car begins to coast."""
    return [0.0, run["speed0"]]


def rhs(t, x, u, p):
    """Return the rates of place and speed."""
    rolling = 9.81 * p["rolling"] * math.tanh(x[1] / 0.05)
    return [x[1], -p["drag"] * x[1] * abs(x[1]) - rolling]


def outputs(x, u, p):
    """Return the speed."""
    return {"v": x[1]}
