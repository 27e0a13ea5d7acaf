"""Carbon dioxide in ppm: a level and a trend by the year."""

import pandas as pd


def simulate(inputs, p):
    """Return the monthly means."""
    return pd.DataFrame({"co2": p["level"] + p["trend"] * inputs["t"] / 31557600.0})
