"""From a dataclass to what it declares: its annotations and marks, read once."""

from __future__ import annotations

import dataclasses
import datetime as dt
import functools
import pathlib
import types
import typing
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from toolkit.declared.kinds import (
    AnyKind,
    BoolKind,
    ChoiceKind,
    DateKind,
    FileKind,
    Kind,
    NumberKind,
    TextKind,
)
from toolkit.declared.lists import KeyedKind, ListKind
from toolkit.declared.marks import (
    Above,
    AtLeast,
    AtMost,
    Below,
    Day,
    Distinct,
    Entry,
    Format,
    Keyed,
    Names,
    Short,
    Size,
    Text,
    Unit,
    UnitName,
)
from toolkit.declared.quantities import QuantityKind, UnitKind
from toolkit.declared.tables import MISSING, Field, FormsKind, TableKind

Marks = tuple[Any, ...]
# Marks of a list that are meant for the list; all others are meant for each of its elements.
_OF_LIST = (Entry, Size, Distinct, Keyed)


def table_of(cls: type) -> TableKind:
    """Return what a dataclass declares.

    Raises
    ------
    TypeError
        it is no dataclass, or an annotation has no kind
    """
    if not dataclasses.is_dataclass(cls):
        raise TypeError(f"{cls.__name__} is no dataclass: only dataclasses declare a format")
    return TableKind(cls=cls, fields_of=fields_of, form_of=form_of(cls))


def form_of(cls: type) -> Format | None:
    """Return the class's own `Format`, None where it goes by that of the table around it."""
    form = vars(cls).get("FORMAT")
    return form if isinstance(form, Format) else None


@functools.cache
def fields_of(cls: type) -> tuple[Field, ...]:
    """Return the fields of a dataclass that a file has, in their order."""
    hints = typing.get_type_hints(cls, include_extras=True)
    fields = []
    for declared in dataclasses.fields(cls):
        annotation, marks = _bare(hints[declared.name])
        entry = _mark(marks, Entry) or Entry()
        if not declared.init or not entry.output:
            continue
        try:
            kind, optional = kind_of(annotation, marks)
        except TypeError as error:
            raise TypeError(f"{cls.__name__}.{declared.name}: {error}") from error
        default = declared.default
        if declared.default_factory is not dataclasses.MISSING:
            default = declared.default_factory()
        fields.append(
            Field(
                name=declared.name,
                key=entry.key or declared.name,
                kind=kind,
                default=MISSING if default is dataclasses.MISSING else default,
                optional=optional,
            )
        )
    return tuple(fields)


class Output(NamedTuple):
    """An entry of an answer: the attribute that holds it, its key, and what is declared of it."""

    name: str
    key: str
    annotation: Any
    sparse: bool
    by_name: bool

    def written(self, value: Any) -> Any:
        """Return the value of the attribute as a mapping where its pairs are one in the answer."""
        return dict(value) if self.by_name and value is not None else value


@functools.cache
def outputs_of(cls: type) -> tuple[Output, ...]:
    """Return the entries of an answer, whatever they hold, and the properties that are `derived`."""
    hints = typing.get_type_hints(cls, include_extras=True)
    outputs = []
    for declared in dataclasses.fields(cls):
        marks = _bare(hints[declared.name])[1]
        entry = _mark(marks, Entry) or Entry()
        if entry.output:
            outputs.append(_output(declared.name, entry, hints[declared.name], marks))
    for base in reversed(cls.__mro__):
        for name, member in vars(base).items():
            method = member.fget if isinstance(member, property) else None
            if method is not None and hasattr(method, "derived"):
                entry, after = method.derived
                held = typing.get_type_hints(method, include_extras=True)["return"]
                names = [output.name for output in outputs]
                place = len(names) if after is None else names.index(after) + 1 if after else 0
                outputs.insert(place, _output(name, entry, Annotated[held, entry], _bare(held)[1]))
    return tuple(outputs)


def _output(name: str, entry: Entry, annotation: Any, marks: Marks) -> Output:
    by_name = _mark(marks, Keyed) is not None
    return Output(name, entry.key or name, annotation, entry.sparse, by_name)


