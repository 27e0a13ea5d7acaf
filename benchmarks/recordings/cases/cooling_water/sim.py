"""Newton's law of cooling."""


def initial(p, run):
    """Return the temperature at the first row."""
    return [run["start"]]


def rhs(t, x, u, p):
    """Return the rate of the temperature."""
    return [(p["room"] - x[0]) / p["time_constant"]]


def outputs(x, u, p):
    """Return the temperature."""
    return {"temperature": x[0]}
