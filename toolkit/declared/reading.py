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
from toolkit.files import parse_toml, read_bytes

T = TypeVar("T")


def read(cls: type[T], path: Path) -> T:
    """Read a TOML file, or a JSON file by its name's end, as a declared class.

    Raises
    ------
    ConfigError
        no file, no TOML; every entry that is unknown, missing or cannot be used
    """
    return read_text(cls, read_bytes(path), where=path)


def read_text(cls: type[T], data: bytes, *, where: object) -> T:
    """Read the content of a file, whose name ``where`` is; errors as `read`."""
    if str(where).endswith(".json"):
        try:
            table = json.loads(data.decode("utf-8"))
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
    made, faults = attempt(cls, table)
    refuse(faults, origin)
    assert made is not None  # noqa: S101  without a fault there is an object
    return made


def attempt(cls: type[T], table: Any) -> tuple[T | None, tuple[Fault, ...]]:
    """Return the object of a parsed file, None where it has faults, and the faults."""
    form = form_of(cls) or Format()
    faults: list[Fault] = []
    root = table if isinstance(table, Mapping) else {}
    place = Place((), form, faults, root)
    if isinstance(table, dict):
        table = _of_newest(table, form, place)
        if faults:
            return None, tuple(faults)
    made = table_of(cls).read(table, Place((), form, faults, table if isinstance(table, Mapping) else {}))
    return None if faults else made, tuple(faults)


def _of_newest(table: dict[str, Any], form: Format, place: Place) -> dict[str, Any]:
    """Return the entries in the newest form, without a fault only where their schema is known."""
    if form.schema is None:
        return table
    stated = table.get("schema", None if form.schema_required else form.schema)
    if stated is None:
        place.at("schema").refuse(None, f"schema = {form.schema}", kind="missing")
        return table
    older = dict(form.older or {})
    if type(stated) is not int or (stated != form.schema and stated not in older):
        newer = type(stated) is int and stated > form.schema
        place.at("schema").refuse(
            stated,
            " or ".join(map(str, sorted({form.schema, *older}))),
            what=f"this {form.title} was written by a newer version of the toolkit" if newer else None,
        )
        return table
    while stated != form.schema:
        table = {**older[stated](table), "schema": stated + 1}
        stated += 1
    return table
