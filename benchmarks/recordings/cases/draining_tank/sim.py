"""Torricelli's law: a tapered tank that drains through a hole in its side."""

import math

HEIGHT = 0.286  # m
BOTTOM, TOP = 0.010297, 0.012895  # m^2
HOLE = math.pi * (5 / 64 * 0.0254 / 2) ** 2  # m^2


def initial(p, run):
    """Return the level at the first row."""
    return [run["start"]]


def rhs(t, x, u, p):
    """Return the rate of the level."""
    head = max(x[0] - p["hole"], 0.0)
    area = BOTTOM + (TOP - BOTTOM) * x[0] / HEIGHT
    return [-p["discharge"] * HOLE * math.sqrt(2 * 9.80665 * head) / area]


def outputs(x, u, p):
    """Return the level."""
    return {"level": x[0]}
