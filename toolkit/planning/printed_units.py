"""The units in which people read a plan of a test: forces as their machine's protocol has the loads."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import by_name
from toolkit.declared import Quantity
from toolkit.planning.demands import PEAK
from toolkit.units import from_si

if TYPE_CHECKING:
    from toolkit.machine import Protocol

_MOMENTS = {"lbf": "lbf*ft"}  # of a force's unit; N*m of any other
_DEGREE = math.radians(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintedUnits:
    """Units of forces and moments; angles are in degrees, lengths in millimetres.

    >>> units = PrintedUnits(force="lbf", moment="lbf*ft")
    >>> units.shown(4448.2216, "N/rad")
    (17.4532..., 'lbf/deg')
    """

    force: str = "N"
    moment: str = "N*m"

    def shown(self, value: float, unit: str) -> tuple[float, str]:
        """Return an SI value as it is printed, with its unit."""
        if unit == "m":
            return 1e3 * value, "mm"
        quantity, _, angle = unit.partition("/")
        names = {"N": self.force, "N*m": self.moment, "rad": "deg"}
        if quantity not in names or angle not in ("", "rad"):
            return value, unit
        size = value / _DEGREE if quantity == "rad" else float(from_si(value, names[quantity]))
        if angle:
            return size * _DEGREE, f"{names[quantity]}/deg"
        return size, names[quantity]


def units_of(protocol: Protocol) -> PrintedUnits:
    """Return the units of a protocol: force as its loads are written."""
    written = {load.unit for load in protocol.loads_N if isinstance(load, Quantity)}
    force = written.pop() if len(written) == 1 else "N"
    force = "lbf" if force == "lb" else force
    return PrintedUnits(force=force, moment=_MOMENTS.get(force, "N*m"))


def title_of(label: str) -> str:
    """Return what a demand is called: its characteristic's title, with the slip angle of one at an angle.

    >>> title_of("slope_cornering"), title_of("FY@8deg"), title_of("peak")
    ('cornering stiffness, slope at 0 deg', 'lateral force at 8 deg', 'peak lateral force')
    """
    name, _, angle = label.partition("@")
    if name == PEAK:
        return f"peak {by_name()['FY'].term}"
    declared = by_name()[name]
    return f"{declared.term} at {angle.removesuffix('deg')} deg" if angle else declared.title
