"""What a declaration says for people and programs: starter files, reference page, JSON schema.

A starter shows a format: its required entries hold examples. An outline begins a file with what is known: an
entry that nobody gave is commented out, and the file is refused until a person has filled it in, with all
that is missing in one message.
"""

from __future__ import annotations

import inspect
import re
import textwrap
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from toolkit.declared.declaration import form_of, table_of
from toolkit.declared.kinds import ChoiceKind, Kind, TextKind
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.declared.marks import Format
from toolkit.declared.tables import Field, FormsKind, TableKind
from toolkit.declared.text import key_of, table_lines, value_text

_WIDTH = 100
_DIGITS = 6  # of a printed default
_FILL_IN = "   # FILL IN"
Notes = Mapping[str, str]
"""Key of the top level -> how its value was come by."""
Root = Mapping[str, Any]
"""A file as it is parsed: what its entries declare are the names that others may use."""


def starter(cls: type) -> str:
    """Return a commented TOML file of a declared class that is itself valid.

    Required entries stand with an example; optional ones are commented out (``#key = value``, without a
    space, so that an editor can switch one on by taking the sign away).
    """
    form, kind = form_of(cls) or Format(), table_of(cls)
    lines = [*_comment(f"{form.title[0].upper()}{form.title[1:]}: {summary(cls)}"), ""]
    if form.schema is not None:
        lines += [f"{'' if form.schema_required else '#'}schema = {form.schema}", ""]
    lines += _starter_table(kind, (), on=True)
    return "\n".join(lines).rstrip() + "\n"


def _starter_table(
    kind: TableKind, path: tuple[str, ...], *, on: bool, root: Root | None = None, marked: bool = False
) -> Iterator[str]:
    """Yield the entries of a table; ``on``: required ones stand there, ``marked``: to be filled in."""
    below = []
    for declared in kind.fields:
        if _inner_table(declared.kind) is not None and declared.kind.entry.example is None:
            below.append(declared)
            continue
        enabled, mark = on and declared.required, _mark(declared) if marked else ""
        yield from _comment(_sentence(declared))
        yield f"{'' if enabled else '#'}{key_of(declared.key)} = {_example(declared, root)}{mark}"
        if declared.beside is not None and declared.beside not in kind.own_keys:
            yield f'{"" if enabled else "#"}{declared.beside} = "{declared.unit}"{mark}'
    for declared in below:
        if _inner_table(declared.kind) is None:
            continue
        yield ""
        yield from _comment(_sentence(declared))
        yield from _inner_lines(declared, (*path, declared.key), on=on, root=root, marked=marked)


def _inner_lines(
    declared: Field, names: tuple[str, ...], *, on: bool, root: Root | None, marked: bool
) -> Iterator[str]:
    """Yield the header of a table below an entry, and its entries."""
    inner = _inner_table(declared.kind)
    if inner is None:
        return
    enabled, mark = on and declared.required, _mark(declared) if marked else ""
    inside = names
    if isinstance(declared.kind, KeyedKind):
        inside = (*names, next(iter(_example_of(declared.kind, root))))
    left, right = ("[[", "]]") if isinstance(declared.kind, ListKind) else ("[", "]")
    header = f"{left}{'.'.join(map(key_of, inside))}{right}"
    yield f"{'' if enabled else '#'}{header}{mark}"
    yield from _starter_table(inner, inside, on=enabled, root=root, marked=bool(mark))


def _inner_table(kind: Kind) -> TableKind | None:
    """Return the table below an entry, None where the entry is a value in one line."""
    if isinstance(kind, TableKind):
        return kind
    inner = kind.item if isinstance(kind, ListKind | KeyedKind) else None
    return inner if isinstance(inner, TableKind) else None


def _example(declared: Field, root: Root | None = None) -> str:
    kind = declared.kind
    if declared.required or kind.entry.example is not None or declared.default in (None, (), ""):
        return value_text(_example_of(kind, root))
    return value_text(_printed(kind.write(declared.default)))


def _example_of(kind: Kind, root: Root | None) -> Any:
    """Return an example of a kind whose names are among those that the file declares."""
    example = kind.example()
    names = getattr(kind, "names", None)
    allowed = () if names is None or root is None else names.names(root)
    if isinstance(kind, KeyedKind) and allowed and example and kind.names is not None and kind.names.of:
        return dict.fromkeys(allowed, next(iter(example.values())))
    if isinstance(kind, TextKind) and allowed and example not in allowed:
        return allowed[0]
    return example


