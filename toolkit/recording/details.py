"""What a ``test.toml`` states: the test, its tire and tare, and what its report says by ISO/IEC 17025 7.8."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

from toolkit.channels import Reversal, Rotation
from toolkit.declared import Above, Day, Entry, Fault, Format, Keyed, Short, Source, Text, Unit, build
from toolkit.machine.default import DEFAULT_MACHINE

# A series or a DOT code may be written as a number.
_Text = Annotated[str | None, Text(empty=True, strip=True, numbers="any")]
_Statement = Annotated[str | None, Text(strip=True)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Opinion:
    """A statement that is not a result: an opinion or interpretation, and what it rests on (7.8.7)."""

    statement: Annotated[str, Text(strip=True)]
    basis: _Statement = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportDetails:
    """Facts of one report; None where nothing is said."""

    customer: Annotated[_Statement, Entry("for whom the test was made (7.8.2.1 e)")] = None
    customer_contact: Annotated[_Statement, Entry("of the customer (7.8.2.1 e)")] = None
    item: Annotated[_Statement, Entry("what was tested (7.8.2.1 g)")] = None
    condition: Annotated[_Statement, Entry("state of the item (7.8.2.1 g)")] = None
    received: Annotated[str | None, Day(moment=True), Entry("when the item came (7.8.2.1 h)")] = None
    location: Annotated[_Statement, Entry("where the activity was performed (7.8.2.1 c)")] = None
    method: Annotated[_Statement, Entry("of the test (7.8.2.1 f)")] = None
    deviations: Annotated[_Statement, Entry("what was added to the method or left out (7.8.2.1 n)")] = None
    sampling: Annotated[_Statement, Entry("the sampling plan (7.8.2.1 k)")] = None
    conformity: Annotated[_Statement, Entry("statement of conformity with a requirement (7.8.3.1 b)")] = None
    external: Annotated[_Statement, Entry("results that come from another laboratory (7.8.2.1 p)")] = None
    authorised_by: Annotated[_Statement, Entry("who authorises the report (7.8.2.1 o)")] = None
    function: Annotated[_Statement, Entry("of who authorises the report")] = None
    amends: Annotated[_Statement, Entry("id of the report that this one replaces (7.8.8)")] = None
    amendment: Annotated[_Statement, Entry("why it is replaced; with amends")] = None
    opinions: Annotated[
        tuple[Opinion, ...], Short("statement"),
        Entry("opinions and interpretations, each a text or a table", expected="a list of statements"),
    ] = ()  # fmt: skip

    def faults(self) -> Iterator[Fault]:
        """Yield an amendment without its report or its reason."""
        if (self.amends is None) != (self.amendment is None):
            key = "amendment" if self.amends is None else "amends"
            yield Fault(key=(key,), got=getattr(self, key), expected="amends and amendment, both or none")


def read_details(table: Any, *, where: object) -> ReportDetails:
    """Return the details of a ``[report]`` table.

    Raises
    ------
    ConfigError
        no table, an unknown key, a value of the wrong type, an amendment without its report or its reason
    """
    return build(ReportDetails, table, Source(where=f"{where}, [report]"))


@dataclass(frozen=True, slots=True, kw_only=True)
class TireLabel:
    """What stands on the tire."""

    size: Annotated[_Text, Entry(example="205/55R16")] = None
    company: Annotated[_Text, Entry("who made it")] = None
    DOT: Annotated[_Text, Entry("its code")] = None
    series: Annotated[_Text, Entry(example=55)] = None
    construction: Annotated[_Text, Entry(example="radial")] = None
    rim: Annotated[_Text, Entry(example="16x6.5")] = None
    belt: Annotated[
        Literal["regular", "reversed"] | None, Entry("how a prototype's belt cords were laid")
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Tare:
    """The unloaded cells: a recording of them, or a value of every cell.

    A value without a unit is one in the unit of the cell's column: ``Quantity.unit`` is then empty.
    """

    file: Annotated[_Text, Entry("recording with the tire off the road", example="zero.xlsx")] = None
    values: Annotated[
        tuple[tuple[str, float], ...] | None, Keyed(), Unit(plain=True),
        Entry("of every cell, a number or { value, unit }", example={"D51": 0}),
    ] = None  # fmt: skip

    def faults(self) -> Iterator[Fault]:
        """Yield a tare that is stated twice."""
        if self.file is not None and self.values is not None:
            yield Fault(got="file and values", what="stands twice", expected="one of the two")


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedTest:
    """The test of a folder and of the folders below it."""

    FORMAT: ClassVar[Format] = Format(title="test", schema=1)

    machine: Annotated[
        str, Text(empty=True, strip=True, numbers="any"),
        Entry(
            "name of the machine, or its definition's path", example=DEFAULT_MACHINE,
            expected=f'machine = "{DEFAULT_MACHINE}", or the path of a machine definition',
        ),
    ]  # fmt: skip
    date: Annotated[str | None, Day(moment=True), Entry("of the test")] = None
    operator: Annotated[_Text, Entry("who tested")] = None
    requestor: Annotated[_Text, Entry("who asked for the test")] = None
    surface: Annotated[_Text, Entry("of the road")] = None
    special: Annotated[_Text, Entry("what was special")] = None
    mounting: Annotated[_Text, Entry("tells repeats apart")] = None
    laboratory: Annotated[_Text, Entry("tells repeats apart")] = None
    rotation: Annotated[Rotation, Entry("direction of the drum")] = "forward"
    reversal: Annotated[
        Reversal, Entry("what was turned for runs called reverse: the drum, or the tire on its hub")
    ] = "drum"
    simulated: Annotated[bool, Entry("whether the recordings are simulated")] = False
    speed: Annotated[float | None, Unit("km/h"), Above(0), Entry("surface speed")] = None
    pressure: Annotated[float | None, Unit("kPa"), Above(0), Entry("of inflation")] = None
    rated_load: Annotated[float | None, Unit("N"), Above(0), Entry("of the tire")] = None
    protocol: Annotated[
        str | None, Text(empty=True, strip=True, numbers="any"),
        Entry("the test's own protocol, relative to this file", example="protocol.toml"),
    ] = None  # fmt: skip
    tire: Annotated[TireLabel | None, Entry("what stands on the tire")] = None
    rotations: Annotated[
        tuple[tuple[str, Rotation], ...], Keyed(),
        Entry("direction by recording, where it is another one", example={"run 2.xlsx": "reverse"}),
    ] = ()  # fmt: skip
    tare: Annotated[Tare | None, Entry("the unloaded cells")] = None
    report: Annotated[ReportDetails | None, Entry("what the report says beyond the measurement")] = None
