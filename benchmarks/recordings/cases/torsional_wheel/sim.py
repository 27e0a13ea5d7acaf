"""A torsional pendulum: inertia and stiffness."""


def initial(p, run):
    """Return angle and rate at the first row; the rate is what the gyroscope says, but for its zero."""
    return [p["start"], run["speed0"] + p["speed"]]


def rhs(t, x, u, p):
    """Return the rates of angle and rate."""
    return [x[1], -p["stiffness"] * x[0] / p["inertia"]]


def outputs(x, u, p):
    """Return the rate."""
    return {"rate": x[1]}
