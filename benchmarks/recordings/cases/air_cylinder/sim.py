"""Pressure on a piston."""

import pandas as pd


def simulate(inputs, p):
    """Return the force of the piston's rod."""
    return pd.DataFrame({"F": p["area"] * inputs["pressure"] + p["zero"]})
