"""An optical filter: its transmittance is one number."""

import pandas as pd


def simulate(inputs, p):
    """Return the same transmittance at every reading."""
    return pd.DataFrame({"transmittance": [p["level"]] * len(inputs)})
