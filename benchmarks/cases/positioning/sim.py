"""A carriage on rails: motor force and viscous friction."""


def initial(p, run):
    """Return place and velocity at the first row: at rest but where the run says more."""
    return [run.get("y0", run.get("y", 0.0)), 0.0]


def rhs(t, x, u, p):
    """Return the rates of place and velocity."""
    return [x[1], (p["gain"] * u["u"] - p["viscous"] * x[1]) / p["mass"]]


def outputs(x, u, p):
    """Return the place."""
    return {"y": x[0]}
