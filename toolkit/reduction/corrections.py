"""A machine's corrections on the rows of a recording, in the machine's axes, before they are averaged.

What an effect of the catalogue adds is taken away again: the loads first, then the slip angle, which the
corrected moment may turn.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects import forward
from toolkit.findings import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from toolkit.machine import Machine


def corrected(
    machine: Machine, channels: Mapping[str, NDArray[np.float64]]
) -> dict[str, NDArray[np.float64]]:
    """Return SA, FZ, FY and MZ, each (n,), SI and machine axes, with every correction of the machine."""
    return forward.corrected([correction.in_SI for correction in machine.corrections], channels)


def u_SA(machine: Machine, MZ: NDArray[np.float64]) -> float:
    """Return the standard uncertainty [rad] that corrections leave in the slip angle.

    Where it goes with the moment, that at the largest moment (n,) [N·m] of the test: an upper bound for the
    other rows.
    """
    parts = [0.0]
    largest = float(np.max(np.abs(MZ))) if len(MZ) else 0.0
    for correction in machine.corrections:
        correctable = correction.applied.effect.correctable
        if correctable is not None and correctable.u_slip is not None:
            parts.append(correctable.u_slip(correction.u * correction.factor, largest))
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
