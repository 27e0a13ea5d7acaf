"""A heated mass that loses heat to the room in proportion; the power is in per cent of the full one."""


def initial(p, run):
    """Return the temperature as the power is switched on."""
    return [run["start"]]


def rhs(t, x, u, p):
    """Return the rate of the temperature."""
    return [(p["room"] + p["gain"] * u["power"] - x[0]) / p["time_constant"]]


def outputs(x, u, p):
    """Return the temperature."""
    return {"temperature": x[0]}
