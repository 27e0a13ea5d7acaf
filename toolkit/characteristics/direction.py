"""One direction's conditions and the curves that were fitted to them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from toolkit.characteristics.groups import Group
    from toolkit.characteristics.model import DirectionFit
    from toolkit.tires.model import CurveFit

Channel = Literal["FY", "MZ"]
CHANNELS: tuple[Channel, Channel] = ("FY", "MZ")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Direction:
    """One direction's conditions and curves at one load; a curve is None where it could not be fitted."""

    group: Group
    fit: DirectionFit

    def curve(self, channel: Channel) -> CurveFit | None:
        """Return the fitted curve of a channel."""
        return self.fit.FY if channel == "FY" else self.fit.MZ
