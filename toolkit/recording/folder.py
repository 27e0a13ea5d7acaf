"""A test folder: ``test.toml`` and the recordings that belong to it."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from toolkit.channels import REVERSALS, ROTATIONS, Reversal, Rotation
from toolkit.errors import ConfigError, RecordingError
from toolkit.files import check_keys, is_number, read_toml
from toolkit.machine import Machine, Protocol, load_machine, read_protocol
from toolkit.machine.quantity import quantity
from toolkit.recording.details import iso_day, read_details, wrong_value
from toolkit.recording.marks import is_own_output
from toolkit.recording.model import TestInfo
from toolkit.units import from_si, si_scale, unit

TEST_FILE = "test.toml"

_KEYS = (
    "schema date machine operator requestor surface special rotation speed pressure rated_load tire "
    "rotations tare simulated protocol reversal mounting laboratory report"
).split()
_LITTER = ("Thumbs.db", "desktop.ini", "__MACOSX")  # what file managers leave behind
_TEXTS = ("operator", "requestor", "surface", "special", "mounting", "laboratory")
_TIRE = ("size", "company", "DOT", "series", "construction", "rim", "belt")
BELTS = ("regular", "reversed")


@dataclass(frozen=True, slots=True, kw_only=True)
class TestFolder:
    """A test as it lies on the disk.

    ``files``: the recordings, sorted by their path, without the tare's. ``rotations``: direction by file;
    ``tare_values``: (indication, value, unit), in the machine's unit; ``protocol`` that of the test's own
    file, None where the machine's applies.
    """

    __test__ = False  # not a pytest class

    info: TestInfo
    folder: Path
    files: tuple[Path, ...]
    rotation: Rotation
    rotations: tuple[tuple[Path, Rotation], ...]
    tare_file: Path | None
    tare_values: tuple[tuple[str, float, str], ...]
    protocol: Protocol | None = None

    def rotation_of(self, path: Path) -> Rotation:
        """Return the direction of the drum in a file: its own, else that of the test."""
        for own, rotation in self.rotations:
            if own == path:
                return rotation
        return self.rotation


def nearest_test_toml(path: Path) -> Path | None:
    """Return the ``test.toml`` that a recording belongs to: the nearest at or above it, None without one."""
    start = Path(os.path.abspath(path))  # noqa: PTH100  resolve() would follow links
    for folder in (start, *start.parents):
        candidate = folder / TEST_FILE
        if candidate.is_file():
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
    toml = folder / TEST_FILE
    if not toml.is_file():
        raise ConfigError(
            f"the folder has no {TEST_FILE}",
            where=folder,
            got="no such file",
            expected=f"{TEST_FILE} with at least machine and date",
            next_step=f"write {TEST_FILE}; 'toolkit demo --out DIR' shows one",
            rule="no-test",
        )
    table = read_toml(toml)
    check_keys(table, _KEYS, where=toml)
    if table.get("schema", 1) != 1:
        raise wrong_value(toml, "schema", table["schema"], "1")
    read_details(table.get("report", {}), where=toml)  # the report reads it again; a slip shows here
    machine = _machine(table, toml)
    plan = _protocol_file(table, toml)
    settings = (Path(_machine_name(table, toml)), plan)
    files = tuple(sorted(path for path in _recordings(folder) if path not in settings))
    tare_file, tare_values = _tare(table.get("tare", {}), machine, folder, toml)
    found = tuple(path for path in files if path != tare_file)
    if not found:
        raise RecordingError(
            "the test has no recordings",
            where=folder,
            got=f"{TEST_FILE}{' and a tare file' if tare_file else ''} and no recording",
            expected="the files that the acquisition program wrote",
            next_step="copy the recordings into the folder",
            rule="no-recordings",
        )
    return TestFolder(
        info=_info(table, machine, folder, toml),
        folder=folder,
        files=found,
        rotation=_rotation(table.get("rotation", "forward"), "rotation", toml),
        rotations=_rotations(table.get("rotations", {}), folder, files, toml),
        tare_file=tare_file,
        tare_values=tare_values,
        protocol=None if plan is None else read_protocol(plan),
    )


def _protocol_file(table: Mapping[str, Any], toml: Path) -> Path | None:
    # By path, relative to the test, as a machine definition is.
    return toml.parent / _text(table["protocol"], "protocol", toml) if "protocol" in table else None


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


def _machine(table: Mapping[str, Any], toml: Path) -> Machine:
    if "machine" not in table:
        raise ConfigError(
            f"{TEST_FILE} names no machine",
            where=toml,
            got="no key 'machine'",
            expected='machine = "m15", or the path of a machine definition',
            next_step="add the line",
            rule="missing-key",
        )
    try:
        return load_machine(_machine_name(table, toml))
    except ConfigError as error:
        if error.where is None:
            error.where = str(toml)
        raise


def _machine_name(table: Mapping[str, Any], toml: Path) -> str:
    # A definition by path is meant relative to the test, whatever folder the command runs in.
    name = _text(table["machine"], "machine", toml)
    return str(toml.parent / name) if name.endswith(".toml") else name


def _info(table: Mapping[str, Any], machine: Machine, folder: Path, toml: Path) -> TestInfo:
    tire = _table(table.get("tire", {}), "tire", toml)
    check_keys(tire, _TIRE, where=f"{toml}, [tire]")
    simulated = table.get("simulated", False)
    if not isinstance(simulated, bool):
        raise wrong_value(toml, "simulated", simulated, "true or false")
    texts = {key: _text(table[key], key, toml) for key in _TEXTS if key in table}
    reversal = table.get("reversal", "drum")
    if reversal not in REVERSALS:
        raise wrong_value(toml, "reversal", reversal, " or ".join(REVERSALS))
    if tire.get("belt", BELTS[0]) not in BELTS:
        raise wrong_value(toml, "tire.belt", tire["belt"], " or ".join(BELTS))
    tires = {f"tire_{key}": _text(value, f"tire.{key}", toml) for key, value in tire.items()}
    return TestInfo(
        name=folder.resolve().name,
        machine=_machine_name(table, toml),
        date=iso_day(table["date"], "date", toml) if "date" in table else None,
        speed_m_s=_positive(table, "speed", "speed", toml),
        pressure_Pa=_positive(table, "pressure", "pressure", toml),
        rated_load_N=_positive(table, "rated_load", "force", toml),
        simulated=simulated or machine.simulated,
        reversal=cast("Reversal", reversal),
        **texts,
        **tires,
    )


def _positive(table: Mapping[str, Any], key: str, dimension: str, toml: Path) -> float | None:
    if key not in table:
        return None
    entry = table[key]
    if isinstance(entry, dict):
        check_keys(entry, ("value", "unit"), where=f"{toml}, {key}")
        if "unit" in entry and not isinstance(entry["unit"], str):
            raise wrong_value(toml, f"{key}.unit", entry["unit"], "a unit as text")
    found = quantity(entry, dimension, f"{toml}, {key}")
    if not (math.isfinite(found) and found > 0):
        raise wrong_value(toml, key, entry["value"], "a positive number")
    return found


def _rotation(value: Any, key: str, toml: Path) -> Rotation:
    if value not in ROTATIONS:
        near = difflib.get_close_matches(str(value), ROTATIONS, n=1)
        raise wrong_value(toml, key, value, near[0] if near else " or ".join(ROTATIONS))
    return cast("Rotation", value)


def _rotations(
    table: Any, folder: Path, files: tuple[Path, ...], toml: Path
) -> tuple[tuple[Path, Rotation], ...]:
    found = []
    for name, value in _table(table, "rotations", toml).items():
        path = _named_file(name, "rotations", folder, files, toml)
        found.append((path, _rotation(value, f"rotations.{name!r}", toml)))
    return tuple(found)


def _named_file(name: str, key: str, folder: Path, files: tuple[Path, ...], toml: Path) -> Path:
    for path in files:
        if path.relative_to(folder).as_posix() == name:
            return path
    by_name = [path for path in files if path.name == name]
    if len(by_name) == 1:
        return by_name[0]
    names = [path.relative_to(folder).as_posix() for path in files]
    near = difflib.get_close_matches(name, names, n=1)
    raise ConfigError(
        f"{TEST_FILE} names a file that is {'not there' if not by_name else 'there more than once'}",
        where=f"{toml}, [{key}]",
        got=name,
        expected=near[0] if near else ", ".join(names[:12]) or "a recording of the folder",
        next_step=f"did you mean {near[0]!r}?" if near else "correct the name, with its sub-folder",
        rule="no-file",
    )


def _tare(
    entry: Any, machine: Machine, folder: Path, toml: Path
) -> tuple[Path | None, tuple[tuple[str, float, str], ...]]:
    table = _table(entry, "tare", toml)
    check_keys(table, ("file", "values"), where=f"{toml}, [tare]")
    if {"file", "values"} <= set(table):
        raise wrong_value(toml, "tare", "file and values", "one of the two")
    if "file" in table:
        name = _text(table["file"], "tare.file", toml)
        path = folder / name
        inside = ".." not in Path(name).parts and not Path(name).is_absolute()
        if not inside or path.is_symlink() or not path.is_file():
            files = tuple(sorted(_recordings(folder)))
            return _named_file(name, "tare", folder, files, toml), ()
        return path, ()
    values = _table(table.get("values", {}), "tare.values", toml)
    cells = [column.symbol for column in machine.indications]
    check_keys(values, cells, where=f"{toml}, [tare] values")
    if "values" in table and set(values) != set(cells):
        raise ConfigError(
            "the tare lacks a load cell",
            where=f"{toml}, [tare] values",
            got=", ".join(values) or "no values",
            expected=", ".join(cells),
            next_step="state every cell's unloaded indication, or name a recording with '[tare] file'",
            rule="tare-incomplete",
        )
    return None, tuple(_tare_value(name, value, machine, toml) for name, value in values.items())


def _tare_value(name: str, entry: Any, machine: Machine, toml: Path) -> tuple[str, float, str]:
    own = machine.column(name).unit
    if not isinstance(entry, dict):
        entry = {"value": entry, "unit": own}
    check_keys(entry, ("value", "unit"), where=f"{toml}, [tare] values.{name}")
    value, printed = entry.get("value"), entry.get("unit", own)
    if not is_number(value):
        raise wrong_value(toml, f"tare.values.{name}", value, "a number")
    if not isinstance(printed, str):
        raise wrong_value(toml, f"tare.values.{name}.unit", printed, "a unit as text")
    scale = si_scale(printed, unit(own).dimension, where=f"{toml}, [tare] values.{name}")
    same = unit(printed).text == own
    return name, float(value) if same else float(from_si(float(value) * scale, own)), own


def _table(value: Any, key: str, toml: Path) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise wrong_value(toml, key, value, f"a table [{key}]")
    return value


def _text(value: Any, key: str, toml: Path) -> str:
    # A series or a DOT code may be written as a number.
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise wrong_value(toml, key, value, "a text")
    return str(value).strip()
