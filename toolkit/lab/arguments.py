"""The arguments of public names, held against their annotations before anything is done.

A notebook gives what it has at hand: a text for a day, a number for a name. Every public name is `checked`,
so that what is of another kind is refused alike everywhere, and a day is one however it is written. Columns
of data have a gate of their own (`toolkit.lab.quantities`).
"""

from __future__ import annotations

import datetime as dt
import functools
import inspect
import os
from collections.abc import Callable, Iterable
from numbers import Integral, Real
from typing import Any, ParamSpec, TypeVar

from toolkit.days import FORM, parse_day
from toolkit.errors import ConfigError

P = ParamSpec("P")
R = TypeVar("R")


class _OtherKindError(Exception):
    """What was expected and what to do; never leaves this module."""

    def __init__(self, expected: str, next_step: str = "give what is expected") -> None:
        super().__init__(expected)
        self.next_step = next_step


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise _OtherKindError("a text")
    return value


def _path(value: Any) -> str | os.PathLike[str]:
    if not isinstance(value, str | os.PathLike) or "\0" in os.fspath(value):
        raise _OtherKindError("a path, as a text or a pathlib.Path")
    return value


def _switch(value: Any) -> bool:
    # numpy is not loaded for it; its truth values have this name.
    if not isinstance(value, bool) and type(value).__name__ not in ("bool", "bool_"):
        raise _OtherKindError("True or False")
    return bool(value)


def _number(value: Any) -> float:
    if not isinstance(value, Real) or isinstance(value, bool) or value != value:
        raise _OtherKindError("a number")
    return float(value)


def _count(value: Any) -> int:
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise _OtherKindError("a whole number")
    return int(value)


def _texts(value: Any) -> tuple[str, ...]:
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise _OtherKindError("a list of texts", "put it into a list")
    return tuple(_text(entry) for entry in value)


def _day(value: Any) -> dt.date:
    expected = f"a day: {FORM}, a date, or a datetime without a time zone"
    if isinstance(value, str):
        try:
            return parse_day(value)
        except ValueError as error:
            raise _OtherKindError(expected) from error
    if type(value).__name__ == "datetime64":
        value = value.astype("datetime64[us]").item()
    if not isinstance(value, dt.date) or value != value:
        raise _OtherKindError(expected)
    if not isinstance(value, dt.datetime):
        return value
    if value.tzinfo is not None:
        raise _OtherKindError(expected, "give the day in the laboratory's own time, such as moment.date()")
    return value.date()


def _processed(value: Any) -> Any:
    if "ProcessedTest" not in {cls.__name__ for cls in type(value).__mro__}:
        raise _OtherKindError("a test that was processed", "call process() of the test first")
    return value


KINDS: dict[str, Callable[[Any], Any]] = {
    "str": _text,
    "Axes": _text,
    "Angles": _text,
    "Loss": _text,
    "str | Path": _path,
    "bool": _switch,
    "float": _number,
    "int": _count,
    "dt.date": _day,
    "Sequence[str]": _texts,
    "ProcessedTest": _processed,
}
KINDS |= {f"{annotation} | None": check for annotation, check in KINDS.items()}
"""By annotation: what returns a value as it is used, or raises. Other annotations are not looked at."""


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Return a public function that refuses arguments of another kind than its annotations say.

    Raises
    ------
    ConfigError
        ``wrong-argument``, by the function; what Python says of names and numbers of arguments stays
    """
    signature = inspect.signature(function)
    kinds = {
        name: (declared, KINDS[declared.annotation])
        for name, declared in signature.parameters.items()
        if declared.annotation in KINDS
    }

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError:
            return function(*args, **kwargs)  # raises what Python says
        for name, value in bound.arguments.items():
            if name not in kinds:
                continue
            declared, check = kinds[name]
            if value is None and "None" in declared.annotation:
                continue
            where = f"{function.__qualname__}, {name}"
            if declared.kind is inspect.Parameter.VAR_POSITIONAL:
                bound.arguments[name] = tuple(_held(check, entry, name, where) for entry in value)
            else:
                bound.arguments[name] = _held(check, value, name, where)
        return function(*bound.args, **bound.kwargs)

    return call


def _held(check: Callable[[Any], Any], value: Any, name: str, where: str) -> Any:
    try:
        return check(value)
    except _OtherKindError as error:
        raise ConfigError(
            f"the argument {name} is of another kind", where=where, got=f"{value!r} ({type(value).__name__})",
            expected=error, next_step=error.next_step, rule="wrong-argument",
        ) from None  # fmt: skip
