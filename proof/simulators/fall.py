"""A ball that falls: height H [m] over the ground, under gravity alone."""

import numpy as np


def rhs(t, x, u, p):
    """Return the rates of height and velocity."""
    return np.array([x[1], -p["g"]])


def outputs(x, u, p):
    """Return the height."""
    return {"H": x[0]}


def initial(p, run):
    """Return the height and velocity with which the drop's record begins."""
    drop = "2" if "drop2" in str(run) else "1"
    return np.array([p["h" + drop], p["v" + drop]])
