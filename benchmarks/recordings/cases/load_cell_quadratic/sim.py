"""A load cell: its response is a line and a parabola in the load."""

import pandas as pd


def simulate(inputs, p):
    """Return the response to the loads."""
    load = inputs["load"]
    return pd.DataFrame({"response": p["zero"] + p["slope"] * load + p["bend"] * load**2})
