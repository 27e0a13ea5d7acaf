"""A dashpot."""

import pandas as pd


def simulate(inputs, p):
    """Return the force at the velocities."""
    return pd.DataFrame({"force": p["viscous"] * inputs["v"]})
