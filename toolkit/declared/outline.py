"""A new file of a declared format: what is known stands in it, what is not is told, nothing is made up.

Unlike `describe.starter`, whose required entries hold examples, an entry that nobody gave is commented out:
the file is refused until a person has filled it in, with all that is missing in one message.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from toolkit.declared.declaration import form_of, table_of
from toolkit.declared.describe import (
    _comment,
    _example,
    _inner_table,
    _sentence,
    _starter_table,
    summary,
)
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.declared.marks import Format
from toolkit.declared.tables import Field, FormsKind, TableKind
from toolkit.declared.writing import _table, key_of, value_text

Notes = Mapping[str, str]
"""Key of the top level -> how its value was come by."""


def outline(cls: type, values: Mapping[str, Any], notes: Notes | None = None) -> str:
    """Return the commented TOML file of a declared class with the values given and no others.

    Parameters
    ----------
    cls : the declared class
    values : entries as a file holds them: texts, numbers, dates, lists, dicts
    notes : what stands beside an entry, such as where its value was found
    """
    form, kind = form_of(cls) or Format(), table_of(cls)
    lines = [*_comment(f"{form.title[0].upper()}{form.title[1:]}: {summary(cls)}"), "#"]
    lines += [*_comment("Take the sign # away from an entry to state it; FILL IN marks what must be stated.")]
    lines += ["", *([] if form.schema is None else [f"schema = {form.schema}", ""])]
    lines += _entries(kind, (), values, notes or {})
    return "\n".join(lines).rstrip() + "\n"


def _entries(
    kind: TableKind, path: tuple[str, ...], values: Mapping[str, Any], notes: Notes
) -> Iterator[str]:
    below = [declared for declared in kind.fields if _is_below(declared)]
    for declared in kind.fields:
        if declared in below:
            continue
        yield from _told(declared, notes)
        if declared.key in values:
            yield f"{key_of(declared.key)} = {value_text(values[declared.key])}"
        elif declared.required:
            yield f"#{key_of(declared.key)} = {_example(declared)}   # FILL IN"
        else:
            yield f"#{key_of(declared.key)} = {_example(declared)}"
    for declared in below:
        yield ""
        yield from _told(declared, notes)
        names = (*path, declared.key)
        header, entry = ".".join(map(key_of, names)), values.get(declared.key)
        if isinstance(declared.kind, FormsKind):
            yield from _forms(declared.kind, names, entry, required=declared.required)
            continue
        inner = _inner_table(declared.kind)
        if isinstance(entry, list):
            for part in entry:
                yield from (f"[[{header}]]", *_table(part, names))
        elif isinstance(declared.kind, ListKind | KeyedKind) and entry is not None:
            yield from (f"[{header}]", *_table(entry, names))
        elif inner is not None and (entry is not None or _is_needed(declared)):
            yield f"[{header}]"
            yield from _entries(inner, names, entry or {}, {})
        elif inner is not None:
            yield from _commented(declared, inner, names)


def _forms(
    kind: FormsKind, names: tuple[str, ...], entry: Mapping[str, Any] | None, *, required: bool
) -> Iterator[str]:
    """Return the table that the entry's word chooses; all of them, commented out, where none is chosen."""
    header = ".".join(map(key_of, names))
    if entry is not None:
        chosen = kind.tables.get(entry.get(kind.tag or ""))
        yield f"[{header}]"
        yield from _table(entry, names) if chosen is None else _entries(chosen, names, entry, {})
        return
    yield f"#[{header}]" + ("   # FILL IN" if required else "")
    for at, (word, form) in enumerate(kind.tables.items()):
        chosen_by = f"{kind.tag} = {value_text(word)}"
        yield from _comment(f"{'or' if at else 'either'} {chosen_by}: {summary(form.cls)}")
        yield f"#{chosen_by}"
        for declared in (field for field in form.fields if field.key != kind.tag):
            yield from _told(declared, {})
            yield f"#{key_of(declared.key)} = {_example(declared)}"


def _is_below(declared: Field) -> bool:
    if isinstance(declared.kind, FormsKind):
        return declared.kind.tag is not None and declared.kind.entry.example is None
    return _inner_table(declared.kind) is not None and declared.kind.entry.example is None


def _is_needed(declared: Field) -> bool:
    return declared.required and not isinstance(declared.kind, ListKind | KeyedKind)


def _commented(declared: Field, inner: TableKind, names: tuple[str, ...]) -> Iterator[str]:
    header = names
    if isinstance(declared.kind, KeyedKind):
        header = (*names, next(iter(declared.kind.example())))
    left, right = ("[[", "]]") if isinstance(declared.kind, ListKind) else ("[", "]")
    mark = "   # FILL IN" if declared.required else ""
    yield f"#{left}{'.'.join(map(key_of, header))}{right}{mark}"
    yield from _starter_table(inner, header, on=False)


def _told(declared: Field, notes: Notes) -> list[str]:
    note = notes.get(declared.key, "")
    return [*_comment(_sentence(declared)), *_comment(note)]
