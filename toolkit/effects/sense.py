"""Signs of effects' parameters in axis systems: an equation is read with the channels of whoever states it.

``alpha = SA - offset`` holds with SA as the reader has it, so that an offset of +0.3 deg says in every axis
system that the recorded slip angle is 0.3 deg too large. What is not listed has no sense of its own.
"""

from __future__ import annotations

from toolkit.channels import Axes, signs

# (effect, parameter) -> the channel with which it is compared, and the axes in which its equation computes.
_SENSED: dict[tuple[str, str], tuple[str, Axes]] = {
    ("steer_offset", "offset"): ("SA", "SAE"),
    ("plysteer", "pseudo_slip_angle"): ("SA", "SAE"),
    ("conicity", "force_at_nominal_load"): ("FY", "machine"),
}


def computed_in(effect: str, parameter: str, axes: Axes) -> int:
    """Return the factor, +1 or -1, between a parameter in some axes and in those of its equation.

    >>> computed_in("steer_offset", "offset", "ISO-W"), computed_in("relaxation", "length", "ISO-W")
    (-1, 1)
    """
    channel, own = _SENSED.get((effect, parameter), ("", axes))
    return signs(own, axes)[channel] if channel else 1


def turned(effect: str, parameter: str, source: Axes, target: Axes) -> int:
    """Return the factor, +1 or -1, that carries a parameter from one axis system to another.

    >>> turned("conicity", "force_at_nominal_load", "ISO-W", "machine")
    -1
    """
    channel, _ = _SENSED.get((effect, parameter), ("", source))
    return signs(source, target)[channel] if channel else 1
