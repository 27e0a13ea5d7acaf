"""The file of a plan, declared: orders to the machine, numbers of every stage, the case made of its test."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar, cast

from toolkit.channels import Rotation
from toolkit.declared import (
    Above,
    AtLeast,
    Day,
    Entry,
    Fault,
    Format,
    Keyed,
    Names,
    Size,
    Text,
    Unit,
    UnitName,
)
from toolkit.machine.default import SIMULATED_MACHINE
from toolkit.simulation.acquisition import AcquisitionTruth
from toolkit.simulation.carriage import CarriageTruth, RoadTruth
from toolkit.simulation.cells import CellsTruth
from toolkit.simulation.steps import Motion, RunSteps

Outputs = Literal["forces", "cells"]
Load = Literal["measured", "judged", "commanded"]
COLUMNS = (
    "SA", "FZ", "V", "TIRE_ANGLE", "DRUM_ANGLE", "P_INFL", "T_TREAD", "T_AMBIENT", "SA_CMD", "FZ_CMD"
)  # fmt: skip
Kind = Literal["test", "session", "table"]
Output = Literal["mV/V", "mV", "count"]
Record = Literal["dwell", "continuous"]
T = TypeVar("T")
_Force = Annotated[float | None, Unit("N")]
_Angle = Annotated[float | None, Unit("deg")]
_BridgeRatio = Annotated[float | None, Unit("mV/V")]


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
        if self.bounds is None:
            return
        if not self.bounds[0] < self.bounds[1]:
            yield Fault(
                key=("bounds",), got=self.bounds, what="the lower bound is not below the upper one",
                expected="[lower, upper]",
            )  # fmt: skip
        elif not self.bounds[0] <= self.value <= self.bounds[1]:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionTruth:
    """The reference-load session: largest loads, runs, and how well the reference loads are known.

    ``output`` is what the files hold: the bridge's ratio, volts at ``excitation_V``, or counts of
    ``count_V_V`` [V/V] each. ``readings`` writes zeros before and after, which drift by ``zero_drift_V_V``
    in each cell, and shunt steps.
    """

    FY_N: Annotated[float, Unit("N"), Entry("largest load, both signs", key="FY")] = 6200.0
    MZ_Nm: Annotated[float, Unit("N*m"), Entry("largest load, both signs", key="MZ")] = 200.0
    MX_Nm: Annotated[float, Unit("N*m"), Entry("largest load, both signs", key="MX")] = 1900.0
    runs: Annotated[int, AtLeast(1), Entry("how often the loads are applied")] = 3
    reference_FY_N: Annotated[float, Unit("N"), Entry("1 sd of a reference load", key="reference_FY")] = 0.4
    reference_MZ_Nm: Annotated[float, Unit("N*m"), Entry("1 sd", key="reference_MZ")] = 0.015
    reference_MX_Nm: Annotated[float, Unit("N*m"), Entry("1 sd", key="reference_MX")] = 0.15
    output: Annotated[Output, Entry("what the files hold of the cells")] = "mV/V"
    excitation_V: Annotated[float, Unit("V"), Above(0), Entry("of the bridges", key="excitation")] = 10.0
    count_V_V: Annotated[float, Unit("V/V"), Above(0), Entry("bridge ratio of a count", key="scale")] = 4e-10
    readings: Annotated[bool, Entry("whether zeros and shunt steps are written")] = False
    zero_drift_V_V: Annotated[
        float, Unit("V/V"), Entry("of each cell, from the zero before to that after", key="zero_drift")
    ] = 2e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class TireEntries:
    """The tire: the published one, or a file's; what is not stated is that tire's own."""

    file: Annotated[
        Path | None,
        Entry(
            "a tire file, or a model file of toolkit diagnose; relative to the plan", example="tire.tir",
            expected='file = "tire.tir", or a model file of toolkit diagnose',
        ),
    ] = None  # fmt: skip
    plysteer_rad: Annotated[_Angle, Entry("pseudo slip angle", key="plysteer")] = None
    aligning_shift_rad: Annotated[
        _Angle, Entry("what the moment's pseudo slip angle is more", key="aligning_shift")
    ] = None
    conicity_N: Annotated[_Force, Entry("at the nominal load", key="conicity")] = None
    nominal_load_N: Annotated[_Force, Above(0), Entry(key="nominal_load")] = None
    free_radius_m: Annotated[float | None, Unit("m"), Above(0), Entry(key="free_radius")] = None
    rolling_ratio: Annotated[
        float | None, Unit("1"), Above(0), Entry("effective rolling radius over free radius")
    ] = None
    vertical_stiffness_N_m: Annotated[
        float | None, Unit("N/m"), Above(0), Entry("of the loaded tire", key="vertical_stiffness")
    ] = None

    def faults(self) -> Iterator[Fault]:
        """Yield the pseudo-angles of the published tire beside a file, whose coefficients have their own."""
        published = {
            "plysteer": self.plysteer_rad,
            "aligning_shift": self.aligning_shift_rad,
            "conicity": self.conicity_N,
        }
        for key, value in published.items():
            if self.file is not None and value is not None:
                yield Fault(
                    key=(key,), got=value, what="is for the published tire alone",
                    expected="no such entry beside a tire's file", rule="unknown-key",
                )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CellEntries:
    """One cell; what is not stated is the virtual cell's own."""

    rated_output: Annotated[_BridgeRatio, Above(0), Entry("at the capacity", together="capacity")] = None
    capacity: Annotated[_Force, Above(0), Entry("force of the rated output", together="rated_output")] = None
    zero_V_V: Annotated[_BridgeRatio, Entry("output without force", key="zero")] = None
    noise_V_V: Annotated[_BridgeRatio, Entry("1 sd of a sample before the filter", key="noise")] = None
    zero_offset_V_V: Annotated[_BridgeRatio, Entry("moved after the tare", key="zero_offset")] = None
    gain_error: Annotated[float | None, Unit("1"), Entry("sensitivity moved since calibration")] = None

    @property
    def sensitivity_per_N(self) -> float | None:
        """Output per force [1/N]; None where it is the virtual cell's."""
        if self.rated_output is None or self.capacity is None:
            return None
        return self.rated_output / self.capacity

    def faults(self) -> Iterator[Fault]:
        """Yield a sensitivity of which half is missing."""
        if (self.rated_output is None) != (self.capacity is None):
            key = "rated_output" if self.rated_output is None else "capacity"
            yield Fault(
                key=(key,), kind="missing", expected="rated_output (mV/V) and capacity (force), both or none"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class CellsEntries:
    """The three cells."""

    D51: Annotated[CellEntries, Entry("fore cell")] = field(default_factory=CellEntries)
    D52: Annotated[CellEntries, Entry("aft cell")] = field(default_factory=CellEntries)
    E5: Annotated[CellEntries, Entry("cell opposite to both")] = field(default_factory=CellEntries)
    crosstalk_FZ_FY: Annotated[
        float | None, Unit("1"), Entry("share of the load that shows as FY", key="crosstalk")
    ] = None

    def truth(self) -> CellsTruth:
        """Return the cells with what is stated put in."""
        default = CellsTruth()
        return dataclasses.replace(
            filled(default, self),
            D51=filled(default.D51, self.D51),
            D52=filled(default.D52, self.D52),
            E5=filled(default.E5, self.E5),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class AcquisitionEntries(AcquisitionTruth):
    """The acquisition, and how it records."""

    record: Annotated[Record, Entry("settled blocks alone, or every row")] = "dwell"


def _counts_up(name: str) -> bool:
    return "{number}" in name and Path(name).name == name and name.endswith(".xlsx")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanFile:
    """A plan as its file states it: the machine by name, the tire by file, runs that leave out the plan's."""

    FORMAT: ClassVar[Format] = Format(title="simulation plan", next_step="correct the plan", schema=1)

    kind: Annotated[Kind, Entry("a test, a reference-load session, or a maker's flat-surface table")] = "test"
    title: Annotated[
        str | None, Text(empty=True, numbers="any"), Entry("default: the file's name", example="virtual test")
    ] = None
    date: Annotated[str, Day(), Entry("the day on which it is run", expected="a date such as 2026-03-17")]
    machine: Annotated[str, Entry("a machine definition that is simulated")] = SIMULATED_MACHINE
    seed: Annotated[int, AtLeast(0), Entry("of the random numbers")] = 0
    label: Annotated[
        tuple[tuple[str, str], ...],
        Keyed(),
        Names("size", "company", "DOT", "series", "construction", "rim"),
        Text(empty=True, numbers="any"),
        Entry("what test.toml says of the tire", example={"size": "205/55R16"}),
    ] = ()
    rotations: Annotated[
        tuple[Rotation, ...] | None, Size(1), Entry("directions of the drum; default: the machine's")
    ] = None
    slip_angles_rad: Annotated[
        tuple[float, ...] | None, Unit("deg"), Size(1),
        Entry("in their order; default: the protocol's", key="slip_angles"),
    ] = None  # fmt: skip
    loads_N: Annotated[
        tuple[float, ...] | None, Unit("N"), Size(1), Entry("default: the protocol's", key="loads")
    ] = None
    pressure_Pa: Annotated[
        float | None, Unit("kPa"), Entry("default: the tire file's, else 34 psi", key="pressure")
    ] = None
    file_name: Annotated[
        str, Text(accepts=_counts_up),
        Entry(
            "of the recordings, which count up", example="FM_run_{number}.xlsx",
            expected="a plain file name with {number} that ends in .xlsx",
        ),
    ] = "FM_run_{number}.xlsx"  # fmt: skip
    tire: Annotated[TireEntries, Entry("the tire that is tested")] = field(default_factory=TireEntries)
    road: Annotated[RoadTruth, Entry("run-out of the drum")] = field(default_factory=RoadTruth)
    carriage: Annotated[CarriageTruth, Entry("where the wheel is held")] = field(
        default_factory=CarriageTruth
    )
    cells: Annotated[CellsEntries, Entry("the load cells")] = field(default_factory=CellsEntries)
    acquisition: Annotated[AcquisitionEntries, Entry("filter, noise and rows")] = field(
        default_factory=AcquisitionEntries
    )
    session: Annotated[SessionTruth, Entry("the reference-load session, of kind session")] = field(
        default_factory=SessionTruth
    )
    motion: Annotated[Motion, Entry("how the machine moves, and what it stands in")] = field(
        default_factory=Motion
    )
    effects: Annotated[
        tuple[str, ...],
        Entry(
            "each as --effect takes it", example=["plysteer=0.2deg"],
            expected='["NAME=VALUE"], each as --effect takes it',
        ),
    ] = ()  # fmt: skip
    case: Annotated[CasePlan, Entry("what a diagnosis case is made of")] = field(default_factory=CasePlan)
    run: Annotated[
        tuple[RunSteps, ...] | None, Size(1),
        Entry("recordings; default: one for each direction and slip angle"),
    ] = None  # fmt: skip


def filled(default: T, entries: object) -> T:
    """Return a stage with the numbers that its entries state put in."""
    names = [field.name for field in dataclasses.fields(cast("Any", default))]
    stated = {name: value for name in names if (value := getattr(entries, name, None)) is not None}
    return cast("T", dataclasses.replace(cast("Any", default), **stated))
