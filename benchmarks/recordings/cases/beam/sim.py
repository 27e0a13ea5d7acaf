"""A beam at rest: its deflection is one number."""

import pandas as pd


def simulate(inputs, p):
    """Return the same deflection at every reading."""
    return pd.DataFrame({"deflection": [p["level"]] * len(inputs)})