def _sentence(declared: Field) -> str:
    entry = declared.kind.entry
    parts = [entry.help or declared.key.replace("_", " ")]
    if _inner_table(declared.kind) is None:
        parts.append(declared.kind.expected)
    if entry.asked and not declared.required:
        parts.append(f"{entry.asked} asks for it")
    else:
        parts.append("required" if declared.required else f"default {_default(declared) or 'none'}")
    return "; ".join(parts + [f"together with {entry.together}"] * bool(entry.together))


def _default(declared: Field) -> str:
    if declared.required or declared.default in (None, ()) or _inner_table(declared.kind) is not None:
        return ""
    return value_text(_printed(declared.kind.write(declared.default)))


def _printed(value: Any) -> Any:
    # A default is held in SI: in the unit of the file it has the digits of a conversion, which say nothing.
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}")
    if isinstance(value, Mapping):
        return {key: _printed(entry) for key, entry in value.items()}
    return [_printed(entry) for entry in value] if isinstance(value, list | tuple) else value


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(text, _WIDTH)]


def summary(cls: type) -> str:
    """Return what a declared class says of itself, the first paragraph in one line."""
    text = inspect.getdoc(cls) or cls.__name__
    return " ".join(text.split("\n\n")[0].split())


def reference(cls: type) -> str:
    """Return the reference page of a format, Markdown: one table of entries for each declared class."""
    form = form_of(cls) or Format()
    lines = [f"# {form.title[0].upper()}{form.title[1:]}", ""]
    if form.schema is not None:
        needed = "required" if form.schema_required else "optional"
        lines += [f"`schema = {form.schema}` at the top: {needed}.", ""]
    for number, (header, kind) in enumerate(_sections(table_of(cls), "", set())):
        lines += [f"## `{header}`", ""] if number else []
        lines += [summary(kind.cls), ""]
        lines += ["| entry | holds | default | meaning |", "|---|---|---|---|"]
        lines += [_reference_row(declared) for declared in kind.fields]
        units: dict[str, list[Field]] = {}
        for declared in kind.fields:
            if declared.beside is not None and declared.beside not in kind.own_keys:
                units.setdefault(declared.beside, []).append(declared)
        lines += [
            f"| `{key}` | a unit such as {numbers[0].unit} | none | of {', '.join(n.key for n in numbers)} |"
            for key, numbers in units.items()
        ]
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def _reference_row(declared: Field) -> str:
    default = "required" if declared.required else _default(declared) or "none"
    entry = declared.kind.entry
    more = "".join(f"; formerly `{key}`" for key in entry.old)
    more += f"; {entry.asked} asks for it" * bool(entry.asked)
    more += f"; together with `{entry.together}`" * bool(entry.together)
    holds = declared.kind.expected
    if _inner_table(declared.kind) is not None and entry.expected is None:
        tables = {ListKind: "tables below, [[...]]", KeyedKind: "tables below, by name"}
        holds = tables.get(type(declared.kind), "the table below")
    cells = (f"`{declared.key}`", holds, default, entry.help + more)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _sections(kind: TableKind, header: str, described: set[type]) -> Iterator[tuple[str, TableKind]]:
    if kind.cls in described:
        return
    described.add(kind.cls)
    yield header, kind
    for declared in kind.fields:
        name = f"{header.strip('[]')}.{declared.key}".lstrip(".")
        for inner in _forms(declared.kind):
            table = _inner_table(inner)
            if table is not None:
                name_text = f"{name}.NAME" if isinstance(inner, KeyedKind) else name
                yield from _sections(
                    table, f"[[{name}]]" if isinstance(inner, ListKind) else f"[{name_text}]", described
                )


def _forms(kind: Kind) -> tuple[Kind, ...]:
    return kind.forms if isinstance(kind, FormsKind) else (kind,)


def json_schema(cls: type) -> dict[str, Any]:
    """Return the JSON schema (2020-12) of a declared class; checks between entries cannot be said in it."""
    form, kind = form_of(cls) or Format(), table_of(cls)
    definitions: dict[str, Any] = {}
    _define(kind, definitions)
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": form.title,
        **kind.schema(),
        "$defs": definitions,
    }


