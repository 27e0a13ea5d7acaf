"""The torque that a motion of a pendulum takes: inertia, gravity and viscous friction."""

import numpy as np
import pandas as pd


def simulate(inputs, p):
    """Return the torque along a recorded motion."""
    gravity = 9.81 * p["weight"] * np.sin(inputs["angle"])
    return pd.DataFrame(
        {"torque": p["inertia"] * inputs["acceleration"] + gravity + p["viscous"] * inputs["speed"]}
    )
