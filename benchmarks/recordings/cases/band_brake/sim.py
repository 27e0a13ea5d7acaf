"""A viscous damper."""

import pandas as pd


def simulate(inputs, p):
    """Return the force along a recorded motion."""
    return pd.DataFrame({"F": p["viscous"] * inputs["v"]})
