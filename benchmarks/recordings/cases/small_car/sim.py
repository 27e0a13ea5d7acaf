"""The kinematic single-track model behind a static steering curve."""

import numpy as np
import pandas as pd

WHEELBASE = 0.175  # m


def simulate(inputs, p):
    """Return the yaw rate."""
    angle = p["reach"] * np.tanh(p["shape"] * (inputs["steering"] + p["offset"]))
    return pd.DataFrame({"yaw_rate": inputs["speed"] * np.tan(angle) / WHEELBASE})
