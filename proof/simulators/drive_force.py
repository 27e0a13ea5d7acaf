"""The motor force F [N] that a motion needs: velocity v [m/s] and acceleration a [m/s^2] are given."""

import pandas as pd


def simulate(inputs, p):
    """Return the force of inertia and viscous friction."""
    return pd.DataFrame({"F": p["mass"] * inputs["a"] + p["viscous"] * inputs["v"]})
