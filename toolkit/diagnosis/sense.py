"""Signs of an effect's parameters: inside SAE and the machine's axes, in an answer those of the case.

An effect's equation is read with the recorded channels: ``alpha = SA - offset`` holds with SA as the case has
it, so that an offset of +0.3 deg says in every axis system that the recorded slip angle is 0.3 deg too large.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.channels import Axes, signs

if TYPE_CHECKING:
    from toolkit.diagnosis.model import Active

# (effect, parameter) -> the channel with which it is compared, and the axes in which it was fitted.
_SENSED: dict[tuple[str, str], tuple[str, Axes]] = {
    ("steer_offset", "offset"): ("SA", "SAE"),
    ("plysteer", "pseudo_slip_angle"): ("SA", "SAE"),
    ("conicity", "force_at_nominal_load"): ("FY", "machine"),
}


def sense(active: Active, parameter: str, axes: Axes) -> int:
    """Return the factor, +1 or -1, of a parameter's value in the case's axes, the drum running forward."""
    channel, fitted = _SENSED.get((active.effect.name, parameter), ("", axes))
    return signs(fitted, axes)[channel] if channel else 1
