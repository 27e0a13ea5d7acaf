"""A test folder: what its ``test.toml`` states, and the recordings that belong to it.

Stated are the test, its tire and tare, and what its report says by ISO/IEC 17025 7.8.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from toolkit.channels import Reversal, Rotation
from toolkit.declared import (
    Above,
    AtLeast,
    Day,
    Entry,
    Fault,
    Format,
    Keyed,
    Quantity,
    Short,
    Source,
    Text,
    Unit,
    build,
    read_text,
    refuse,
)
from toolkit.errors import ConfigError, RecordingError
from toolkit.files import real_path
from toolkit.inputs import SETTINGS_FILE, is_regular, read_input
from toolkit.machine import Machine, Protocol, load_machine, read_protocol
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.publication import settle
from toolkit.recording.marks import is_own_output
from toolkit.recording.model import TestInfo
from toolkit.spelling import nearest
from toolkit.units import from_si, si_scale, unit

# A series or a DOT code may be written as a number.
_Text = Annotated[str | None, Text(empty=True, strip=True, numbers="any")]
_Statement = Annotated[str | None, Text(strip=True)]
TEST_FILE = "test.toml"
_PROCESS, _REPORT = "toolkit process", "the report template of a new home"
_LITTER = ("Thumbs.db", "desktop.ini", "__MACOSX")  # what file managers leave behind


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
    amends: Annotated[
        _Statement, Entry("id of the report that this one replaces (7.8.8)", together="amendment")
    ] = None
    amendment: Annotated[_Statement, Entry("why it is replaced", together="amends")] = None
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

    size: Annotated[_Text, Entry(example="205/55R16", asked=_REPORT)] = None
    company: Annotated[_Text, Entry("who made it", asked=_REPORT)] = None
    DOT: Annotated[_Text, Entry("its code", asked=_REPORT)] = None
    series: Annotated[_Text, Entry(example=55, asked=_REPORT)] = None
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
    u: Annotated[
        tuple[tuple[str, float], ...] | None, Keyed(), Unit(plain=True), AtLeast(0),
        Entry("standard uncertainty of every value; without it, that of a row of the recordings",
              example={"D51": 0.0001}, together="values"),
    ] = None  # fmt: skip

    def faults(self) -> Iterator[Fault]:
        """Yield a tare that is stated twice."""
        if self.file is not None and self.values is not None:
            yield Fault(got="file and values", what="stands twice", expected="one of the two")
        if self.u is not None and dict(self.u).keys() != dict(self.values or ()).keys():
            yield Fault(got="u", what="does not name the cells of values", expected="a u of every value")


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
    date: Annotated[str | None, Day(moment=True), Entry("of the test", asked=_PROCESS)] = None
    operator: Annotated[_Text, Entry("who tested", asked=_REPORT)] = None
    requestor: Annotated[_Text, Entry("who asked for the test", asked=_REPORT)] = None
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
    pressure: Annotated[float | None, Unit("kPa"), Above(0), Entry("of inflation", asked=_REPORT)] = None
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
    sweeps: Annotated[
        tuple[tuple[str, float], ...], Keyed(), Unit("km/h"), Above(0),
        Entry("recordings in which the slip angle is steered in time, with the surface speed of each",
              example={"sweep 1.xlsx": {"value": 4, "unit": "km/h"}}),
    ] = ()  # fmt: skip
    tare: Annotated[Tare | None, Entry("the unloaded cells")] = None
    report: Annotated[ReportDetails | None, Entry("what the report says beyond the measurement")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TestFolder:
    """A test as it lies on the disk.

    ``files``: the recordings, sorted by their path, without the tare's. ``rotations``: direction by file;
    ``sweeps``: surface speed [m/s] by file of those in which the slip angle is steered in time;
    ``tare_values``: (indication, value, unit), in the machine's unit, ``tare_u`` what it states of
    them; ``protocol`` that of the test's own file, None where the machine's applies.
    """

    __test__ = False  # not a pytest class

    info: TestInfo
    folder: Path
    files: tuple[Path, ...]
    rotation: Rotation
    rotations: tuple[tuple[Path, Rotation], ...]
    tare_file: Path | None
    tare_values: tuple[tuple[str, float, str], ...]
    tare_u: tuple[tuple[str, float], ...]
    protocol: Protocol | None = None
    sweeps: tuple[tuple[Path, float], ...] = ()

    def rotation_of(self, path: Path) -> Rotation:
        """Return the direction of the drum in a file: its own, else that of the test."""
        for sense, rotation in self.rotations:
            if sense == path:
                return rotation
        return self.rotation


def nearest_test_toml(path: Path) -> Path | None:
    """Return the ``test.toml`` that a recording belongs to: the nearest at or above it, None without one."""
    start = Path(os.path.abspath(path))  # noqa: PTH100  links are not followed
    for folder in (start, *start.parents):
        candidate = folder / TEST_FILE
        if is_regular(candidate):
            return candidate
    return None


def read_test_folder(folder: Path) -> TestFolder:
    """Read a test folder's ``test.toml`` and list its recordings, which are not opened for their values.

    A sub-folder without a ``test.toml`` of its own belongs to the test. Links are not followed; dot files,
    Excel's lock files and the toolkit's own results are no recordings.

    Raises
    ------
    ConfigError
        the folder or its ``test.toml`` is missing, a key is unknown, a value has the wrong type, or a file
        that it names is not there
    RecordingError
        rule ``no-recordings``: the folder holds none
    UnitError
        a quantity's unit is unknown or of another dimension
    """
    if not folder.is_dir():
        raise ConfigError(
            "the test folder does not exist",
            where=folder,
            got="a file" if folder.exists() else "nothing",
            expected=f"a folder with {TEST_FILE} and the recordings",
            next_step="check the path",
            rule="no-test",
        )
    settle(folder)
    toml = folder / TEST_FILE
    if not toml.is_file():
        raise ConfigError(
            f"the folder has no {TEST_FILE}",
            where=folder,
            got="no such file",
            expected=f"{TEST_FILE} with at least machine and date",
            next_step=f"begin one with 'toolkit test new {folder / TEST_FILE}'",
            rule="no-test",
        )
    data = read_input(toml, SETTINGS_FILE)
    entries = read_text(StatedTest, data, where=toml)
    source = Source(where=toml, text=data.decode("utf-8-sig"))
    machine_name = _machine_name(entries, toml)
    machine = _machine(machine_name, source)
    # By path, relative to the test, as a machine definition is.
    plan = None if entries.protocol is None else toml.parent / entries.protocol
    settings = (Path(machine_name), plan)
    files = tuple(sorted(path for path in _recordings(folder) if path not in settings))
    tare_file, tare_values = _tare(entries.tare or Tare(), machine, folder, source)
    tests = tuple(path for path in files if path != tare_file)
    if not tests:
        raise RecordingError(
            "the test has no recordings",
            where=folder,
            got=f"{TEST_FILE}{' and a tare file' if tare_file else ''} and no recording",
            expected="the files that the acquisition program wrote",
            next_step="copy the recordings into the folder",
            rule="no-recordings",
        )
    return TestFolder(
        info=_info(entries, machine_name, machine, folder),
        folder=folder,
        files=tests,
        rotation=entries.rotation,
        rotations=tuple(
            (_named_file(name, ("rotations", name), folder, files, source), rotation)
            for name, rotation in entries.rotations
        ),
        tare_file=tare_file,
        tare_values=tare_values,
        tare_u=tuple(
            _tare_value(name, u, machine, source, key="u")[:2]
            for name, u in (entries.tare.u or () if entries.tare is not None else ())
        ),
        protocol=None if plan is None else read_protocol(plan),
        sweeps=tuple(
            (_named_file(name, ("sweeps", name), folder, files, source), float(speed))
            for name, speed in entries.sweeps
        ),
    )


def _recordings(folder: Path) -> Iterator[Path]:
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise RecordingError(
            "a folder cannot be read", where=folder, got=error.strerror, expected="a readable folder",
            next_step="check its permissions", rule="no-file",
        ) from error  # fmt: skip
    for entry in entries:
        if entry.name.startswith((".", "~$")) or entry.name in _LITTER or entry.is_symlink():
            continue
        if entry.is_dir():
            if not (entry / TEST_FILE).is_file():
                yield from _recordings(entry)
        elif entry.is_file() and entry.name != TEST_FILE and not is_own_output(entry):
            yield entry


def _machine(name: str, source: Source) -> Machine:
    try:
        return load_machine(name)
    except ConfigError as error:
        if error.where is None:
            refuse(
                [Fault(key=("machine",), got=error.got, expected=str(error.expected), what=error.what,
                       rule=error.rule, form=Format(next_step=str(error.next_step)))],
                source,
            )  # fmt: skip
        raise


def _machine_name(entries: StatedTest, toml: Path) -> str:
    # A definition by path is meant relative to the test, whatever folder the command runs in.
    return str(toml.parent / entries.machine) if entries.machine.endswith(".toml") else entries.machine


def _info(entries: StatedTest, machine_name: str, machine: Machine, folder: Path) -> TestInfo:
    tire = entries.tire or TireLabel()
    return TestInfo(
        name=real_path(folder).name,
        machine=machine_name,
        date=entries.date,
        operator=entries.operator,
        requestor=entries.requestor,
        surface=entries.surface,
        special=entries.special,
        speed_m_s=entries.speed,
        pressure_Pa=entries.pressure,
        rated_load_N=entries.rated_load,
        tire_size=tire.size,
        tire_company=tire.company,
        tire_DOT=tire.DOT,
        tire_series=tire.series,
        tire_construction=tire.construction,
        tire_rim=tire.rim,
        simulated=entries.simulated or machine.simulated,
        reversal=entries.reversal,
        mounting=entries.mounting,
        laboratory=entries.laboratory,
        tire_belt=tire.belt,
    )


def _named_file(
    name: str, key: tuple[str, ...], folder: Path, files: tuple[Path, ...], source: Source
) -> Path:
    names = {path.relative_to(folder).as_posix(): path for path in files}
    if name in names:
        return names[name]
    by_name = [path for path in files if path.name == name]
    if len(by_name) == 1:
        return by_name[0]
    near = nearest(name, names)
    _, line = source.place(key)
    raise ConfigError(
        f"{TEST_FILE} names a file that is {'not there' if not by_name else 'there more than once'}",
        where=f"{source.where}, [{key[0]}]",
        line=None if line is None else source.excerpt(line),
        got=name,
        expected=near if near else ", ".join(list(names)[:12]) or "a recording of the folder",
        next_step=f"did you mean {near!r}?" if near else "correct the name, with its sub-folder",
        rule="no-file",
    )


def _tare(
    tare: Tare, machine: Machine, folder: Path, source: Source
) -> tuple[Path | None, tuple[tuple[str, float, str], ...]]:
    if tare.file is not None:
        path = folder / tare.file
        inside = ".." not in Path(tare.file).parts and not Path(tare.file).is_absolute()
        if not inside or path.is_symlink() or not is_regular(path):
            files = tuple(sorted(_recordings(folder)))
            return _named_file(tare.file, ("tare", "file"), folder, files, source), ()
        return path, ()
    if tare.values is None:
        return None, ()
    names, cells = [name for name, _ in tare.values], [column.symbol for column in machine.indications]
    refuse(
        [
            Fault(
                key=("tare", "values", name), got=name, expected=", ".join(cells), kind="unknown",
                near=nearest(name, cells, names),
            )
            for name in names
            if name not in cells
        ],
        source,
    )  # fmt: skip
    if set(names) != set(cells):
        raise ConfigError(
            "the tare lacks a load cell",
            where=f"{source.where}, [tare] values",
            got=", ".join(names) or "no values",
            expected=", ".join(cells),
            next_step="state every cell's unloaded indication, or name a recording with '[tare] file'",
            rule="tare-incomplete",
        )
    return None, tuple(_tare_value(name, value, machine, source) for name, value in tare.values)


def _tare_value(
    name: str, value: float, machine: Machine, source: Source, *, key: str = "values"
) -> tuple[str, float, str]:
    cell_unit = machine.column(name).unit
    number, unit_name = (value.value, value.unit) if isinstance(value, Quantity) else (value, "")
    if not unit_name or unit(unit_name).text == cell_unit:
        return name, float(number), cell_unit
    scale = si_scale(unit_name, unit(cell_unit).dimension, where=f"{source.where}, [tare] {key}.{name}")
    return name, float(from_si(float(number) * scale, cell_unit)), cell_unit
