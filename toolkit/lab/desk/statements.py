"""The statements of a settings file as fields: each entry that its format declares, and what may stand.

The text of the file stays what is kept: a field that changes is changed there, in its own line, and no other
line of the text with it.
"""

from __future__ import annotations

import copy
import itertools
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from toolkit.declared import toml_text
from toolkit.declared.declaration import fields_of
from toolkit.declared.faults import lines_of
from toolkit.declared.kinds import BoolKind, ChoiceKind, DateKind, FileKind, Kind, NumberKind, TextKind
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.declared.tables import Field, FormsKind, TableKind
from toolkit.declared.text import key_of, value_text
from toolkit.errors import ConfigError
from toolkit.files import toml_entries

Place = tuple[str | int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Statement:
    """One entry: ``name`` is its place, as ``cells.D51.serial``; ``text`` what stands there, for a field.

    ``choices`` are the words that may stand there, empty where it is no choice; ``form`` is the kind of the
    field: text, file, date or number, with ``low`` and ``high`` where the declaration has such bounds.
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
    """A table of the file: its name, empty for the file itself, and its entries.

    ``opens``: further entries may stand in it, under names that somebody chooses; ``removable``: it is such
    an entry itself, and may be left out as a whole.
    """

    name: str
    statements: tuple[Statement, ...]
    opens: bool = False
    removable: bool = False

    @property
    def title(self) -> str:
        """The name as people read it: what a file counts from 0 is counted from 1."""
        return " ".join(str(int(part) + 1) if part.isdigit() else part for part in self.name.split("."))

    @property
    def is_stated(self) -> bool:
        """Whether anything of it is stated: the page of a session opens it then."""
        return any(statement.text for statement in self.statements)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Section:
    """A table at a place of the file: its fields and what stands there; ``forms`` where a word chose it."""

    place: Place = ()
    fields: tuple[Field, ...] = ()
    content: Mapping[str, Any]
    opens: bool = False
    is_list: bool = False
    removable: bool = False
    forms: FormsKind | None = None


def statement_groups(text: str, form: type) -> tuple[Group, ...]:
    """Return the entries of a file of a declared form by table; none where its text is no TOML."""
    table = _parsed(text)
    return () if table is None else tuple(
        Group(
            name=_name(section.place), opens=section.opens, removable=section.removable,
            statements=tuple(
                _statement(field, (*section.place, field.key), section.content.get(field.key))
                for field in section.fields
            ),
        )
        for section in _sections(_whole(form, table), table)
    )  # fmt: skip


def with_statement(text: str, form: type, name: str, typed: str) -> str:
    """Return the file's text with an entry as it was typed; an empty one is left out.

    Another word for the form of a table leaves out what that form has not.

    Raises
    ------
    ConfigError
        ``usage``: the text is no TOML, or no entry has this name
    """
    table = _parsed(text)
    if table is None:
        raise _unusable(name, "statements that are no TOML", "statements that can be read")
    entries = {
        _name((*section.place, field.key)): (section, field)
        for section in _sections(_whole(form, table), table)
        for field in section.fields
    }
    if name not in entries:
        raise _unusable(name, name, "an entry of the file")
    section, field = entries[name]
    place = (*section.place, field.key)
    value = _value(field.kind, typed.strip()) if typed.strip() else None
    if value is None and place not in lines_of(text):
        return text
    target = copy.deepcopy(table)
    _put(target, place, value)
    if section.forms is not None and field.name == section.forms.tag and value in section.forms.tables:
        chosen: dict[str, Any] = _at(target, section.place)
        for key in chosen.keys() - set(section.forms.tables[value].keys):
            del chosen[key]
    return _written(text, target, place, value)


def with_entry(text: str, form: type, name: str, key: str, value: Any) -> str:
    """Return the file's text with one more entry in a table that takes any name, or in a list of tables.

    Raises
    ------
    ConfigError
        ``usage``: no such table, or it has an entry of this name
    """
    section = _section(text, form, name, opens=True)
    target = copy.deepcopy(_parsed(text) or {})
    content = _at(target, section.place) or ()
    if not section.is_list and (not key or key in content):
        raise _unusable(name, key or "no name", "a name that is not there yet")
    place = (*section.place, len(content) if section.is_list else key)
    _put(target, place, value)
    return _written(text, target, place, value)


def without_entry(text: str, form: type, name: str) -> str:
    """Return the file's text without a table that may be left out.

    Raises
    ------
    ConfigError
        ``usage``: no such table
    """
    place = _section(text, form, name, opens=False).place
    target = copy.deepcopy(_parsed(text) or {})
    _put(target, place, None)
    return _written(text, target, place, None)


def _written(text: str, target: Mapping[str, Any], place: Place, value: Any) -> str:
    """Return the text of ``target``: the smallest change of a text that reads as it, else written anew."""
    edits = _edited(text, target, place, value)
    return next((edit for edit in edits if _parsed(edit) == target), None) or toml_text(target)


def _section(text: str, form: type, name: str, *, opens: bool) -> _Section:
    table = _parsed(text) or {}
    for section in _sections(_whole(form, table), table):
        if _name(section.place) == name and (section.opens if opens else section.removable):
            return section
    raise _unusable(name, name, "a table of the file")


def _whole(form: type, table: Mapping[str, Any]) -> _Section:
    return _Section(fields=fields_of(form), content=table)


def _sections(section: _Section, whole: Mapping[str, Any]) -> Iterator[_Section]:
    """Yield a table with the entries that are fields of their own, then the tables below it."""
    below = {
        field.key: _tables(field.kind, section.content.get(field.key), whole) for field in section.fields
    }
    yield replace(section, fields=tuple(field for field in section.fields if not below[field.key]))
    for key, tables in below.items():
        for inner in tables:
            yield from _sections(replace(inner, place=(*section.place, key, *inner.place)), whole)


def _tables(kind: Kind, value: Any, whole: Mapping[str, Any]) -> list[_Section]:
    """Return the tables below an entry, placed by their keys in it; none where it is a field of its own."""
    if isinstance(kind, TableKind):
        content = value if isinstance(value, dict) else {}
        return [] if _is_quantity(kind) else [_Section(fields=kind.fields, content=content)]
    if isinstance(kind, FormsKind) and kind.tag is not None and isinstance(value, dict):
        chosen = kind.tables.get(value.get(kind.tag))
        if chosen is None:
            return []
        fields = tuple(
            replace(field, kind=ChoiceKind(entry=kind.entry, choices=tuple(kind.tables)))
            if field.name == kind.tag
            else field
            for field in chosen.fields
        )
        return [_Section(fields=fields, content=value, forms=kind)]
    if isinstance(kind, KeyedKind):
        return _named_tables(kind, value if isinstance(value, dict) else {}, whole)
    if isinstance(kind, ListKind) and isinstance(value or [], list):
        entries = [content for content in value or [] if isinstance(content, dict)]
        if isinstance(kind.item, TableKind):
            # One more than there are: typing into it begins the next.
            return [
                _Section(place=(at,), fields=kind.item.fields, content=content)
                for at, content in enumerate([*entries, {}])
            ]
        if isinstance(kind.item, KeyedKind) and kind.item.names is None:
            below = [
                replace(each, place=(at,), removable=True)
                for at, content in enumerate(entries)
                for each in _named_tables(kind.item, content, whole)
            ]
            return [_Section(content={}, opens=True, is_list=True), *below]
    return []


def _named_tables(kind: KeyedKind, value: Mapping[str, Any], whole: Mapping[str, Any]) -> list[_Section]:
    item, is_open = kind.item, kind.names is None
    if not isinstance(item, TableKind):
        fields = tuple(Field(name=key, key=key, kind=item) for key in value)
        return [_Section(fields=fields, content=value, opens=True)] if is_open else []
    if _is_quantity(item):
        return []
    names = whole.get(kind.names.of or "", ()) if kind.names is not None else ()
    keys = dict.fromkeys([*(name for name in names if isinstance(name, str)), *value])
    below = [
        _Section(place=(key,), fields=item.fields, content=content, removable=is_open)
        for key in keys
        if isinstance(content := value.get(key, {}), dict)
    ]
    return [_Section(content={}, opens=True), *below] if is_open else below


def _is_quantity(kind: TableKind) -> bool:
    return {field.key for field in kind.fields} == {"value", "unit"}


def _statement(field: Field, place: Place, value: Any) -> Statement:
    kind, form = field.kind, "text"
    choices: tuple[str, ...] = ()
    low = high = None
    if isinstance(kind, ChoiceKind):
        choices = tuple(map(str, kind.choices))
    elif isinstance(kind, BoolKind):
        choices = ("true", "false")
    elif isinstance(kind, DateKind | FileKind):
        form = "date" if isinstance(kind, DateKind) else "file"
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
    if kind.shape is str:
        return typed
    if _is_words(kind) and not typed.startswith("["):
        return [word.strip() for word in typed.split(",") if word.strip()]
    if isinstance(kind, ChoiceKind) and typed in kind.choices:
        return typed
    number = typed.replace(",", ".") if re.fullmatch(r"[+-]?\d+,\d+", typed) else typed
    try:
        return toml_entries(f"value = {number}")["value"] if "\n" not in number else typed
    except tomllib.TOMLDecodeError:
        return typed


def _is_words(kind: Kind) -> bool:
    return isinstance(kind, ListKind) and isinstance(kind.item, TextKind)


def _at(table: Mapping[str, Any], place: Place) -> Any:
    """Return what stands at a place, None where nothing does."""
    content: Any = table
    for key in place:
        if isinstance(key, int):
            content = content[key] if isinstance(content, list) and key < len(content) else None
        else:
            content = content.get(key) if isinstance(content, dict) else None
    return content


def _put(table: dict[str, Any], place: Place, value: Any) -> None:
    content: Any = table
    for key, below in itertools.pairwise(place):
        if isinstance(key, int):
            content += [{}] if key == len(content) else []
            content = content[key]
        else:
            content = content.setdefault(key, [] if isinstance(below, int) else {})
    last = place[-1]
    if value is None and _at(table, place) is not None:
        del content[last]
    elif isinstance(last, int) and last == len(content):
        content.append(value)
    elif value is not None:
        content[last] = value


def _edited(text: str, target: Mapping[str, Any], place: Place, value: Any) -> Iterator[str]:
    """Yield the text with the entry's own line changed, then with ever more changed around it."""
    lines, at = text.split("\n"), lines_of(text)
    ending = [*text.rstrip("\n").split("\n"), ""]
    line = None if value is None else f"{key_of(str(place[-1]))} = {value_text(value)}"

    def edited(first: int, last: int, *added: str) -> str:
        return "\n".join([*lines[:first], *added, *lines[last:]])

    if place in at:
        first = at[place] - 1
        yield edited(first, first + 1, *([] if line is None else [line]))
    elif line is None:
        return
    elif len(place) == 1:
        first = next((i for i, text in enumerate(lines) if text.lstrip().startswith("[")), len(lines))
        while first and not lines[first - 1].strip():
            first -= 1
        yield edited(first, first, line)
    elif place[:-1] in at:
        yield edited(at[place[:-1]], at[place[:-1]], line)
    elif all(isinstance(key, str) for key in place):
        yield "\n".join([*ending, _header(place[:-1]), line, ""])
    if isinstance(value, dict) and place not in at:  # a table with lines of its own
        entries = [f"{key_of(key)} = {value_text(entry)}" for key, entry in value.items()]
        header = f"[{_header(place[:-1])}]" if isinstance(place[-1], int) else _header(place)
        yield "\n".join([*ending, header, *entries, ""])
    if len(place) == 3 and isinstance(place[1], int) and line is not None:
        yield "\n".join([*ending, f"[{_header(place[:1])}]", line, ""])
    if place in at and line is None:  # a table with all its lines
        first = at[place] - 1
        last = next((i for i in range(first + 1, len(lines)) if lines[i].startswith("[")), len(lines))
        yield edited(first, last)
    for depth in range(len(place) - 1, 0, -1):  # the line of the table inside of which it stands
        above = place[:depth]
        if above in at and isinstance(above[-1], str):
            held = f"{key_of(above[-1])} = {value_text(_at(target, above))}"
            yield edited(at[above] - 1, at[above], held)


def _header(place: Place) -> str:
    return f"[{'.'.join(key_of(str(key)) for key in place)}]"


def _name(place: Place) -> str:
    return ".".join(str(key) for key in place)


def _parsed(session: str) -> dict[str, Any] | None:
    try:
        return toml_entries(session)
    except (tomllib.TOMLDecodeError, RecursionError):
        return None


def _unusable(name: str, got: str, expected: str) -> ConfigError:
    return ConfigError(
        "the statement cannot be changed", where=name, got=got, expected=expected,
        next_step="correct the text of the statements; nothing was changed", rule="usage",
    )  # fmt: skip
