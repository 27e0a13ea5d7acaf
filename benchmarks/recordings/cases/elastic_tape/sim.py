"""Mooney and Rivlin's rubber in uniaxial tension."""

import pandas as pd

LENGTH = 0.08  # m
AREA = 22e-6  # m^2


def simulate(inputs, p):
    """Return the force at the extensions."""
    stretch = 1.0 + inputs["x"] / LENGTH
    stress = 2.0 * (p["C1"] + p["C2"] / stretch) * (stretch - stretch**-2)
    return pd.DataFrame({"F": AREA * stress})
