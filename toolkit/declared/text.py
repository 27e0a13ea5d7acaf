"""The text of a file to an object and back: TOML or JSON, its schema version, every fault at once; TOML that
reads back equal.
"""

from __future__ import annotations

import dataclasses
import datetime as dt
import enum
import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from toolkit.declared.declaration import form_of, outputs_of, table_of
from toolkit.declared.faults import Fault, Source, refuse
from toolkit.declared.kinds import Place
from toolkit.declared.marks import Format
from toolkit.errors import ConfigError
from toolkit.files import as_written, parse_toml
from toolkit.inputs import SETTINGS_FILE, read_input
from toolkit.printable import check_entries

T = TypeVar("T")
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_WIDE = 100


def read(cls: type[T], path: Path) -> T:
    """Read a TOML file, or a JSON file by its name's end, as a declared class.

    Raises
    ------
    ConfigError
        no file, no TOML; every entry that is unknown, missing or cannot be used
    """
    return read_text(cls, read_input(path, SETTINGS_FILE), where=path)


def read_text(cls: type[T], data: bytes, *, where: object, entered: bool = False) -> T:
    """Read the content of a file of the name ``where``; ``entered`` as of `parse_toml`, errors as `read`."""
    if str(where).endswith(".json"):
        try:
            table = json.loads(data.decode("utf-8"), parse_float=as_written)
        except (ValueError, RecursionError) as error:
            raise ConfigError(
                "a file is not JSON", where=where, got=error, expected="JSON in UTF-8",
                next_step="mend the place that is named", rule="not-json",
            ) from error  # fmt: skip
        if not entered:
            check_entries(table, where=where, source=data.decode("utf-8"))
        return build(cls, table, Source(where=where))
    table = parse_toml(data, where=where, entered=entered)
    return build(cls, table, Source(where=where, text=data.decode("utf-8-sig")))


def build(cls: type[T], table: Any, source: Source | object, *, accepted: bool = False) -> T:
    """Return the object of a parsed file.

    Parameters
    ----------
    cls : the declared class
    table : the entries, as tomllib or json give them
    source : the `Source` of the entries, or what names it in messages
    accepted : as of `attempt`

    Raises
    ------
    ConfigError
        every entry that is unknown, missing or cannot be used
    """
    origin = source if isinstance(source, Source) else Source(where=source)
    instance, faults = attempt(cls, table, accepted=accepted)
    refuse(faults, origin)
    assert instance is not None  # noqa: S101  without a fault there is an object
    return instance


def attempt(cls: type[T], table: Any, *, accepted: bool = False) -> tuple[T | None, tuple[Fault, ...]]:
    """Return the object of a parsed file, None where it has faults, and the faults.

    ``accepted``: some version took the file, and it is read for ever. Keys that are not declared are passed
    over; texts may have control characters, and one that may be a number is that of whatever stands there.
    """
    faults: list[Fault] = []
    root = table if isinstance(table, Mapping) else {}
    instance = table_of(cls).read(table, Place((), form_of(cls) or Format(), faults, root, accepted))
    return None if faults else instance, tuple(faults)


def plain(instance: Any) -> dict[str, Any]:
    """Return a declared object as its file holds it: texts, numbers, dates, lists and dicts.

    Quantities keep the unit in which they were read; what is None is left out.
    """
    kind = table_of(type(instance))
    schema = {} if kind.form_of is None or kind.form_of.schema is None else {"schema": kind.form_of.schema}
    table: dict[str, Any] = kind.write(instance)
    return schema | table


def toml_text(instance: Any) -> str:
    """Return the TOML file of a declared object; `reading.read_text` gives an equal object again."""
    table = plain(instance) if dataclasses.is_dataclass(instance) else instance
    return "\n".join(table_lines(table, ())).strip() + "\n"


def table_lines(table: Mapping[str, Any], path: tuple[str, ...]) -> list[str]:
    """Return the lines of a table: its values first, then the tables below it."""
    below = {key: entry for key, entry in table.items() if _is_table(entry) or _is_tables(entry)}
    lines = [f"{key_of(key)} = {value_text(entry)}" for key, entry in table.items() if key not in below]
    for key, entry in below.items():
        name = ".".join(map(key_of, (*path, key)))
        for part in entry if isinstance(entry, list) else [entry]:
            header = f"[[{name}]]" if isinstance(entry, list) else f"[{name}]"
            lines += ["", header, *table_lines(part, (*path, key))]
    return lines


def _is_table(entry: Any) -> bool:
    """Tell whether it has lines of its own; a quantity, and what else is short, stands in one line."""
    if not isinstance(entry, Mapping):
        return False
    nested = set(entry) != {"value", "unit"} and any(isinstance(e, Mapping | list) for e in entry.values())
    return nested or len(value_text(entry)) > _WIDE


def _is_tables(entry: Any) -> bool:
    return isinstance(entry, list) and bool(entry) and all(isinstance(part, Mapping) for part in entry)


def key_of(key: str) -> str:
    """Return a key of TOML, quoted where it must be."""
    return key if _BARE.fullmatch(key) else _quoted(key)


def value_text(value: Any) -> str:
    """Return a value of TOML in one line; floats in the fewest digits that give the same float again.

    >>> value_text({"value": [0.1, 2], "unit": "N·m"})
    '{ value = [0.1, 2], unit = "N·m" }'
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, int):
        return str(int(value))
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    if isinstance(value, Mapping):
        inside = ", ".join(f"{key_of(str(key))} = {value_text(entry)}" for key, entry in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(value_text, value))}]"
    raise TypeError(f"TOML has no value such as {value!r}")


def _quoted(text: str) -> str:
    # JSON escapes what TOML does, but for the delete sign.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def answer(instance: Any) -> dict[str, Any]:
    """Return the JSON document of a declared object: ``schema`` first, then every field by its key.

    Unlike a file it has every field: numbers in the unit that the key names, None and what is no number
    (NaN, infinity) as null, dates as ISO 8601, paths as texts; numpy's scalars and arrays, enumerations and
    objects inside become plain.
    """
    document = json_value(instance)
    return {"schema": document.pop("schema", 1), **document}


def json_value(value: Any) -> Any:
    """Return what JSON writes for a value; see `answer`."""
    if value is None or (isinstance(value, bool | str) and not isinstance(value, enum.Enum)):
        return value
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        as_dict = getattr(value, "as_dict", None)
        if callable(as_dict):
            return json_value(as_dict())
        held = ((output, getattr(value, output.name)) for output in outputs_of(type(value)))
        return {
            output.key: json_value(output.written(entry))
            for output, entry in held
            if entry is not None or not output.sparse
        }
    if isinstance(value, enum.Enum):
        return json_value(value.value)
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(entry) for entry in value]
    if isinstance(value, set | frozenset):  # without an order of its own
        return sorted(map(json_value, value), key=str)
    if isinstance(value, dt.date | dt.time):
        return value.isoformat()
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):  # numpy's arrays and scalars
        return json_value(value.tolist())
    raise TypeError(f"JSON has no value such as {value!r}")
