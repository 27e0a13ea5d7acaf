"""A wheel that coasts: the dry friction of its bearings, which ends with the motion."""

import math


def initial(p, run):
    """Return way and speed at the rim as the wheel is free."""
    return [0.0, run["speed0"]]


def rhs(t, x, u, p):
    """Return the rates of way and speed."""
    return [x[1], -p["bearing"] * math.tanh(x[1] / 0.05)]


def outputs(x, u, p):
    """Return the speed at the rim."""
    return {"v": x[1]}
