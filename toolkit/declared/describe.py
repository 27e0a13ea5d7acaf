"""What a declaration says for people and programs: starter file, reference page, JSON schema."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator
from typing import Any

from toolkit.declared.declaration import form_of, table_of
from toolkit.declared.kinds import Kind
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.declared.marks import Format
from toolkit.declared.tables import Field, FormsKind, TableKind
from toolkit.declared.writing import key_of, value_text

_WIDTH = 100


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


def _starter_table(kind: TableKind, path: tuple[str, ...], *, on: bool) -> Iterator[str]:
    below = []
    for declared in kind.fields:
        if _inner_table(declared.kind) is not None and declared.kind.entry.example is None:
            below.append(declared)
            continue
        enabled = on and declared.required
        yield from _comment(_sentence(declared))
        yield f"{'' if enabled else '#'}{key_of(declared.key)} = {_example(declared)}"
        if declared.beside is not None and declared.beside not in kind.own_keys:
            yield f'{"" if enabled else "#"}{declared.beside} = "{declared.unit}"'
    for declared in below:
        inner = _inner_table(declared.kind)
        if inner is None:
            continue
        enabled, names = on and declared.required, (*path, declared.key)
        yield ""
        yield from _comment(_sentence(declared))
        header, inside = ".".join(map(key_of, names)), names
        if isinstance(declared.kind, KeyedKind):
            inside = (*names, next(iter(declared.kind.example())))
            header = ".".join(map(key_of, inside))
        brackets = ("[[", "]]") if isinstance(declared.kind, ListKind) else ("[", "]")
        yield f"{'' if enabled else '#'}{brackets[0]}{header}{brackets[1]}"
        yield from _starter_table(inner, inside, on=enabled)


def _inner_table(kind: Kind) -> TableKind | None:
    """Return the table below an entry, None where the entry is a value in one line."""
    if isinstance(kind, TableKind):
        return kind
    inner = kind.item if isinstance(kind, ListKind | KeyedKind) else None
    return inner if isinstance(inner, TableKind) else None


def _example(declared: Field) -> str:
    kind = declared.kind
    if declared.required or kind.entry.example is not None or declared.default in (None, (), ""):
        return value_text(kind.example())
    return value_text(kind.write(declared.default))


def _sentence(declared: Field) -> str:
    parts = [declared.kind.entry.help or declared.key.replace("_", " ")]
    if _inner_table(declared.kind) is None:
        parts.append(declared.kind.expected)
    parts.append("required" if declared.required else f"default {_default(declared) or 'none'}")
    return "; ".join(parts)


def _default(declared: Field) -> str:
    if declared.required or declared.default in (None, ()) or _inner_table(declared.kind) is not None:
        return ""
    return value_text(declared.kind.write(declared.default))


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
    former = "".join(f"; formerly `{key}`" for key in declared.kind.entry.old)
    holds = declared.kind.expected
    if _inner_table(declared.kind) is not None and declared.kind.entry.expected is None:
        tables = {ListKind: "tables below, [[...]]", KeyedKind: "tables below, by name"}
        holds = tables.get(type(declared.kind), "the table below")
    cells = (f"`{declared.key}`", holds, default, declared.kind.entry.help + former)
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