def _define(kind: TableKind, definitions: dict[str, Any]) -> None:
    if kind.definition in definitions:
        return
    schema: dict[str, Any] = {"type": "object", "description": summary(kind.cls)}
    definitions[kind.definition] = schema
    properties: dict[str, Any] = {}
    if kind.form_of is not None and kind.form_of.schema is not None:
        properties["schema"] = {"const": kind.form_of.schema}
    for declared in kind.fields:
        entry = declared.kind.schema()
        if declared.kind.entry.help:
            entry = {"description": declared.kind.entry.help, **entry}
        default = declared.default
        if not declared.required and default not in (None, ()) and _inner_table(declared.kind) is None:
            entry["default"] = declared.kind.write(default)
        properties[declared.key] = entry
        if declared.beside is not None:
            properties.setdefault(declared.beside, {"type": "string"})
        for form in _forms(declared.kind):
            inner = _inner_table(form)
            if inner is not None:
                _define(inner, definitions)
    required = [declared.key for declared in kind.fields if declared.required]
    if kind.form_of is not None and kind.form_of.schema_required:
        required.insert(0, "schema")
    schema |= {"properties": properties, "required": required, "additionalProperties": False}


def outline(cls: type, values: Mapping[str, Any], notes: Notes | None = None) -> str:
    """Return the commented TOML file of a declared class with the values given and no others.

    Parameters
    ----------
    cls : the declared class
    values : entries as a file holds them: texts, numbers, dates, lists, dicts
    notes : what stands beside an entry, such as where its value was found
    """
    text = _outline(cls, values, notes or {}, None)
    return _outline(cls, values, notes or {}, tomllib.loads(filled_in(text)))


def filled_in(text: str) -> str:
    """Return an outline whose marked entries stand as they are printed.

    >>> filled_in('#name = "belt-2"   # FILL IN')
    'name = "belt-2"'
    """
    return re.sub(rf"(?m)^#(.*?){_FILL_IN}$", r"\1", text)


def asked_of(cls: type, values: Mapping[str, Any]) -> dict[str, str]:
    """Return the entries that a new file lacks though it can be read, and who asks for each of them."""
    return dict(_demands(table_of(cls), values, ""))


def _demands(kind: TableKind, values: Mapping[str, Any], above: str) -> Iterator[tuple[str, str]]:
    for declared in kind.fields:
        entry, stated = declared.kind.entry, values.get(declared.key)
        if entry.asked and stated is None:
            yield f"{above}{declared.key}", f"{declared.kind.expected}; {entry.asked} asks for it"
        elif isinstance(declared.kind, TableKind) and isinstance(stated or {}, Mapping):
            yield from _demands(declared.kind, stated or {}, f"{above}{declared.key}.")


def _outline(cls: type, values: Mapping[str, Any], notes: Notes, root: Root | None) -> str:
    form, kind = form_of(cls) or Format(), table_of(cls)
    lines = [*_comment(f"{form.title[0].upper()}{form.title[1:]}: {summary(cls)}"), "#"]
    lines += [*_comment("Take the sign # away from an entry to state it; FILL IN marks what must be stated.")]
    lines += ["", *([] if form.schema is None else [f"schema = {form.schema}", ""])]
    lines += _entries(kind, (), values, notes, root)
    return "\n".join(lines).rstrip() + "\n"


def _entries(
    kind: TableKind, path: tuple[str, ...], values: Mapping[str, Any], notes: Notes, root: Root | None
) -> Iterator[str]:
    offered = [field for field in kind.fields if not field.kind.entry.by_command or field.key in values]
    below = [declared for declared in offered if _is_below(declared, values.get(declared.key))]
    for declared in offered:
        if declared in below:
            continue
        yield from _comment_lines(declared, notes)
        if declared.key in values:
            yield f"{key_of(declared.key)} = {value_text(values[declared.key])}"
        else:
            yield f"#{key_of(declared.key)} = {_example(declared, root)}{_mark(declared)}"
    for declared in below:
        yield ""
        yield from _comment_lines(declared, notes)
        names = (*path, declared.key)
        header, entry = ".".join(map(key_of, names)), values.get(declared.key)
        if isinstance(declared.kind, FormsKind):
            yield from _variant_lines(declared.kind, names, entry, root, required=declared.required)
            continue
        inner = _inner_table(declared.kind)
        if isinstance(entry, list):
            for part in entry:
                yield from (f"[[{header}]]", *table_lines(part, names), *_lacking(inner, part, root))
        elif isinstance(declared.kind, ListKind | KeyedKind) and entry is not None:
            yield from (f"[{header}]", *_keyed_lines(inner, entry, names))
        elif inner is not None and (entry is not None or _is_needed(declared)):
            yield f"[{header}]"
            yield from _entries(inner, names, entry or {}, {}, root)
        elif inner is not None:
            yield from _inner_lines(declared, names, on=False, root=root, marked=True)


