"""Answers declared as typed dictionaries: the page that describes one, and its schema.

An answer is what a command prints with ``--json``. The function that builds it returns a `TypedDict`, so that
the type checker holds its keys and values to the declaration; page and schema are of the same lines:

>>> from typing import Annotated, TypedDict
>>> class Peak(TypedDict):
...     "The largest force."
...     FY_N: Annotated[float, "lateral force"]
...     at_rad: Annotated[float | None, "slip angle; null where the peak was not reached"]
>>> print(answer_reference(Peak))
[`Peak`](#peak).
<BLANKLINE>
### Peak
<BLANKLINE>
The largest force.
<BLANKLINE>
| key | holds | meaning |
|---|---|---|
| `FY_N` | number | lateral force |
| `at_rad` | number or null | slip angle; null where the peak was not reached |
<BLANKLINE>

An entry that repeats attributes of objects is filled from them: its keys stand in the declaration alone.

>>> entry_of(Peak, object(), FY_N=4000.0, at_rad=None)
{'FY_N': 4000.0, 'at_rad': None}

A text beside a type in ``Annotated`` says what the entry means. Keys that not every answer has are
`NotRequired`. A dataclass that `declared.answer` prints declares its answer as it is; `merged` joins the keys
of several declarations, and an answer of several forms is a union of them.
"""

from __future__ import annotations

import dataclasses
import datetime as dt
import functools
import inspect
import operator
import pathlib
import re
import types
import typing
from collections.abc import Hashable, Iterator, Mapping, Sequence, Set
from typing import (
    Annotated,
    Any,
    Literal,
    TypedDict,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    is_typeddict,
)

from toolkit.declared.declaration import outputs_of
from toolkit.declared.marks import Entry, Keyed, NullIsNan

T = TypeVar("T")
_WORDS: dict[Any, tuple[str, str]] = {
    str: ("text", "string"),
    float: ("number", "number"),
    int: ("whole number", "integer"),
    bool: ("true or false", "boolean"),
    type(None): ("null", "null"),
    pathlib.Path: ("path", "string"),
    dt.date: ("date", "string"),
}
"""The word for people and the type of JSON of single values."""


def merged(*tables: Any, name: str | None = None) -> Any:
    """Return the declaration of an answer that has the keys of several; the text is the first's."""
    entries = {
        key: annotation if required else typing.NotRequired[annotation]
        for table in reversed(tables)
        for key, annotation, required in _entries(table)
    }
    joined = TypedDict(name or tables[0].__name__, entries)  # type: ignore[misc]
    joined.__doc__ = tables[0].__doc__
    return joined


def extended(declared: type[T], source: object, /, **more: Any) -> T:
    """Return an answer that is declared as another one and more: fields of that one, the rest stated."""
    fields = {field.name: getattr(source, field.name) for field in dataclasses.fields(cast("Any", source))}
    return declared(**(fields | more))


def entry_of(declared: type[T], /, *sources: object, **stated: Any) -> T:
    """Return an entry of an answer: its keys as attributes of the first source that has them, or as stated.

    What stands inside is filled alike; dates and paths are texts where the declaration says so.

    Raises
    ------
    AttributeError
        no source has an attribute for a key that every answer has
    TypeError
        something is stated that is not declared
    """
    entry, kind = dict(stated), cast("Any", declared)
    for key, annotation, required in _entries(kind):
        source = next((source for source in sources if hasattr(source, key)), None)
        if key not in entry and (required or source is not None):
            entry[key] = _filled(getattr(source, key), annotation)
    if surplus := entry.keys() - {key for key, _, _ in _entries(kind)}:
        raise TypeError(f"{kind.__name__} declares no {', '.join(sorted(surplus))}")
    return cast("T", {key: entry[key] for key, _, _ in _entries(kind) if key in entry})


