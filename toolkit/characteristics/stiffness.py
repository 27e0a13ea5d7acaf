"""Cornering and aligning stiffness: the +-1 deg secant (thesis, SAE) and the slope of the curve.

In SAE axes FY falls and MZ rises with the slip angle: cornering stiffness is -dFY/dSA and aligning
stiffness +dMZ/dSA, both positive. The secant is biased low against the slope at zero (-6 to -0.3 % on a
passenger tire) because the curve bends.
"""

from __future__ import annotations

from toolkit.characteristics.direction import CHANNELS
from toolkit.characteristics.reading import Reader
from toolkit.characteristics.uncertain import Uncertain

NAMES = ("secant_cornering", "secant_aligning", "slope_cornering", "slope_aligning")
_SIGN = {"FY": -1.0, "MZ": 1.0}
_KIND = {"FY": "cornering", "MZ": "aligning"}


def stiffness(reader: Reader) -> dict[str, Uncertain]:
    """Return the stiffnesses of one load and direction by name [N/rad, N·m/rad]; what lacks is left out."""
    found: dict[str, Uncertain] = {}
    for way in ("secant", "slope"):
        for channel in CHANNELS:
            one = reader.secant(channel) if way == "secant" else reader.slope(channel)
            if one is not None:
                found[f"{way}_{_KIND[channel]}"] = one.scaled(_SIGN[channel], one.unit)
    return found
