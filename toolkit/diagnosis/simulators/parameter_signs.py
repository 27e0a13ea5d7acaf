"""Signs of an effect's parameters: inside SAE and the machine's axes, in an answer those of the case."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.sense import computed_in

if TYPE_CHECKING:
    from toolkit.channels import Axes
    from toolkit.diagnosis.simulators.simulator import Active


def sense(active: Active, parameter: str, axes: Axes) -> int:
    """Return the factor, +1 or -1, of a parameter's value in the case's axes, the drum running forward."""
    return computed_in(active.effect.name, parameter, axes)
