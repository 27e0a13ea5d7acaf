"""A brush tire with a parabolic pressure: SA [deg], FZ [N] to FY [N] and MZ [N·m] in SAE axes."""

import numpy as np
import pandas as pd


def simulate(inputs, p):
    """Return the steady lateral force and aligning moment."""
    fz = np.maximum(inputs["FZ"].to_numpy(float), 1e-6)
    slip = np.tan(np.radians(inputs["SA"].to_numpy(float)))
    mu = p["mu"] * (1.0 - p["mu_load"] * (fz / p["FZ0"] - 1.0))
    a = p["a0"] * np.sqrt(fz / p["FZ0"])
    z = np.minimum(2.0 * p["cp"] * a**2 * np.abs(slip) / (3.0 * mu * fz), 1.0)
    force = mu * fz * (3 * z - 3 * z**2 + z**3) * np.sign(slip)
    moment = mu * fz * a * z * (1 - z) ** 3 * np.sign(slip)
    return pd.DataFrame({"FY": -force, "MZ": p["trail"] * moment})