def _filled(value: Any, annotation: Any) -> Any:
    """Return a value as its declaration holds it."""
    annotation = _bare(annotation)[0]
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        forms = [form for form in inner if form is not type(None)]
        return value if value is None or len(forms) > 1 else _filled(value, forms[0])
    if is_typeddict(annotation) and not isinstance(value, Mapping):
        return value.as_dict() if hasattr(value, "as_dict") else entry_of(annotation, value)
    if _is_mapping(origin):
        return {key: _filled(entry, inner[1]) for key, entry in dict(value).items()}
    if _is_list(origin):
        fixed = origin is tuple and inner[-1] is not Ellipsis
        return [_filled(entry, inner[at] if fixed else inner[0]) for at, entry in enumerate(value)]
    if annotation is str and isinstance(value, dt.date | pathlib.Path):
        return str(value)
    return value


def answer_reference(cls: Any, *, described: dict[Any, None] | None = None) -> str:
    """Return the description of an answer, Markdown: its name, then a table of keys for each kind of entry.

    Kinds of entries in ``described`` are not described again; those that are enter it.
    """
    lines = [f"{_linked(cls)}.", ""]
    for place, table in tables_of(cls, described=described):
        lines += [f"### {table.__name__}", "", (f"`{place}`: " if place else "") + _summary(table), ""]
        lines += ["| key | holds | meaning |", "|---|---|---|"]
        for key, annotation, required in _entries(table):
            annotation, meaning = _bare(annotation)
            cells = (f"`{key}`", _linked(annotation), ("" if required else "not always: ") + meaning)
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines.append("")
    return "\n".join(lines)


def answer_schema(cls: Any) -> dict[str, Any]:
    """Return the JSON schema (2020-12) of an answer."""
    forms = [_table_schema(table, document=True) for _, table in _inner(cls, "")]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **(forms[0] if len(forms) == 1 else {"anyOf": forms}),
        "$defs": {table.__name__: _table_schema(table) for _, table in tables_of(cls)},
    }


def tables_of(cls: Any, *, described: dict[Any, None] | None = None) -> Iterator[tuple[str, Any]]:
    """Yield each kind of entry of an answer with the place where it first stands, but for those described."""
    return _tables(cls, "", {} if described is None else described)


def _is_table(annotation: Any) -> bool:
    return is_typeddict(annotation) or (isinstance(annotation, type) and dataclasses.is_dataclass(annotation))


@functools.cache
def _entries(cls: Hashable) -> tuple[tuple[str, Any, bool], ...]:
    """Return key, annotation and whether every answer has it."""
    if is_typeddict(cls):
        hints = typing.get_type_hints(cls, include_extras=True).items()
        # `__required_keys__` does not know the marks of annotations that are kept as texts.
        return tuple(
            (key, annotation, get_origin(annotation) is not typing.NotRequired) for key, annotation in hints
        )
    return tuple(
        (output.key, _but_null(output.annotation) if output.sparse else output.annotation, not output.sparse)
        for output in outputs_of(cls)
    )


def _but_null(annotation: Any) -> Any:
    """Return what a sparse entry holds where it stands: not None."""
    annotation, *marks = get_args(annotation)
    forms = (form for form in get_args(annotation) if form is not type(None))
    return Annotated[(functools.reduce(operator.or_, forms), *marks)]


@functools.cache
def _bare(annotation: Any) -> tuple[Any, str]:
    """Return an annotation without its marks, and the text beside it."""
    meaning = ""
    marks: list[Any] = []
    while get_origin(annotation) in (Annotated, typing.NotRequired, typing.Required):
        marks += get_args(annotation)[1:]
        annotation = get_args(annotation)[0]
    for mark in marks:
        if isinstance(mark, Entry | str):
            meaning = meaning or (mark.help if isinstance(mark, Entry) else mark)
        elif isinstance(mark, NullIsNan):
            annotation |= None
        elif isinstance(mark, Keyed):  # pairs of a name and its value
            annotation = Mapping[str, get_args(get_args(annotation)[0])[1]]  # type: ignore[misc]
    if _is_table(annotation) and callable(as_dict := getattr(annotation, "as_dict", None)):
        # An object that says how it is printed is declared by that.
        annotation = typing.get_type_hints(as_dict, include_extras=True)["return"]
    return annotation, meaning


