"""A mass with viscous friction, pulled by a motor over a pulley."""

TORQUE = 0.0934  # N m/A
RADIUS = 0.028  # m


def initial(p, run):
    """Return position and speed at the first row."""
    return [run["start"], run["speed0"]]


def rhs(t, x, u, p):
    """Return the rates of position and speed."""
    pull = TORQUE * u["current"] / RADIUS
    return [x[1], (pull - p["viscous"] * x[1]) / p["mass"]]


def outputs(x, u, p):
    """Return the position."""
    return {"position": x[0]}
