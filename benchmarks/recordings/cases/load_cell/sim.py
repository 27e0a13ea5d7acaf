"""A load cell: its response is a straight line in the load."""

import pandas as pd


def simulate(inputs, p):
    """Return the response to the loads."""
    return pd.DataFrame({"response": p["zero"] + p["slope"] * inputs["load"]})
