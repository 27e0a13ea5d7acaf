"""A JSON document back to the object that `declared.answer` wrote it of."""

from __future__ import annotations

import dataclasses
import datetime as dt
import math
import pathlib
import types
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin

from toolkit.declared.answers import words_of
from toolkit.declared.declaration import outputs_of
from toolkit.declared.marks import Keyed, NullIsNan

T = TypeVar("T")


def object_of(cls: type[T], document: Any) -> T:
    """Return the object of a document, or of a part of one.

    What `declared.answer` writes is read: null as NaN where the field has `OrNan`, lists as tuples, texts as
    dates and paths. A key that is not there has the field's default; those that are not declared are passed
    over: a newer version may have written them.

    Raises
    ------
    ValueError
        an entry is missing or not what is declared; the first that is not
    """
    return cast("T", _structured(document, cls, ""))


def _structured(value: Any, annotation: Any, place: str) -> Any:
    """Return a value of JSON as its annotation holds it."""
    kind: Any = annotation
    marks: list[Any] = []
    while get_origin(kind) is Annotated:
        kind, *annotated = get_args(kind)
        marks += annotated
    if value is None and any(isinstance(mark, NullIsNan) for mark in marks):
        return math.nan
    by_name = any(isinstance(mark, Keyed) for mark in marks)
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _of_forms(value, inner, annotation, place)
    if by_name and isinstance(value, Mapping):
        held = get_args(inner[0])[1]
        return tuple((name, _structured(entry, held, f"{place}.{name}")) for name, entry in value.items())
    if origin is tuple and isinstance(value, list) and not by_name:
        kinds = inner[:1] * len(value) if inner[-1] is Ellipsis else inner
        if len(kinds) == len(value):
            return tuple(
                _structured(*of, f"{place}[{at}]") for at, of in enumerate(zip(value, kinds, strict=True))
            )
    elif isinstance(origin, type) and issubclass(origin, Mapping) and isinstance(value, Mapping):
        return {name: _structured(entry, inner[1], f"{place}.{name}") for name, entry in value.items()}
    elif dataclasses.is_dataclass(kind) and isinstance(value, Mapping):
        return _object(cast("type", kind), value, place)
    elif kind is Any or (origin is Literal and value in inner):
        return value
    elif isinstance(kind, type) and origin is None:
        try:
            return _single(value, kind)
        except (TypeError, ValueError, OverflowError):
            pass
    raise ValueError(f"{place or 'the document'}: {value!r:.60} is no {words_of(annotation)}")


def _of_forms(value: Any, forms: tuple[Any, ...], annotation: Any, place: str) -> Any:
    """Return a value as the one of several forms that it has."""
    alternatives = [form for form in forms if form is not type(None)]
    if value is None and len(alternatives) < len(forms):
        return None
    if len(alternatives) == 1:
        return _structured(value, alternatives[0], place)
    for form in alternatives:
        try:
            return _structured(value, form, place)
        except ValueError:
            pass
    raise ValueError(f"{place}: {value!r:.60} is no {words_of(annotation)}")


def _object(cls: type, table: Mapping[str, Any], place: str) -> Any:
    """Return an object of a table; those of its properties that the table repeats are not read."""
    fields = {field.name: field for field in dataclasses.fields(cls)}
    entries = {}
    for name, key, annotation, *_ in outputs_of(cls):
        path = f"{place}.{key}".lstrip(".")
        if name in fields and key in table:
            entries[name] = _structured(table[key], annotation, path)
        elif (
            name in fields and (field := fields[name]).default is field.default_factory is dataclasses.MISSING
        ):
            raise ValueError(f"{path}: missing")
    return cls(**entries)


def _single(value: Any, kind: type) -> Any:
    """Return a text, number, truth value, date or path; raise where it is none."""
    if kind is float and type(value) in (int, float):
        return float(value)
    if kind is dt.date and isinstance(value, str):
        return dt.date.fromisoformat(value)
    if kind is pathlib.Path and isinstance(value, str):
        return pathlib.Path(value)
    if type(value) is kind and kind in (bool, int, str):
        return value
    raise TypeError
