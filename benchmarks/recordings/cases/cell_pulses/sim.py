"""A voltage at rest that follows the charge, and a resistance."""

import numpy as np

# After an hour of rest at each tenth of the charge, in the same test.
CHARGE = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
AT_REST = [3.802, 3.869, 3.909, 3.949, 3.984, 4.048, 4.086, 4.182]  # V


def initial(p, run):
    """Return the share of the charge as the test begins."""
    return [run["start"]]


def rhs(t, x, u, p):
    """Return the rate of the charge; a current into the cell is positive."""
    return [u["current"] / (3600.0 * p["capacity"])]


def outputs(x, u, p):
    """Return the voltage at the terminals."""
    return {"voltage": float(np.interp(x[0], CHARGE, AT_REST)) + p["resistance"] * u["current"]}
