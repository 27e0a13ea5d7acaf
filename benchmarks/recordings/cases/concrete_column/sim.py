"""A spring."""

import pandas as pd


def simulate(inputs, p):
    """Return the lateral load of the column over its weight."""
    return pd.DataFrame({"load": p["stiffness"] * inputs["x"]})
