"""A steady tire: the Magic Formula for FY in SAE axes and a pneumatic trail that falls with the angle."""

import numpy as np
import pandas as pd

NOMINAL = 2000.0  # N


def simulate(inputs, p):
    """Return lateral force and aligning moment at the slip angles and loads."""
    load = inputs["FZ"]
    more = load / NOMINAL - 1
    slip = np.radians(inputs["SA"] + p["angle"])
    peak = load * p["friction"] * (1 + p["friction_of_load"] * more)
    stiffness = load * p["stiffness"] * (1 + p["stiffness_of_load"] * more)
    bent = stiffness / (p["shape"] * peak) * slip
    bent = bent - p["curvature"] * (bent - np.arctan(bent))
    force = -peak * np.sin(p["shape"] * np.arctan(bent))
    trail = p["trail"] * load / NOMINAL * np.exp(-((slip / np.radians(p["trail_width"])) ** 2))
    return pd.DataFrame({"FY": force + p["side"] * load, "MZ": -trail * force + p["residual"]})
