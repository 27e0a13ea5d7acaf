"""What a hub's cells measure beside FY and MZ, and where its moments stand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

from toolkit.declared import Above, AtLeast, Distinct, Entry, Fault, Size, Unit

HubSymbol = Literal["FX", "FZ", "MX", "MY"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """Calibrated loads of the hub beside FY and MZ, right-handed in the machine's axes about the spindle.

    ``arm_m`` is the distance from the spindle's axis down to the contact patch, the loaded radius, by which
    MX and MY are carried from the spindle to the contact patch; None leaves them at the spindle.
    ``u_arm_m`` is its standard uncertainty.
    """

    loads: Annotated[
        tuple[HubSymbol, ...], Size(1), Distinct(),
        Entry("by the calibration record, beside FY and MZ; right-handed about the spindle, FZ the load on "
              "the tire", example=["FX", "FZ", "MX", "MY"]),
    ]  # fmt: skip
    arm_m: Annotated[
        float | None, Unit("mm"), Above(0),
        Entry("from the spindle's axis to the contact patch (loaded radius): MX and MY are carried there; "
              "without it they stay at the spindle", key="arm"),
    ] = None  # fmt: skip
    u_arm_m: Annotated[
        float, Unit("mm"), AtLeast(0), Entry("standard uncertainty of the arm", key="u_arm")
    ] = 0.0

    def faults(self) -> Iterator[Fault]:
        """Yield an arm that nothing is carried by, and one that MY cannot be carried by without FX."""
        if self.arm_m is None and self.u_arm_m:
            yield Fault(key=("u_arm",), got=self.u_arm_m, expected="u_arm beside arm", what="has no arm")
        if self.arm_m is not None and not {"MX", "MY"} & set(self.loads):
            yield Fault(
                key=("arm",), got=self.arm_m, expected="an arm beside MX or MY in loads",
                what="carries no moment",
            )  # fmt: skip
        if self.arm_m is not None and "MY" in self.loads and "FX" not in self.loads:
            yield Fault(
                key=("loads",), got=list(self.loads), expected="FX beside MY, or no arm",
                what="MY is carried to the contact patch by FX, which is not there",
            )  # fmt: skip
