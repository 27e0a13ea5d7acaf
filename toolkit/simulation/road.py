"""Road stage: a drum that is not quite round presses the tire more and less, once a revolution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from toolkit.declared import Entry, Unit

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadTruth:
    """Run-out as load variation at the drum's revolution and at twice that; phases against drum angle 0."""

    runout_1_N: Annotated[
        float, Unit("N"), Entry("load variation once a revolution of the drum", key="drum_runout_1")
    ] = 20.0
    runout_1_phase_rad: Annotated[
        float, Unit("deg"), Entry("against drum angle 0", key="drum_runout_1_phase")
    ] = 0.6
    runout_2_N: Annotated[float, Unit("N"), Entry("twice a revolution", key="drum_runout_2")] = 5.0
    runout_2_phase_rad: Annotated[
        float, Unit("deg"), Entry("against drum angle 0", key="drum_runout_2_phase")
    ] = 2.1


def drum_angle(
    *, time: NDArray[np.float64], speed_m_s: float, radius_m: float, start_rad: float, reverse: bool
) -> NDArray[np.float64]:
    """Return the drum's angle [rad] at times [s]; a reversed drum counts down."""
    return start_rad + (-1.0 if reverse else 1.0) * time * speed_m_s / radius_m


def load_on_drum(
    road: RoadTruth, *, load: NDArray[np.float64], angle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the load [N] between tire and drum: the actuator's load plus the run-out's lines.

    >>> import numpy as np
    >>> lines = load_on_drum(RoadTruth(), load=np.zeros(360), angle=np.radians(np.arange(360)))
    >>> bool(abs(lines.mean()) < 1e-9)  # over a whole revolution of the drum, and only then
    True
    """
    return (
        load
        + road.runout_1_N * np.cos(angle + road.runout_1_phase_rad)
        + road.runout_2_N * np.cos(2 * angle + road.runout_2_phase_rad)
    )
