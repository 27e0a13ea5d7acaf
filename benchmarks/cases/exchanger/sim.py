"""A steam-heated exchanger: the outlet temperature follows the liquid flow with one time constant."""


def initial(p, run):
    """Return the outlet temperature at the first row."""
    return [run.get("y0", run.get("y", p["level"]))]


def rhs(t, x, u, p):
    """Return the rate of the outlet temperature."""
    return [(p["level"] + p["slope"] * (u["u"] - 0.4) - x[0]) / p["time_constant"]]


def outputs(x, u, p):
    """Return the outlet temperature."""
    return {"y": x[0]}
