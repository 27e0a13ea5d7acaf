"""Ultrasound in metal: absorption and the spreading of the beam."""

import numpy as np
import pandas as pd


def simulate(inputs, p):
    """Return the response at the distances."""
    x = inputs["distance"]
    return pd.DataFrame({"response": np.exp(-p["absorption"] * x) / (p["source"] + p["spreading"] * x)})
