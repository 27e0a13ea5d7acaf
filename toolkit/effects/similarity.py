"""A steady tire under other friction, stiffness and trail: the similarity method, for any tire as it is.

Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.2.1: a curve of other friction and slope is the nominal
curve with both of its axes scaled, so that no coefficient of the tire has to be known.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from toolkit.effects.signals import Drive, TireForces

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Steady = Callable[["NDArray[np.float64]", Drive], TireForces]


def similar(steady: Steady, drive: Drive) -> TireForces:
    """Return the forces of a drive in the machine's axes.

    Parameters
    ----------
    steady : (slip angle [rad], drive) -> forces of the nominal steady tire
    drive : with what the effects have made of friction, stiffness, trail and forces on top
    """
    nominal = steady(drive.SA * drive.stiffness / drive.friction, drive)
    return TireForces(
        FY=drive.friction * nominal.FY + drive.FY,
        MZ=drive.friction * drive.trail * nominal.MZ + drive.MZ,
    )
