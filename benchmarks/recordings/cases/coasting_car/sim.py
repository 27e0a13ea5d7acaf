"""A car that coasts: the drag of the air."""


def initial(p, run):
    """Return place and speed as the car begins to coast."""
    return [0.0, run["speed0"]]


def rhs(t, x, u, p):
    """Return the rates of place and speed."""
    return [x[1], -p["drag"] * x[1] * abs(x[1])]


def outputs(x, u, p):
    """Return the speed."""
    return {"v": x[1]}
