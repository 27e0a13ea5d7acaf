"""A positioning drive under its controller: reference R [m], position X [m], control voltage U [V].

The controller works at 1 kHz. It takes its speed from positions two samples apart, which is late by one
sample, and its voltage stands for a sample, which is late by half of one more: a lag of the speed it sees.
"""

import numpy as np

LATE = 1.5e-3  # s


def voltage(x, u, p):
    """Return the controller's output."""
    return p["kv"] * (p["kp"] * (u["R"] - x[0]) - x[2])


def rhs(t, x, u, p):
    """Return the rates of position and speed, and of the speed that the controller sees."""
    force = p["gain"] * voltage(x, u, p) - p["viscous"] * x[1]
    return np.array([x[1], force / p["mass"], (x[1] - x[2]) / LATE])


def outputs(x, u, p):
    """Return position and voltage."""
    return {"X": x[0], "U": voltage(x, u, p)}


def initial(p):
    """Return place and even speed of the carriage in the first row."""
    return np.array([p["x0"], p["v0"], p["v0"]])
