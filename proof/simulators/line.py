"""A linear load cell: load L [lbf] to deflection D, in the units of its certificate."""

import pandas as pd


def simulate(inputs, p):
    """Return the deflection of a straight line."""
    return pd.DataFrame({"D": p["zero"] + p["sensitivity"] * inputs["L"] * 1e-6})
