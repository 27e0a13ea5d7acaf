"""Three bodies in a row, the first heated: power P [W], ambient TA [degC], temperatures T1 and T3 [degC]."""

import numpy as np


def rhs(t, x, u, p):
    """Return the rates of the three temperatures."""
    q12 = p["g"] * (x[0] - x[1])
    q23 = p["g"] * (x[1] - x[2])
    out = p["h"] * (x - u["TA"])
    return (np.array([u["P"] - q12, q12 - q23, q23]) - out) / p["C"]


def outputs(x, u, p):
    """Return the temperatures that are measured."""
    return {"T1": x[0], "T3": x[2]}


def initial(p):
    """Return the bodies at room temperature."""
    return np.full(3, 20.0)
