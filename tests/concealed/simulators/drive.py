"""A positioning drive under its controller: reference R [m], position X [m], control voltage U [V].

The controller works at 1 kHz. It takes its speed from positions two samples apart, which is late by one
sample, and its voltage stands for a sample, which is late by half of one: both as lags of that length.
"""

import numpy as np

SAMPLE = 1e-3  # s


def voltage(x, u, p):
    """Return the controller's output."""
    return p["kv"] * (p["kp"] * (u["R"] - x[0]) - x[2])


def rhs(t, x, u, p):
    """Return the rates of position and speed, of the speed that the controller sees, of the voltage held."""
    force = p["gain"] * x[3] - p["viscous"] * x[1]
    return np.array([
        x[1], force / p["mass"], (x[1] - x[2]) / SAMPLE, (voltage(x, u, p) - x[3]) / (0.5 * SAMPLE)
    ])  # fmt: skip


def outputs(x, u, p):
    """Return position and voltage."""
    return {"X": x[0], "U": voltage(x, u, p)}


def initial(p):
    """Return the first row: place and even speed of the carriage, the voltage of its viscous friction."""
    return np.array([p["x0"], p["v0"], p["v0"], p["viscous"] * p["v0"] / p["gain"]])
