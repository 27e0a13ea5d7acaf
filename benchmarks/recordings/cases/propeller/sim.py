"""A thrust that is a quadratic in the speed, and a torque in proportion to it."""

import pandas as pd


def simulate(inputs, p):
    """Return thrust and torque at the speeds."""
    speed = inputs["speed"]
    thrust = p["square"] * speed**2 + p["slope"] * speed + p["zero"]
    return pd.DataFrame({"thrust": thrust, "torque": p["arm"] * thrust})
