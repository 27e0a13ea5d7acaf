"""Context: which machine wrote a file, and when, as the nearest test.toml or the file itself says."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from toolkit.calibration.registry.clock import begun
from toolkit.days import parse_day
from toolkit.errors import ConfigError
from toolkit.files import read_toml, same_file
from toolkit.inputs import is_regular
from toolkit.machine import Machine, load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.recording.folder import nearest_test_toml
from toolkit.recording.marks import machine_of

MachineSource = Literal["option", "test.toml", "file", "default"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """The machine and how it is known; the test's date and its test.toml, None where there is none.

    ``date`` is None too where test.toml states one that has not begun, which ``future`` then holds: what will
    be in force then cannot be known.

    ``tare`` tells whether test.toml gives a tare, which `toolkit process` subtracts; ``is_tare`` whether
    the file itself is that tare.
    """

    machine: Machine
    machine_source: MachineSource
    date: dt.date | None
    test_toml: Path | None
    future: dt.date | None = None
    tare: bool = False
    is_tare: bool = False


def context_of(
    path: Path,
    *,
    machine: str | None = None,
    own: Callable[[], str | None] | None = None,
    read: Callable[[Path], Mapping[str, Any]] = read_toml,
    find: Callable[[Path], Path | None] = nearest_test_toml,
) -> Context:
    """Return a file's context: ``machine`` where it is named, else test.toml, the file, else the default.

    ``own`` tells the machine that the file names, ``read`` reads a test.toml and ``find`` finds it: for a
    caller that remembers.

    Raises
    ------
    ConfigError
        the test.toml is no TOML, its date is no date, or the machine is unknown
    """
    toml = find(path)
    table: Mapping[str, Any] = {} if toml is None else read(toml)
    date = None if toml is None or "date" not in table else _date(table["date"], toml)
    future = None
    if date is not None and not begun(date):
        date, future = None, date
    source: MachineSource
    if machine is not None:
        name, source = machine, "option"
    elif toml is not None and "machine" in table:
        name, source = str(table["machine"]), "test.toml"
        name = str(toml.parent / name) if name.endswith(".toml") else name
    else:
        file_machine = machine_of(path) if own is None else own()
        name, source = (file_machine, "file") if file_machine is not None else (DEFAULT_MACHINE, "default")
    return Context(
        machine=load_machine(name),
        machine_source=source,
        date=date,
        test_toml=toml,
        future=future,
        tare="tare" in table,
        is_tare=toml is not None and _is_tare(path, table.get("tare"), toml.parent),
    )


def _is_tare(path: Path, tare: object, folder: Path) -> bool:
    name = tare.get("file") if isinstance(tare, dict) else None
    if not isinstance(name, str):
        return False
    tare_file = folder / name
    return is_regular(tare_file) and is_regular(path) and same_file(tare_file, path)


def _date(value: object, toml: Path) -> dt.date:
    if isinstance(value, dt.datetime):
        return value.date()
    if isinstance(value, dt.date):
        return value
    try:
        return parse_day(str(value))
    except ValueError as error:
        raise ConfigError(
            "the test's date is no date",
            where=toml,
            got=value,
            expected="a date such as 2026-03-31",
            next_step="correct the line",
            rule="wrong-value",
        ) from error