def _is_mapping(origin: Any) -> bool:
    return isinstance(origin, type) and issubclass(origin, Mapping)


def _is_list(origin: Any) -> bool:
    return isinstance(origin, type) and issubclass(origin, Sequence | Iterator | Set)


def words_of(annotation: Any) -> str:
    """Return what an annotation holds, for people."""
    annotation = _bare(annotation)[0]
    origin, inner = get_origin(annotation), get_args(annotation)
    if annotation is Any:
        return "any value"
    if _is_table(annotation):
        return f"`{annotation.__name__}`"
    if origin in (Union, types.UnionType):
        return " or ".join(map(words_of, inner))
    if origin is Literal:
        return " or ".join(f'"{word}"' if isinstance(word, str) else str(word) for word in inner)
    if _is_mapping(origin):
        return f"by name: {_grouped(inner[1])}"
    if origin is tuple and inner[-1] is not Ellipsis:
        return f"[{', '.join(map(words_of, inner))}]"
    if _is_list(origin):
        return f"list of {_grouped(inner[0])}"
    return _WORDS[annotation][0]


def _grouped(annotation: Any) -> str:
    words = words_of(annotation)
    return f"({words})" if " or " in words else words


def _linked(annotation: Any) -> str:
    return re.sub(r"`(\w+)`", lambda name: f"[{name[0]}](#{name[1].lower()})", words_of(annotation))


def _table_schema(cls: Any, *, document: bool = False) -> dict[str, Any]:
    """Return the schema of a table; a document begins with ``"schema": 1``."""
    properties: dict[str, Any] = {"schema": {"const": 1}} if document else {}
    required = list(properties)
    for key, annotation, always in _entries(cls):
        annotation, meaning = _bare(annotation)
        properties[key] = ({"description": meaning} if meaning else {}) | _schema(annotation)
        required += [key] if always else []
    return {
        "type": "object", "description": _summary(cls), "properties": properties, "required": required,
        "additionalProperties": False,
    }  # fmt: skip


def _schema(annotation: Any) -> dict[str, Any]:
    annotation = _bare(annotation)[0]
    origin, inner = get_origin(annotation), get_args(annotation)
    if annotation is Any:
        return {}
    if _is_table(annotation):
        return {"$ref": f"#/$defs/{annotation.__name__}"}
    if origin in (Union, types.UnionType):
        return {"anyOf": [_schema(form) for form in inner]}
    if origin is Literal:
        return {"enum": list(inner)}
    if _is_mapping(origin):
        return {"type": "object", "additionalProperties": _schema(inner[1])}
    if origin is tuple and inner[-1] is not Ellipsis:
        return {"type": "array", "prefixItems": [_schema(form) for form in inner], "maxItems": len(inner)}
    if _is_list(origin):
        return {"type": "array", "items": _schema(inner[0])}
    return {"type": _WORDS[annotation][1]}


def _tables(cls: Any, place: str, described: dict[Any, None]) -> Iterator[tuple[str, Any]]:
    """Yield every table of an answer with the place where it first stands; its forms first."""
    if not _is_table(cls):
        for path, table in _inner(cls, place):
            yield from _tables(table, path, described)
        return
    if cls in described:
        return
    described[cls] = None
    yield place, cls
    for key, annotation, _ in _entries(cls):
        for path, table in _inner(annotation, f"{place}.{key}".lstrip(".")):
            yield from _tables(table, path, described)


def _inner(annotation: Any, place: str) -> Iterator[tuple[str, Any]]:
    annotation = _bare(annotation)[0]
    origin = get_origin(annotation)
    if _is_table(annotation):
        yield place, annotation
        return
    path = f"{place}.NAME" if _is_mapping(origin) else f"{place}[]" if _is_list(origin) else place
    for form in get_args(annotation) if origin is not Literal else ():
        yield from _inner(form, path)


def _summary(cls: Any) -> str:
    return " ".join((inspect.getdoc(cls) or cls.__name__).split("\n\n")[0].split())
