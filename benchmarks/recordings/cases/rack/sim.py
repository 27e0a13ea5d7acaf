"""A moving mass with viscous friction."""

import pandas as pd


def simulate(inputs, p):
    """Return the force along a recorded motion."""
    return pd.DataFrame({"force": p["mass"] * inputs["a"] + p["viscous"] * inputs["v"]})
