"""What a plan says of the diagnosis case that can be made of its test: outputs, columns, free parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

from toolkit.declared import Above, Entry, Fault, Keyed, Names, UnitName

Outputs = Literal["forces", "cells"]
Load = Literal["measured", "judged", "commanded"]
COLUMNS = (
    "SA", "FZ", "V", "TIRE_ANGLE", "DRUM_ANGLE", "P_INFL", "T_TREAD", "T_AMBIENT", "SA_CMD", "FZ_CMD"
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseParameter:
    """A parameter of a simulation in its own unit; without ``sd`` it is known exactly."""

    name: str
    value: Annotated[float, Entry("what it is before the case is judged")]
    unit: Annotated[str, UnitName(as_written=True), Entry(example="1", expected='unit = "kg", "1" for none')]
    sd: Annotated[
        float | None, Above(0),
        Entry("of its prior", expected="a number above zero, or no sd where it is known exactly"),
    ] = None  # fmt: skip
    bounds: Annotated[tuple[float, float] | None, Entry("it stays between", example=[0.5, 2.0])] = None

    def faults(self) -> Iterator[Fault]:
        """Yield bounds that are not around the value."""
        if self.bounds is not None and not (
            self.bounds[0] <= self.value <= self.bounds[1] and self.bounds[0] < self.bounds[1]
        ):
            yield Fault(
                key=("bounds",), got=self.bounds, what="the value lies outside its bounds",
                expected=f"bounds around {self.value:g}",
            )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CasePlan:
    """Outputs: ``forces`` FY and MZ by the calibration, or ``cells`` with the calibration named.

    ``columns`` beside t, SA and the load (None: those that vary). ``load`` says what is known of it: FZ
    ``measured`` drives the tire, or is ``judged`` as an output that FZ_CMD drives, or only FZ_CMD was
    ``commanded``.
    """

    outputs: Annotated[Outputs, Entry("FY and MZ by the calibration, or the cells")] = "forces"
    columns: Annotated[
        tuple[str, ...] | None, Names(*COLUMNS), Entry("beside t, SA and the load; default: those that vary")
    ] = None
    load: Annotated[Load, Entry("what is known of it")] = "measured"
    parameters: Annotated[
        tuple[CaseParameter, ...], Keyed(by="name"), Entry("that the case frees, with their priors")
    ] = ()
