"""The statements of a session as fields: each entry that its format declares, with what may stand there.

The text of SESSION.toml stays what is kept: a field that changes is changed there, in its own line, and no
other line of the text with it.
"""

from __future__ import annotations

import copy
import itertools
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.declared import toml_text
from toolkit.declared.declaration import fields_of
from toolkit.declared.kinds import BoolKind, ChoiceKind, DateKind, NumberKind, TextKind
from toolkit.declared.lines import lines_of
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.declared.tables import TableKind
from toolkit.declared.writing import key_of, value_text
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.declared.kinds import Kind
    from toolkit.declared.tables import Field

Place = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """One entry: ``name`` is its place, as ``cells.D51.serial``; ``text`` what stands there, for a field.

    ``choices`` are the words that may stand there, empty where it is no choice; ``form`` is the kind of the
    field: text, date or number, with ``low`` and ``high`` where the declaration has such bounds.
    """

    name: str
    key: str
    text: str
    expected: str
    help: str
    unit: str
    required: bool
    form: str
    choices: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """A table of the session: its name, empty for the session itself, and its entries."""

    name: str
    statements: tuple[Statement, ...]

    @property
    def title(self) -> str:
        """The name as people read it: what a file counts from 0 is counted from 1."""
        return " ".join(str(int(part) + 1) if part.isdigit() else part for part in self.name.split("."))

    @property
    def is_stated(self) -> bool:
        """Whether anything of it is stated."""
        return any(statement.text for statement in self.statements)


def statement_groups(session: str) -> tuple[Group, ...]:
    """Return the entries of a session by table; none where its text is no TOML."""
    from toolkit.calibration.session.session_file import SessionFile

    table = _parsed(session)
    return () if table is None else tuple(_groups(fields_of(SessionFile), (), table, table))


def with_statement(session: str, name: str, typed: str) -> str:
    """Return the session's text with an entry as it was typed; an empty one is left out.

    Raises
    ------
    ConfigError
        ``usage``: the text is no TOML, or no entry has this name
    """
    from toolkit.calibration.session.session_file import SessionFile

    table = _parsed(session)
    if table is None:
        raise _unusable(name, "statements that are no TOML", "statements that can be read")
    kinds = {
        _name(place): (place, declared.kind)
        for place, declared in _entries(fields_of(SessionFile), (), table, table)
    }
    if name not in kinds:
        raise _unusable(name, name, "an entry of a session")
    place, kind = kinds[name]
    value = _value(kind, typed.strip()) if typed.strip() else None
    if value is None and place not in lines_of(session):
        return session
    target = copy.deepcopy(table)
    _put(target, place, value)
    edited = _edited(session, place, value)
    # Where an entry stands in several lines, or inside of another one, the whole text is written anew.
    return edited if edited is not None and _parsed(edited) == target else toml_text(target)


def _groups(
    declared: tuple[Field, ...], place: Place, table: Mapping[str, Any], whole: Mapping[str, Any]
) -> Iterator[Group]:
    entries = [field for field in declared if not _tables(field.kind, table.get(field.key), whole)]
    yield Group(
        name=_name(place),
        statements=tuple(_statement(field, (*place, field.key), table.get(field.key)) for field in entries),
    )
    for field in declared:
        below = _tables(field.kind, table.get(field.key), whole)
        for keys, inner, content in below:
            yield from _groups(inner.fields, (*place, field.key, *keys), content, whole)


def _entries(
    declared: tuple[Field, ...], place: Place, table: Mapping[str, Any], whole: Mapping[str, Any]
) -> Iterator[tuple[Place, Field]]:
    for field in declared:
        below = _tables(field.kind, table.get(field.key), whole)
        for keys, inner, content in below:
            yield from _entries(inner.fields, (*place, field.key, *keys), content, whole)
        if not below:
            yield (*place, field.key), field


def _tables(
    kind: Kind, value: Any, whole: Mapping[str, Any]
) -> list[tuple[Place, TableKind, dict[str, Any]]]:
    """Return the tables below an entry, by their keys in it; none where a field of its own holds it."""
    if isinstance(kind, TableKind):
        inline = {field.key for field in kind.fields} == {"value", "unit"}
        return [] if inline else [((), kind, value if isinstance(value, dict) else {})]
    if isinstance(kind, KeyedKind) and isinstance(kind.item, TableKind):
        if {field.key for field in kind.item.fields} == {"value", "unit"}:
            return []
        tables = value if isinstance(value, dict) else {}
        declared = whole.get(kind.names.of or "", ()) if kind.names is not None else ()
        keys = dict.fromkeys([*(name for name in declared if isinstance(name, str)), *tables])
        below = [((key,), tables.get(key, {})) for key in keys]
        return [(place, kind.item, content) for place, content in below if isinstance(content, dict)]
    if isinstance(kind, ListKind) and isinstance(kind.item, TableKind) and isinstance(value or [], list):
        entries = [content for content in value or [] if isinstance(content, dict)]
        # One more than there are: typing into it begins the next.
        return [((at,), kind.item, content) for at, content in enumerate([*entries, {}])]
    return []


