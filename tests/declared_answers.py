"""Every answer that a command gives in a test is what the command declares."""

from __future__ import annotations

import datetime as dt
import pathlib
import types
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, Union, get_args, get_origin

import typer._click.globals

from toolkit.cli import console
from toolkit.declared import answers

_print, _stream = console.answer, console.stream


def hold_to_declarations() -> None:
    """Hold what commands answer from now on to what they declare; before their modules are imported."""
    console.answer, console.stream = _answer, _answer_in_parts


def _answer(payload: Mapping[str, Any], text: str, *, as_json: bool, quiet: bool) -> None:
    _check(payload, whole=as_json)
    _print(payload, text, as_json=as_json, quiet=quiet)


def _answer_in_parts(payload: dict[str, Any]) -> None:
    lists = {key: list(value) for key, value in payload.items() if isinstance(value, Iterator)}
    _check(payload | lists, whole=True)
    _stream(payload | {key: iter(value) for key, value in lists.items()})


def _check(payload: Mapping[str, Any], *, whole: bool) -> None:
    """Refuse an answer that departs; one that is printed for people may lack keys."""
    from toolkit.cli.groups import declared_type
    from toolkit.declared import json_value

    context = typer._click.globals.get_current_context(silent=True)
    declared = None if context is None else getattr(context.command.callback, "answer", None)
    if context is None and "requested" in payload:  # a request is answered after its command has ended
        declared = "toolkit.lab.signatures.signing:RequestedAnswer"
    if declared is not None:
        document = {key: value for key, value in json_value(payload).items() if key != "schema"}
        departs = [
            fault
            for fault in departures(document, declared_type(declared))
            if whole or not fault.endswith(": missing")
        ]
        assert not departs, departs


def departures(value: Any, annotation: Any, place: str = "") -> Iterator[str]:
    """Yield each place where an answer, as JSON or before it is written, is not what is declared.

    >>> from typing import TypedDict
    >>> class Peak(TypedDict):
    ...     FY_N: float
    ...     at_rad: float | None
    >>> list(departures({"FY_N": "much"}, Peak))
    ["FY_N: 'much' is no number", 'at_rad: missing']
    """
    annotation = answers._bare(annotation)[0]
    origin, inner = get_origin(annotation), get_args(annotation)
    if annotation is Any:
        return
    if answers._is_table(annotation) and isinstance(value, Mapping):
        entries = {key: (held, required) for key, held, required in answers._entries(annotation)}
        for key in (*entries, *(key for key in value if key not in entries)):
            path = f"{place}.{key}".lstrip(".")
            if key not in entries:
                yield f"{path}: not declared"
            elif key in value:
                yield from departures(value[key], entries[key][0], path)
            elif entries[key][1]:
                yield f"{path}: missing"
    elif origin in (Union, types.UnionType):
        tried: list[list[str]] = []
        for form in inner:
            tried.append(list(departures(value, form, place)))
            if not tried[-1]:
                return
        # What comes nearest is what was meant: the form with the fewest departures below the place itself.
        yield from min(tried, key=lambda faults: (f"{place}: " in faults[0], len(faults)))
    elif origin is Literal:
        if value not in inner:
            yield f"{place}: {value!r} is none of {', '.join(map(str, inner))}"
    elif answers._is_mapping(origin) and isinstance(value, Mapping):
        for key, entry in value.items():
            yield from departures(entry, inner[1], f"{place}.{key}")
    elif answers._is_list(origin) and isinstance(value, Sequence | Iterator) and not isinstance(value, str):
        for at, entry in enumerate(value):
            fixed = origin is tuple and inner[-1] is not Ellipsis
            yield from departures(entry, inner[at] if fixed else inner[0], f"{place}[{at}]")
    elif not _holds(value, annotation):
        yield f"{place}: {value!r:.60} is no {answers.words_of(annotation)}"


def _holds(value: Any, annotation: Any) -> bool:
    if annotation is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    if annotation in (pathlib.Path, dt.date):
        return isinstance(value, annotation | str)
    if annotation is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return annotation in answers._WORDS and isinstance(value, annotation)