def _keyed_lines(inner: TableKind | None, entry: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[str]:
    """Yield the tables of names, each with what it does not state yet."""
    fields = () if inner is None else inner.fields
    required = [declared.key for declared in fields if declared.required]
    lines = table_lines(entry, names)
    if len(lines) != len(entry):  # one of them is too long for one line
        yield from lines
        return
    for line, part in zip(lines, entry.values(), strict=True):
        absent = [key for key in required if isinstance(part, Mapping) and key not in part]
        yield f"{line}{_FILL_IN}: {', '.join(absent)}" if absent else line


def _lacking(inner: TableKind | None, part: Mapping[str, Any], root: Root | None) -> Iterator[str]:
    """Yield the required entries that a table of a list does not state.

    A choice has no example there: beside entries that are stated it would be a guess.
    """
    for declared in () if inner is None else inner.fields:
        if declared.required and declared.key not in part:
            yield from _comment(_sentence(declared))
            open_ = isinstance(declared.kind, ChoiceKind)
            example = value_text("...") if open_ else _example(declared, root)
            yield f"#{key_of(declared.key)} = {example}{_FILL_IN}"


def _variant_lines(
    kind: FormsKind,
    names: tuple[str, ...],
    entry: Mapping[str, Any] | None,
    root: Root | None,
    *,
    required: bool,
) -> Iterator[str]:
    """Return the table that the entry's word chooses; all of them, commented out, where none is chosen."""
    header = ".".join(map(key_of, names))
    table = None if entry is None else kind.tables.get(entry.get(kind.tag or ""))
    if entry is not None and table is not None:
        yield f"[{header}]"
        yield from _entries(table, names, entry, {}, root)
        return
    if entry is not None:
        yield from (f"[{header}]", *table_lines(entry, names))
        return
    yield f"#[{header}]{_FILL_IN if required else ''}"
    for at, (word, form) in enumerate(kind.tables.items()):
        # One of them must be filled in: the first is marked, and whoever wants another takes its lines.
        marked = required and not at
        chosen_by = f"{kind.tag} = {value_text(word)}"
        yield from _comment(f"{'or' if at else 'either'} {chosen_by}: {summary(form.cls)}")
        yield f"#{chosen_by}{_FILL_IN if marked else ''}"
        for declared in (field for field in form.fields if field.key != kind.tag):
            yield from _comment_lines(declared, {})
            mark = _FILL_IN if marked and declared.required else ""
            yield f"#{key_of(declared.key)} = {_example(declared, root)}{mark}"


def _is_below(declared: Field, entry: Any = None) -> bool:
    """Tell whether an entry has a table of its own; tables that are known have one, however short."""
    if isinstance(declared.kind, ListKind | KeyedKind) and _inner_table(declared.kind) is not None and entry:
        return all(
            isinstance(part, Mapping) for part in (entry if isinstance(entry, list) else entry.values())
        )
    if isinstance(declared.kind, FormsKind):
        return declared.kind.tag is not None and declared.kind.entry.example is None
    return _inner_table(declared.kind) is not None and declared.kind.entry.example is None


def _is_needed(declared: Field) -> bool:
    return declared.required and not isinstance(declared.kind, ListKind | KeyedKind)


def _mark(declared: Field) -> str:
    """Return the mark of an entry that must be stated, or of a table in which one must be."""
    kind = declared.kind
    asked = kind.entry.asked or (isinstance(kind, TableKind) and next(_demands(kind, {}, ""), None))
    return _FILL_IN if declared.required or asked else ""


def _comment_lines(declared: Field, notes: Notes) -> list[str]:
    note = notes.get(declared.key, "")
    return [*_comment(_sentence(declared)), *_comment(note)]
