"""From a file to an object: TOML or JSON text, its schema version, every fault at once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from toolkit.declared.declaration import form_of, table_of
from toolkit.declared.faults import Fault, Source, refuse
from toolkit.declared.kinds import Place
from toolkit.declared.marks import Format
from toolkit.errors import ConfigError
from toolkit.files import as_written, parse_toml
from toolkit.inputs import SETTINGS_FILE, read_input

T = TypeVar("T")


def read(cls: type[T], path: Path) -> T:
    """Read a TOML file, or a JSON file by its name's end, as a declared class.

    Raises
    ------
    ConfigError
        no file, no TOML; every entry that is unknown, missing or cannot be used
    """
    return read_text(cls, read_input(path, SETTINGS_FILE), where=path)


def read_text(cls: type[T], data: bytes, *, where: object) -> T:
    """Read the content of a file, whose name ``where`` is; errors as `read`."""
    if str(where).endswith(".json"):
        try:
            table = json.loads(data.decode("utf-8"), parse_float=as_written)
        except (ValueError, RecursionError) as error:
            raise ConfigError(
                "a file is not JSON", where=where, got=error, expected="JSON in UTF-8",
                next_step="mend the place that is named", rule="not-json",
            ) from error  # fmt: skip
        return build(cls, table, Source(where=where))
    table = parse_toml(data, where=where)
    return build(cls, table, Source(where=where, text=data.decode("utf-8-sig")))


def build(cls: type[T], table: Any, source: Source | object) -> T:
    """Return the object of a parsed file.

    Parameters
    ----------
    cls : the declared class
    table : the entries, as tomllib or json give them
    source : the `Source` of the entries, or what names it in messages

    Raises
    ------
    ConfigError
        every entry that is unknown, missing or cannot be used
    """
    origin = source if isinstance(source, Source) else Source(where=source)
    instance, faults = attempt(cls, table)
    refuse(faults, origin)
    assert instance is not None  # noqa: S101  without a fault there is an object
    return instance


def attempt(cls: type[T], table: Any) -> tuple[T | None, tuple[Fault, ...]]:
    """Return the object of a parsed file, None where it has faults, and the faults."""
    faults: list[Fault] = []
    root = table if isinstance(table, Mapping) else {}
    instance = table_of(cls).read(table, Place((), form_of(cls) or Format(), faults, root))
    return None if faults else instance, tuple(faults)