def kind_of(annotation: Any, marks: Marks = ()) -> tuple[Kind, bool]:
    """Return the kind of an annotation with its marks, and whether None may be held.

    Raises
    ------
    TypeError
        an annotation without a kind, or a mark that the kind does not know
    """
    annotation, more = _bare(annotation)
    marks = (*marks, *more)
    entry = _mark(marks, Entry) or Entry()
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        forms = [argument for argument in arguments if argument is not type(None)]
        optional = len(forms) < len(arguments)
        if len(forms) == 1:
            return kind_of(forms[0], marks)[0], optional
        kinds = tuple(_form(form, marks) for form in forms)
        return FormsKind(entry=entry, forms=kinds, tag=_tag(kinds)), optional
    if annotation is Any:
        return AnyKind(entry=entry), False
    if origin is Literal:
        return ChoiceKind(entry=entry, choices=arguments), False
    if annotation in _SINGLE:
        return _SINGLE[annotation](entry, marks), False
    if dataclasses.is_dataclass(annotation) and isinstance(annotation, type):
        table = table_of(annotation)
        short = _mark(marks, Short)
        return dataclasses.replace(table, entry=entry, short=short.key if short else None), False
    if origin in (tuple, list) or (origin is not None and issubclass(origin, Mapping)):
        return _several(origin, arguments, entry, marks), False
    raise TypeError(f"{annotation!r} declares no entry of a file")


def _several(origin: type, arguments: tuple[Any, ...], entry: Entry, marks: Marks) -> Kind:
    inner = tuple(mark for mark in marks if not isinstance(mark, _OF_LIST))
    size, keyed = _mark(marks, Size) or Size(0), _mark(marks, Keyed)
    if origin is not list and origin is not tuple:
        names = _mark(marks, Names)
        item = kind_of(arguments[1], _without(inner, Names))[0]
        return KeyedKind(entry=entry, item=item, pairs=False, names=names, size=size)
    element, several = arguments[0], origin is list or arguments[-1] is Ellipsis
    if keyed is not None and several:
        names, item_marks = _mark(marks, Names), _without(inner, Names)
        if keyed.by is None:  # pairs of a name and its value
            item = kind_of(get_args(element)[1], item_marks)[0]
            return KeyedKind(entry=entry, item=item, names=names, size=size)
        table = kind_of(element, item_marks)[0]
        if not isinstance(table, TableKind):
            raise TypeError(f"{element!r} is no dataclass: only one can hold the name of its table")
        table = dataclasses.replace(table, named_by=keyed.by)
        return KeyedKind(entry=entry, item=table, by=keyed.by, names=names, size=size)
    if not several:
        kinds = tuple(kind_of(argument, inner)[0] for argument in arguments)
        return ListKind(entry=entry, item=kinds[0], fixed=kinds)
    item = kind_of(element, inner)[0]
    return ListKind(entry=entry, item=item, size=size, distinct=_mark(marks, Distinct))


def _number(entry: Entry, marks: Marks, *, integer: bool) -> Kind:
    limits = tuple(mark for mark in marks if isinstance(mark, Above | AtLeast | Below | AtMost))
    number, unit = NumberKind(entry=entry, limits=limits, integer=integer), _mark(marks, Unit)
    return number if unit is None else QuantityKind(entry=entry, number=number, unit=unit)


def _text(entry: Entry, marks: Marks) -> Kind:
    if (day := _mark(marks, Day)) is not None:
        return DateKind(entry=entry, text=True, moment=day.moment)
    if (unit := _mark(marks, UnitName)) is not None:
        return UnitKind(entry=entry, mark=unit)
    return TextKind(entry=entry, text=_mark(marks, Text) or Text(), names=_mark(marks, Names))


_SINGLE: dict[Any, Any] = {
    bool: lambda entry, _: BoolKind(entry=entry),
    int: lambda entry, marks: _number(entry, marks, integer=True),
    float: lambda entry, marks: _number(entry, marks, integer=False),
    str: _text,
    dt.date: lambda entry, _: DateKind(entry=entry),
    pathlib.Path: lambda entry, _: FileKind(entry=entry),
}


def _form(annotation: Any, marks: Marks) -> Kind:
    """Return the kind of one of several forms; of single values all say what the field expects."""
    annotation, inner_marks = _bare(annotation)
    several = dataclasses.is_dataclass(annotation) or get_origin(annotation) is not None
    inner = tuple(mark for mark in marks if not (several and isinstance(mark, Entry)))
    return kind_of(annotation, (*inner_marks, *inner))[0]


def _tag(kinds: tuple[Kind, ...]) -> str | None:
    """Return the field whose word tells tables apart: a choice in each of them; None: their keys must."""
    tables = [kind for kind in kinds if isinstance(kind, TableKind)]
    if len(tables) < 2:
        return None
    names = [{field.name for field in table.fields if isinstance(field.kind, ChoiceKind)} for table in tables]
    shared = sorted(set.intersection(*names))
    return shared[0] if shared else None


def _bare(annotation: Any) -> tuple[Any, Marks]:
    marks: Marks = ()
    while get_origin(annotation) is Annotated:
        marks = (*marks, *annotation.__metadata__)
        annotation = annotation.__origin__
    return annotation, marks


def _mark(marks: Marks, kind: type[Any]) -> Any:
    return next((mark for mark in marks if isinstance(mark, kind)), None)


def _without(marks: Marks, kind: type[Any]) -> Marks:
    return tuple(mark for mark in marks if not isinstance(mark, kind))
