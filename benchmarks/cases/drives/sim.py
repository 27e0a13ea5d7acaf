"""The pulley of two coupled electric drives: a motor's lag and a resonance of the belt."""


def initial(p):
    """Return everything at rest."""
    return [0.0, 0.0, 0.0]


def rhs(t, x, u, p):
    """Return the rates of motor speed, pulley speed and the latter's rate."""
    motor = p["pole"] * (p["gain"] * u["u"] - x[0])
    return [motor, x[2], p["resonance"] ** 2 * (x[0] - x[1]) - 2 * p["damping"] * p["resonance"] * x[2]]


def outputs(x, u, p):
    """Return the pulley's speed."""
    return {"y": x[1]}
