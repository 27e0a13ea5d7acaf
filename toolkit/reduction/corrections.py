"""A machine's corrections on the rows of a recording, in the machine's axes, before they are averaged.

What an effect of the catalogue adds is taken away again, by the same equation: the loads first, then the slip
angle, which the corrected moment may turn. The effects are not used themselves: they lie above this stage.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from toolkit.machine import Machine


def corrected(
    machine: Machine, channels: Mapping[str, NDArray[np.float64]]
) -> dict[str, NDArray[np.float64]]:
    """Return SA, FZ, FY and MZ, each (n,), SI and machine axes, with every correction of the machine.

    ``crosstalk``: load = shown - coefficient * other, the others as shown; ``steer_offset``: alpha = SA -
    offset; ``steer_compliance``: alpha = SA - compliance * MZ, with the corrected moment.
    """
    result = dict(channels)
    for correction in machine.corrections:
        if correction.effect == "crosstalk":
            name, source = str(correction.channel), str(correction.source)
            result[name] = result[name] - correction.value * correction.factor * channels[source]
    for correction in machine.corrections:
        if correction.effect == "steer_offset":
            result["SA"] = result["SA"] - correction.value * correction.factor
        elif correction.effect == "steer_compliance":
            result["SA"] = result["SA"] - correction.value * correction.factor * result["MZ"]
    return result


def u_SA(machine: Machine, MZ: NDArray[np.float64]) -> float:
    """Return the standard uncertainty [rad] that corrections leave in the slip angle.

    That of a compliance at the largest moment (n,) [N·m] of the test: an upper bound for the other rows.
    """
    parts = [0.0]
    largest = float(np.max(np.abs(MZ))) if len(MZ) else 0.0
    for correction in machine.corrections:
        if correction.effect == "steer_offset":
            parts.append(correction.u * correction.factor)
        elif correction.effect == "steer_compliance":
            parts.append(correction.u * correction.factor * largest)
    return math.hypot(*parts)


def correction_findings(machine: Machine) -> list[Finding]:
    """Name every correction that the rows have had; nothing for a machine without any."""
    return [
        Finding(
            rule="machine-corrected",
            where=f"{machine.name}, version {machine.version}",
            message=correction.as_text(),
            level="note",
        )
        for correction in machine.corrections
    ]
