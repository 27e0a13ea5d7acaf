"""Two open tanks in cascade under Torricelli's law; the levels are in volts of the level sensor."""

import math


def initial(p):
    """Return the levels at the first row."""
    return [p["h1_0"], p["h2_0"]]


def rhs(t, x, u, p):
    """Return the rates of both levels."""
    h1, h2 = max(x[0], 0.0), max(x[1], 0.0)
    between = math.sqrt(h1)
    return [p["pump"] * u["u"] - p["out1"] * between, p["in2"] * between - p["out2"] * math.sqrt(h2)]


def outputs(x, u, p):
    """Return the level of the lower tank."""
    return {"y": x[1]}
