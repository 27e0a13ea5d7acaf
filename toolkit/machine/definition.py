"""A machine definition (TOML): columns and their units, geometry, drum, protocol, what is stated of it.

Its next version is the old text, its version one higher, and one more correction.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from toolkit.channels import CHANNELS, Axes, Rotation, signs
from toolkit.declared import (
    Above,
    AtLeast,
    Distinct,
    Entry,
    Fault,
    Format,
    Keyed,
    Names,
    Size,
    Source,
    Unit,
    UnitName,
    build,
    plain,
    refuse,
    toml_text,
)
from toolkit.declared.faults import lines_of
from toolkit.errors import ConfigError
from toolkit.files import parse_toml, sha256_bytes
from toolkit.inputs import SETTINGS_FILE, is_regular, read_input
from toolkit.machine.correction import Correction
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.machine.hub import Hub, Loading
from toolkit.machine.protocol import Protocol, Sweeping
from toolkit.units import unit

Road = Literal["convex", "concave", "flat"]
Role = Literal["load", "indication", "slip_angle", "acquired", "time", "angle", "covariate"]

_PACKAGED = Path(__file__).parent
_DIMENSIONS: dict[Role, tuple[str, ...]] = {
    "load": ("force",),
    "slip_angle": ("angle",),
    "acquired": ("force", "moment"),
    "time": ("time",),
    "angle": ("angle",),
}
_INDICATIONS = Names(of="column.symbol", role="indication")
_LOADS = Names(*(c.symbol for c in CHANNELS.values() if c.dimension in ("force", "moment")))


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of the machine's own files: ``header`` as written there, ``unit`` as meant there."""

    symbol: Annotated[str, Entry("the channel's symbol", example="FZ")]
    header: Annotated[str, Entry("as the machine's files print it", example="FZ load")]
    unit: Annotated[str, UnitName(), Entry("of the numbers in the column")]
    role: Annotated[Role, Entry("what the column holds")]

    def faults(self) -> Iterator[Fault]:
        """Yield a unit in which what the column holds cannot be."""
        dimensions = _DIMENSIONS.get(self.role)
        dimension = unit(self.unit).dimension
        if dimensions is not None and dimension not in dimensions:
            yield Fault(
                key=("unit",), got=self.unit, expected=f"a unit of {' or '.join(dimensions)}",
                what=f"{self.unit} is a unit of {dimension}", rule="unit-dimension",
            )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Drum:
    """The road: circumference [m], None of a flat belt or a track, surface speed and its tolerance [m/s].

    ``road`` None is the outside of a drum where there is a circumference, and flat where there is none.
    """

    surface: Annotated[str, Entry("what the road is like", example="convex")]
    road: Annotated[
        Road | None,
        Entry("convex: outside a drum; concave: inside a drum; flat: a belt or a trailer's road; "
              "default: convex with a circumference, flat without", example="flat"),
    ] = None  # fmt: skip
    circumference_m: Annotated[
        float | None, Unit("m"), Above(0),
        Entry("of a drum's surface; a flat belt has none", key="circumference"),
    ] = None  # fmt: skip
    speed_m_s: Annotated[float, Unit("km/h"), Above(0), Entry("of the surface", key="speed")]
    speed_tolerance_m_s: Annotated[
        float, Unit("km/h"), AtLeast(0), Entry("about that speed", key="speed_tolerance")
    ]

    def faults(self) -> Iterator[Fault]:
        """Yield a drum without its circumference, and a flat road with one."""
        if self.road in ("convex", "concave") and self.circumference_m is None:
            yield Fault(
                key=("circumference",), got=None, expected='{ value = NUMBER, unit = "m" }',
                what=f"is not stated, and a {self.road} road is a drum's",
            )  # fmt: skip
        if self.road == "flat" and self.circumference_m is not None:
            yield Fault(
                key=("circumference",), got=self.circumference_m, expected="none of a flat road",
                what="is that of a drum, and the road is flat",
            )  # fmt: skip

    @property
    def curvature_per_m(self) -> float:
        """Curvature of the road [1/m]: positive on a drum, negative inside one, 0 where it is flat."""
        return (-1 if self.road == "concave" else 1) / self.radius_m

    @property
    def text(self) -> str:
        """The road in words, for messages and files."""
        if self.road == "flat":
            return "a flat road"
        side = "inside" if self.road == "concave" else "outside"
        return f"the {side} of a drum of radius {self.radius_m:.3f} m"

    def contact_length_factor(self, tire_radius_m: float) -> float:
        """Return the length of the contact patch over that on a flat road, at one deflection of the tire.

        Circles of radii Rt and Rd that enter each other by a small depth d meet over a chord of
        2 sqrt(2 d / (1/Rt + k)), with k the road's curvature: sqrt(Rd / (Rd + Rt)) of Pacejka (Tire and
        Vehicle Dynamics, 3rd ed. 2012, 3.2) on a drum, sqrt(Rd / (Rd - Rt)) inside one.

        Raises
        ------
        ValueError
            the tire does not fit into the drum

        >>> inside = Drum(surface="steel", road="concave", circumference_m=4 * math.pi, speed_m_s=1.0,
        ...               speed_tolerance_m_s=0.1)
        >>> round(inside.contact_length_factor(0.56) ** 2, 9), inside.curvature_per_m  # 1 / 0.72
        (1.388888889, -0.5)
        """
        relative = 1 + self.curvature_per_m * tire_radius_m
        if relative <= 0:
            raise ValueError(f"a tire of {tire_radius_m:g} m does not fit into a drum of {self.radius_m:g} m")
        return 1 / math.sqrt(relative)

    @property
    def radius_m(self) -> float:
        """Radius of the drum [m]; a flat road is one without end."""
        return math.inf if self.circumference_m is None else self.circumference_m / (2 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellLayout:
    """Where the load cells are: the circle through them, the lever of each about the longitudinal axis."""

    pitch_diameter_m: Annotated[
        float | None, Unit("m"), Above(0), Entry("of the circle through the cells", key="pitch_diameter")
    ] = None
    overturning_lever_m: Annotated[
        tuple[tuple[str, float], ...], Keyed(), _INDICATIONS, Unit("m", plain=True),
        Entry("of each cell, with its sign", key="overturning_lever", example={}),
    ] = ()  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class CellPolarity:
    """The signs of one cell: ``signs`` are pairs of a load and +1 or -1, ``source`` says who states them.

    A sign is that of d load / d indication in the load's equation: +1 where the load grows with the
    indication while the other cells stay as they are.
    """

    name: Annotated[str, _INDICATIONS, Entry("symbol of the cell's column")]
    signs: Annotated[
        tuple[tuple[str, Literal[1, -1]], ...], Keyed(), _LOADS, Size(1),
        Entry("sign by load: 1 where the load grows with the indication", key="polarity", example={"FY": 1}),
    ]  # fmt: skip
    source: Annotated[str, Entry("who states it, and where")]

    def sign(self, load: str) -> int | None:
        """Return +1 or -1 for a load; None where the definition states none."""
        return dict(self.signs).get(load)


# What may be stated, of which dimension, and with which of the numbers: what is not used is not accepted.
_STATED = {
    "FZ": ("force", "u", "relative"),
    "zero": ("", "relative"),
    "SA": ("angle", "u"),
    "SA_scale": ("", "relative"),
    "P": ("pressure", "u", "relative", "effect"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeB:
    """A stated standard uncertainty: ``u`` [SI] and ``relative`` of the value, and its source.

    ``common`` says who draws it: one error of the ``machine``, the same in all its tests, or another one in
    each ``test``. ``effect`` is that of a condition which is not measured in a force: the relative change
    of a force for a relative change of the condition.
    """

    symbol: str
    u: Annotated[float, Unit("N", "deg", "kPa", beside="unit"), AtLeast(0), Entry("standard uncertainty")] = (
        0.0
    )
    relative: Annotated[float, AtLeast(0), Entry("standard uncertainty as a part of the value")] = 0.0
    source: Annotated[str, Entry("what it rests on")]
    common: Annotated[
        Literal["machine", "test"],
        Entry("one error in all tests of the machine, or another one in each test"),
    ] = "test"
    effect: Annotated[float, Entry("relative change of a force for one of the condition")] = 0.0

    def faults(self) -> Iterator[Fault]:
        """Yield numbers that are not used for this symbol, and a unit of another dimension."""
        dimension, *numbers = _STATED[self.symbol]
        for key in ("u", "relative", "effect"):
            if getattr(self, key) and key not in numbers:
                yield Fault(
                    key=(key,), got=getattr(self, key), expected=", ".join(numbers),
                    what=f"is not used for {self.symbol}",
                )  # fmt: skip
        written = getattr(self.u, "unit", None)
        if self.u and "u" in numbers and written is not None and unit(written).dimension != dimension:
            yield Fault(
                key=("unit",), got=written, expected=f"a unit of {dimension}",
                what=f"{written} is a unit of {unit(written).dimension}", rule="unit-dimension",
            )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """A tire test machine as data.

    ``version`` counts its definitions; ``supersedes`` is the SHA-256 of the file that this one was made from,
    and ``corrections`` what the reduction of every test on it puts right. ``cells`` are the signs that its
    load cells must have, ``rated_loads`` pairs of a load and its rated value [N, N*m].
    """

    FORMAT: ClassVar[Format] = Format(
        title="machine definition", schema=1,
        next_step="correct {key}; " f"the packaged {DEFAULT_MACHINE}.toml shows every entry",
    )  # fmt: skip

    name: Annotated[str, Entry("of the machine, and of the instrument in its calibrations", example="belt-2")]
    extends: Annotated[
        str | None,
        Entry("packaged machine whose entries hold where this file states none", example=DEFAULT_MACHINE),
    ] = None
    title: Annotated[str, Entry("for reports")]
    kind: Annotated[Literal["real", "simulated"], Entry("whether its data are measured")]
    axes: Annotated[Axes, Entry("axis system of the machine's files")]
    rotations: Annotated[
        tuple[Rotation, ...],
        Size(1),
        Distinct(),
        Entry("directions of the drum", example=["forward", "reverse"]),
    ]
    version: Annotated[int, AtLeast(1), Entry("counts the definitions of this machine")] = 1
    supersedes: Annotated[str | None, Entry("SHA-256 of the definition that this one was made from")] = None
    indication_unit: Annotated[
        str | None,
        UnitName(),
        Entry("unit of every indication, in place of the columns' own", example="mV/V"),
    ] = None
    sample_rate_Hz: Annotated[
        float | None, Unit("Hz"), Above(0), Entry("of the recordings", key="sample_rate")
    ] = None
    columns: Annotated[
        tuple[Column, ...], Size(1), Distinct("symbol"),
        Entry("one entry a column of the machine's files, in their order", key="column"),
    ]  # fmt: skip
    drum: Annotated[Drum, Entry("the road")]
    layout: Annotated[CellLayout, Entry("where the load cells are", key="cells")] = CellLayout()
    cells: Annotated[
        tuple[CellPolarity, ...], Distinct("name"), Entry("signs that a cell must have", key="cell")
    ] = ()
    hub: Annotated[
        Hub | None, Entry("what its cells measure beside FY and MZ, where a record calibrates it")
    ] = None
    rated_loads: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Unit("N", "N*m"), Above(0),
        Entry("rated value by load", key="rated_load", example={"FY": {"value": 6000, "unit": "N"}}),
    ] = ()  # fmt: skip
    loading: Annotated[
        Loading | None, Entry("fixtures that calibrate its cells: what `toolkit plan session` may load")
    ] = None
    sweeping: Annotated[
        Sweeping | None, Entry("what it can record in time: what a relaxation length is planned by")
    ] = None
    protocol: Annotated[Protocol, Entry("the machine's default; a test may name another one")]
    type_b: Annotated[
        tuple[TypeB, ...], Keyed("symbol"), Names(*_STATED),
        Entry("standard uncertainties of what has no calibration record of its own"),
    ] = ()  # fmt: skip
    corrections: Annotated[
        tuple[Correction, ...],
        Entry("what a reduction puts right, by decision", key="correction", by_command="machine correct"),
    ] = ()

    @property
    def simulated(self) -> bool:
        """Whether its data are simulated."""
        return self.kind == "simulated"

    @property
    def SA_to_SAE(self) -> int:
        """Sign in SAE axes of a slip angle as the machine shows it: in its files and in its protocol."""
        return signs(self.axes, "SAE")["SA"]

    @property
    def indications(self) -> tuple[Column, ...]:
        """The load cells' columns, in file order."""
        return tuple(column for column in self.columns if column.role == "indication")

    def cell(self, name: str) -> CellPolarity | None:
        """Return the stated signs of a cell; None where the definition states none."""
        return next((cell for cell in self.cells if cell.name == name), None)

    def column(self, symbol: str) -> Column:
        """Return the column of a symbol; KeyError where the machine has none."""
        for column in self.columns:
            if column.symbol == symbol:
                return column
        raise KeyError(symbol)

    def stated_uncertainty(self, symbol: str) -> TypeB:
        """Return the stated uncertainty of a channel, zero where none is stated."""
        for statement in self.type_b:
            if statement.symbol == symbol:
                return statement
        return TypeB(symbol=symbol, u=0.0, relative=0.0, source="not stated")

    def faults(self) -> Iterator[Fault]:
        """Yield a header that two columns have, and turns of a drum whose circumference nobody states."""
        if self.protocol.revolutions_of == "drum" and self.drum.circumference_m is None:
            yield Fault(
                key=("drum", "circumference"), got=None, expected='{ value = NUMBER, unit = "m" }',
                what="is not stated, and the protocol counts the drum's revolutions",
            )  # fmt: skip
        headers = [column.header for column in self.columns]
        for number, header in enumerate(headers):
            if header in headers[:number]:
                yield Fault(
                    key=("column", number, "header"), got=header, expected="each header once",
                    what=f'"{header}" stands twice',
                )  # fmt: skip


def machine_names() -> tuple[str, ...]:
    """Return the names of the packaged machines."""
    return tuple(sorted(path.stem for path in _PACKAGED.glob("*.toml")))


def load_machine(name_or_path: str) -> Machine:
    """Return a packaged machine by name, or one from a .toml file by path.

    Raises
    ------
    ConfigError
        an unknown name; every entry that is unknown, missing or cannot be used

    Examples
    --------
    >>> m15 = load_machine("m15")
    >>> [column.symbol for column in m15.columns]
    ['FZ', 'D52', 'D51', 'E5', 'SA', 'FY', 'MZ']
    >>> round(m15.drum.radius_m, 3)
    1.353
    """
    path = machine_file(name_or_path)
    if not is_regular(path):
        raise ConfigError(
            f"unknown machine {name_or_path!r}",
            where=path if name_or_path.endswith(".toml") else None,
            got=name_or_path,
            expected=", ".join(machine_names()),
            next_step="name one of those, or give the path of a machine definition (.toml)",
            rule="unknown-machine",
        )
    return machine_of_text(read_input(path, SETTINGS_FILE), path)


def own_text(name_or_path: str) -> str:
    """Return the text of a definition that was given by its path; empty of a packaged one."""
    if not name_or_path.endswith(".toml"):
        return ""
    text = read_input(machine_file(name_or_path), SETTINGS_FILE).decode("utf-8-sig")
    return text.replace("\r\n", "\n")


def machine_file(name_or_path: str) -> Path:
    """Return the file of a packaged machine, or the path of a .toml that was given."""
    return Path(name_or_path) if name_or_path.endswith(".toml") else _PACKAGED / f"{name_or_path}.toml"


@lru_cache(maxsize=32)  # by what stands in the file: a definition may be edited while a program runs
def machine_of_text(data: bytes, path: Path) -> Machine:
    """Return the machine of a definition's content; ``path`` names it, errors as `load_machine`."""
    table, source = _extended(data, path, ())
    machine = build(Machine, table, source)
    if machine.indication_unit is None:
        return machine
    return dataclasses.replace(
        machine,
        columns=tuple(
            dataclasses.replace(column, unit=machine.indication_unit)
            if column.role == "indication"
            else column
            for column in machine.columns
        ),
    )


def _extended(data: bytes, path: Path, extending: tuple[Path, ...]) -> tuple[dict[str, Any], Source]:
    """Return the entries of a definition with those of the one that it extends, and where each stands."""
    table = parse_toml(data, where=path)
    source = Source(where=path, text=data.decode("utf-8-sig"))
    if "extends" not in table:
        return table, source
    name, names = table["extends"], machine_names()
    circle = isinstance(name, str) and _PACKAGED / f"{name}.toml" in (*extending, path)
    if circle or name not in names:
        circle_text = "a definition extends itself" if circle else None
        fault = Fault(
            key=("extends",), got=name, expected=", ".join(names), what=circle_text, form=Machine.FORMAT,
            rule="unknown-machine",
        )  # fmt: skip
        refuse([fault], source)
    base_path = machine_file(name)
    base, base_source = _extended(read_input(base_path, SETTINGS_FILE), base_path, (*extending, path))
    inherited: set[tuple[str, ...]] = {(key,) for key in base if key not in table}
    statement, base_stated = table.get("type_b", {}), base.get("type_b", {})
    if isinstance(statement, dict):  # one new figure must not silently drop the others
        inherited |= {("type_b", symbol) for symbol in base_stated if symbol not in statement}
        table["type_b"] = {**base_stated, **statement}
    merged = Source(where=path, text=source.text, base=base_source, inherited=frozenset(inherited))
    return {**base, **table}, merged


def next_version(
    machine: str, correction: Correction, *, out: Path, diagnosed_with: str | None
) -> tuple[str, Machine]:
    """Return text and content of a machine's next version with a correction in it; nothing is written.

    Parameters
    ----------
    machine : name of a packaged machine, or the path of a definition
    out : where the text will lie; it names it in messages
    diagnosed_with : SHA-256 of the definition that the answer's case had, None where it named none

    Raises
    ------
    ConfigError
        no such machine; ``machine-correction``: it is corrected already, or the correction cannot be
    """
    path = machine_file(machine)
    data = read_input(path, SETTINGS_FILE)
    old = machine_of_text(data, path)
    for earlier in old.corrections:
        if earlier.label == correction.label and diagnosed_with != sha256_bytes(data):
            raise ConfigError(
                "the machine has this correction already", where=path, got=earlier.as_text(),
                expected="an answer of recordings that were diagnosed with this version",
                next_step=f"diagnose the case with machine = {path.name!r}, and correct what is left",
                rule="machine-correction",
            )  # fmt: skip
    numbers = {"version": old.version + 1, "supersedes": sha256_bytes(data)}
    text = _with_entries(data.decode("utf-8-sig"), toml_text(numbers))
    text += "\n" + toml_text({"correction": [plain(correction)]})
    return text, machine_of_text(text.encode(), out)


def _with_entries(text: str, entries: str) -> str:
    """Return the text with these entries of its top level below the name, in place of any older ones."""
    places, lines = lines_of(text), text.splitlines()
    older = {places[key,] for key in ("version", "supersedes") if (key,) in places}
    after = places.get(("name",), 0)
    numbered = [line for number, line in enumerate(lines, start=1) if number not in older or number == after]
    after -= sum(number < after for number in older)
    return "\n".join([*numbered[:after], entries.rstrip(), *numbered[after:]]).rstrip() + "\n"
