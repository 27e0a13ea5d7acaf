"""A positioning drive under its controller: reference R [m], position X [m], control voltage U [V]."""

import numpy as np


def voltage(x, u, p):
    """Return the controller's output."""
    return p["kv"] * (p["kp"] * (u["R"] - x[0]) - x[1])


def rhs(t, x, u, p):
    """Return the rates of position and velocity."""
    force = p["gain"] * voltage(x, u, p) - p["viscous"] * x[1]
    return np.array([x[1], force / p["mass"]])


def outputs(x, u, p):
    """Return position and voltage."""
    return {"X": x[0], "U": voltage(x, u, p)}


def initial(p):
    """Return the carriage at rest at the zero of the scale."""
    return np.array([0.0, 0.0])
