"""A mass on a linear spring with a linear damper, driven by a force."""


def initial(p, run):
    """Return position and velocity at the first row: at rest but where the run says more."""
    return [run.get("y0", 0.0), run.get("rate0", 0.0)]


def rhs(t, x, u, p):
    """Return the rates of position and velocity."""
    return [x[1], (u["u"] - p["stiffness"] * x[0] - p["damping"] * x[1]) / p["mass"]]


def outputs(x, u, p):
    """Return the position."""
    return {"y": x[0]}
