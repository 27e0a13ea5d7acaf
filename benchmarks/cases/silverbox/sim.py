"""A damped linear oscillator driven by a voltage: mass 1, the position read in volts."""


def initial(p, run):
    """Return position and velocity at the first row: at rest but where the run says more."""
    return [run.get("y0", 0.0), run.get("rate0", 0.0)]


def rhs(t, x, u, p):
    """Return the rates of position and velocity."""
    return [x[1], p["gain"] * u["u"] - p["stiffness"] * x[0] - p["damping"] * x[1]]


def outputs(x, u, p):
    """Return the position."""
    return {"y": x[0]}
