"""Two wheels that coast: the drag of the air."""


def initial(p, run):
    """Return way and speed at the rim as the power is off."""
    return [0.0, run["speed0"]]


def rhs(t, x, u, p):
    """Return the rates of way and speed."""
    return [x[1], -p["drag"] * x[1] * abs(x[1])]


def outputs(x, u, p):
    """Return the speed at the rim."""
    return {"v": x[1]}
