"""A cantilever with a strain bridge S [mV/V] and a deflection gauge W [mm] under a tip force P [N]."""

import pandas as pd


def simulate(inputs, p):
    """Return the readings of a linear elastic beam."""
    return pd.DataFrame(
        {
            "S": p["sensitivity"] * inputs["P"] * 1e-3,
            "W": inputs["P"] * p["length"] ** 3 / (3.0 * p["EI"]) * 1e3,
        }
    )
