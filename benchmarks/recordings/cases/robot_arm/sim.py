"""A rigid arm: one inertia with viscous friction."""


def initial(p, run):
    """Return the arm as the recording begins."""
    return [0.0, run["speed0"]]


def rhs(t, x, u, p):
    """Return the rates of angle and speed."""
    return [x[1], (u["torque"] - p["viscous"] * x[1]) / p["inertia"]]


def outputs(x, u, p):
    """Return the speed of the motor."""
    return {"speed": x[1]}