def _statement(field: Field, place: Place, value: Any) -> Statement:
    kind, form = field.kind, "text"
    choices: tuple[str, ...] = ()
    low = high = None
    if isinstance(kind, ChoiceKind):
        choices = tuple(map(str, kind.choices))
    elif isinstance(kind, BoolKind):
        choices = ("true", "false")
    elif isinstance(kind, DateKind):
        form = "date"
    elif isinstance(kind, NumberKind):
        form, schema = "number", kind.schema()
        low, high = (
            schema.get(f"{end}imum", schema.get(f"exclusive{end.title()}imum")) for end in ("min", "max")
        )
    return Statement(
        name=_name(place), key=field.key, text="" if value is None else _text(kind, value),
        expected=kind.expected, help=kind.entry.help or "", unit=field.unit, required=field.required,
        form=form, choices=choices, low=low, high=high,
    )  # fmt: skip


def _text(kind: Kind, value: Any) -> str:
    if isinstance(value, str) and not (isinstance(kind, ListKind | KeyedKind | TableKind)):
        return value
    if _is_words(kind) and isinstance(value, list) and all(isinstance(word, str) for word in value):
        return ", ".join(value)
    return value_text(value)


def _value(kind: Kind, typed: str) -> Any:
    """Return what was typed as TOML holds it; what is none is kept as a text, and told by the reader."""
    if isinstance(kind, TextKind):
        return typed
    if _is_words(kind) and not typed.startswith("["):
        return [word.strip() for word in typed.split(",") if word.strip()]
    if isinstance(kind, ChoiceKind) and typed in kind.choices:
        return typed
    number = typed.replace(",", ".") if re.fullmatch(r"[+-]?\d+,\d+", typed) else typed
    try:
        return tomllib.loads(f"value = {number}")["value"] if "\n" not in number else typed
    except tomllib.TOMLDecodeError:
        return typed


def _is_words(kind: Kind) -> bool:
    return isinstance(kind, ListKind) and isinstance(kind.item, TextKind)


def _put(table: dict[str, Any], place: Place, value: Any) -> None:
    content: Any = table
    for key, below in itertools.pairwise(place):
        if isinstance(key, int):
            content += [{}] if key == len(content) else []
            content = content[key]
        else:
            content = content.setdefault(key, [] if isinstance(below, int) else {})
    if value is None:
        content.pop(place[-1], None)
    else:
        content[place[-1]] = value


def _edited(session: str, place: Place, value: Any) -> str | None:
    """Return the text with the entry's own line changed, None where it has none of its own."""
    lines, at = session.split("\n"), lines_of(session)
    line = None if value is None else f"{key_of(str(place[-1]))} = {value_text(value)}"
    if place in at:
        lines[at[place] - 1 : at[place]] = [] if line is None else [line]
    elif line is None:
        return None
    elif len(place) == 1:
        header = next((i for i, text in enumerate(lines) if text.lstrip().startswith("[")), len(lines))
        while header and not lines[header - 1].strip():
            header -= 1
        lines.insert(header, line)
    elif place[:-1] in at:
        lines.insert(at[place[:-1]], line)
    elif len(place) == 3 and isinstance(place[1], int):  # one more of a list of tables
        lines = [*session.rstrip("\n").split("\n"), "", f"[[{key_of(str(place[0]))}]]", line, ""]
    elif all(isinstance(key, str) for key in place):
        lines = [
            *session.rstrip("\n").split("\n"),
            "",
            f"[{'.'.join(key_of(str(k)) for k in place[:-1])}]",
            line,
            "",
        ]
    else:
        return None
    return "\n".join(lines)


def _name(place: Place) -> str:
    return ".".join(str(key) for key in place)


def _parsed(session: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(session)
    except (tomllib.TOMLDecodeError, RecursionError):
        return None


def _unusable(name: str, got: str, expected: str) -> ConfigError:
    return ConfigError(
        "the statement cannot be changed", where=name, got=got, expected=expected,
        next_step="correct the text of the statements; nothing was changed", rule="usage",
    )  # fmt: skip
