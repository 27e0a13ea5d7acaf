"""Ultrasound in metal: absorption alone."""

import numpy as np
import pandas as pd


def simulate(inputs, p):
    """Return the response at the distances."""
    return pd.DataFrame({"response": p["source"] * np.exp(-p["absorption"] * inputs["distance"])})
