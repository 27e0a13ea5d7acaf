"""A rotor with viscous friction."""


def initial(p):
    """Return the rotor at rest."""
    return [0.0, 0.0]


def rhs(t, x, u, p):
    """Return the rates of angle and speed."""
    return [x[1], (u["torque"] - p["viscous"] * x[1]) / p["inertia"]]


def outputs(x, u, p):
    """Return the speed."""
    return {"speed": x[1]}
