"""Kinds of single values: how each is read, written and described.

A kind is made from an annotation and its marks, once for each declared class. Reading never raises for what a
file holds: a fault is told to the `Place`, and the value is `REFUSED`.
"""

from __future__ import annotations

import datetime as dt
import enum
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any, ClassVar

from toolkit.days import parse_day
from toolkit.declared.faults import MOST_TOLD, Fault, display
from toolkit.declared.marks import Above, AtLeast, AtMost, Below, Entry, Format, Names, Path, Text
from toolkit.files import is_number, number_expected
from toolkit.spelling import nearest


class _Refused(enum.Enum):
    REFUSED = "refused"


REFUSED = _Refused.REFUSED
Limit = Above | AtLeast | Below | AtMost


@dataclass(frozen=True, eq=False, repr=False)
class Place:
    """Where a value is read: the path of its keys, the format in force, the file's faults and its root.

    ``accepted`` as of `text.attempt`.
    """

    path: Path
    form: Format
    faults: list[Fault]
    root: Mapping[str, Any]
    accepted: bool = False

    def at(self, key: str | int) -> Place:
        """Return the place of an entry of this table or list."""
        return Place((*self.path, key), self.form, self.faults, self.root, self.accepted)

    def unknown(self, key: str, known: Sequence[str], present: Container[str]) -> str | None:
        """Tell a key that is not declared, and return the one that was meant; in an accepted file nothing."""
        if self.accepted:
            return None
        near = nearest(key, known, present) if len(self.faults) < MOST_TOLD else None
        self.at(key).refuse(key, ", ".join(known), kind="unknown", near=near)
        return near

    def refuse(
        self, got: Any, expected: str, *, what: str | None = None, rule: str | None = None, **more: Any
    ) -> _Refused:
        """Tell a fault, and return what a refused entry is read as."""
        expected = number_expected(got, expected)
        self.faults.append(
            Fault(key=self.path, got=got, expected=expected, what=what, rule=rule, form=self.form, **more)
        )
        return REFUSED


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Kind:
    """What one entry holds. ``entry`` is what its field says of it."""

    shape: ClassVar[type | tuple[type, ...]] = object
    entry: Entry = field(default_factory=Entry)

    def suits(self, value: Any) -> bool:
        """Tell whether a value has this kind's shape, whatever it holds."""
        return isinstance(value, self.shape) and not (
            isinstance(value, bool) and bool not in _types(self.shape)
        )

    def holds(self, value: Any) -> bool:
        """Tell whether a value is one that this kind has read."""
        return self.suits(value)

    @property
    def expected(self) -> str:
        """What may stand there, for people."""
        return self.entry.expected or self.form()

    def form(self) -> str:
        """Return what may stand there as the type and its marks say it."""
        raise NotImplementedError

    def read(self, value: Any, place: Place) -> Any:
        """Return what the entry is held as, or `REFUSED`."""
        raise NotImplementedError

    def write(self, value: Any) -> Any:
        """Return what is held as the file writes it: texts, numbers, dates, lists and dicts."""
        return value

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema of the entry."""
        raise NotImplementedError

    def example(self) -> Any:
        """Return a value that is valid, as a file holds it."""
        return self.entry.example

    def wrong(self, value: Any, place: Place) -> _Refused:
        """Refuse a value for not being what is expected."""
        return place.refuse(value, self.expected, rule=self.entry.rule)


def _types(shape: type | tuple[type, ...]) -> tuple[type, ...]:
    return shape if isinstance(shape, tuple) else (shape,)


class AnyKind(Kind):
    """Whatever TOML can hold: an entry that is judged elsewhere."""

    def form(self) -> str:
        """Return what may stand there."""
        return "a value"

    def read(self, value: Any, place: Place) -> Any:  # noqa: ARG002
        """Return the value as it is."""
        return value

    def schema(self) -> dict[str, Any]:
        """Return a schema that takes everything."""
        return {}

    def example(self) -> Any:
        """Return the example, else dots."""
        return "..." if self.entry.example is None else self.entry.example


class BoolKind(Kind):
    """True or false."""

    shape = bool

    def form(self) -> str:
        """Return what may stand there."""
        return "true or false"

    def read(self, value: Any, place: Place) -> Any:
        """Return the value."""
        return value if isinstance(value, bool) else self.wrong(value, place)

    def schema(self) -> dict[str, Any]:
        """Return the schema of a truth value."""
        return {"type": "boolean"}

    def example(self) -> Any:
        """Return a truth value."""
        return bool(self.entry.example)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class NumberKind(Kind):
    """A finite number inside its limits; ``whole``: without a decimal part."""

    shape = (int, float)
    limits: tuple[Limit, ...] = ()
    integer: bool = False

    def form(self) -> str:
        """Return what may stand there: ``a number above 0 and below 90``."""
        noun = "whole number" if self.integer else "number"
        if not self.limits:
            return f"a {noun}" if self.integer else "a finite number"
        if self.limits == (Above(0),):
            return f"a positive {noun}"
        return f"a {noun} {self.range()}"

    def range(self) -> str:
        """Return the limits in words."""
        words = {Above: "above", AtLeast: "from", Below: "below", AtMost: "up to"}
        return " and ".join(f"{words[type(limit)]} {limit.limit:g}" for limit in self.limits)

    def inside(self, number: float) -> bool:
        """Tell whether a number is finite and inside the limits."""
        return is_number(number) and all(
            number > limit.limit if isinstance(limit, Above) else
            number >= limit.limit if isinstance(limit, AtLeast) else
            number < limit.limit if isinstance(limit, Below) else
            number <= limit.limit
            for limit in self.limits
        )  # fmt: skip

    def read(self, value: Any, place: Place) -> Any:
        """Return a float, or an int where it is whole."""
        if not is_number(value) or not self.inside(value) or (self.integer and not isinstance(value, int)):
            return self.wrong(value, place)
        return value if self.integer else float(value)

    def write(self, value: Any) -> Any:
        """Return a number of Python; numpy's are turned into one."""
        return int(value) if self.integer else float(value)

    def schema(self) -> dict[str, Any]:
        """Return the schema of the number with its limits."""
        words = {
            Above: "exclusiveMinimum", AtLeast: "minimum", Below: "exclusiveMaximum", AtMost: "maximum",
        }  # fmt: skip
        limits = {words[type(limit)]: limit.limit for limit in self.limits}
        return {"type": "integer" if self.integer else "number", **limits}

    def example(self) -> Any:
        """Return the example, else the smallest handy number that is inside the limits."""
        if self.entry.example is not None:
            return self.entry.example
        candidates = (1, 0, *(limit.limit + step for limit in self.limits for step in (0, 1, -1)))
        number = next((number for number in candidates if self.inside(number)), None)
        if number is None:
            low, high = self.limits[0].limit, self.limits[-1].limit
            number = (low + high) / 2
        return int(number) if self.integer else float(number)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TextKind(Kind):
    """A text; ``names`` are those that may stand there."""

    shape = str
    text: Text = field(default_factory=Text)
    names: Names | None = None

    def form(self) -> str:
        """Return what may stand there."""
        if self.names is not None and self.names.of is None:
            return " | ".join(self.names.fixed)
        if self.names is not None:
            return f"a name of {self.names.of}"
        return "a text" if self.text.pattern is None else f"a text of the form {self.text.pattern}"

    def suits(self, value: Any) -> bool:
        """Tell whether a value is a text, or a number that may stand for one."""
        return isinstance(value, str) or self._from_number(value) is not None

    def _from_number(self, value: Any) -> str | None:
        integer, decimal = type(value) is int, type(value) is float
        taken = (integer and self.text.numbers != "") or (decimal and self.text.numbers == "any")
        return str(value) if taken else None

    def read(self, value: Any, place: Place) -> Any:
        """Return the text."""
        if place.accepted and self.text.numbers:
            return str(value)
        text = value if isinstance(value, str) else self._from_number(value)
        if text is not None and self.text.steers(text) and not place.accepted:
            return place.refuse(value, "a text without control characters", rule=self.entry.rule)
        if text is None or not self.text.fits(text):
            return self.wrong(value, place)
        names = () if self.names is None else self.names.names(place.root)
        if names and text not in names:
            near = nearest(text, names)
            return place.refuse(
                value, ", ".join(names), rule=self.entry.rule,
                what=f"{display(value, quoted=True)} is not known, did you mean {near!r}?" if near else None,
            )  # fmt: skip
        return text.strip() if self.text.strip else text

    def write(self, value: Any) -> Any:
        """Return the text."""
        return str(value)

    def schema(self) -> dict[str, Any]:
        """Return the schema of the text."""
        schema: dict[str, Any] = {"type": "string"}
        if self.text.numbers:
            schema = {"type": ["string", "integer" if self.text.numbers == "int" else "number"]}
        if self.text.pattern is not None:
            schema["pattern"] = f"^(?:{self.text.pattern})$"
        elif not self.text.empty:
            schema["minLength"] = 1
        if self.names is not None and self.names.of is None:
            schema["enum"] = list(self.names.fixed)
        return schema

    def example(self) -> Any:
        """Return the example, else the first name, else dots."""
        if self.entry.example is not None:
            return self.entry.example
        return self.names.fixed[0] if self.names is not None and self.names.fixed else "..."


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ChoiceKind(Kind):
    """One of a few words or whole numbers."""

    shape = (str, int)
    choices: tuple[Any, ...]

    def form(self) -> str:
        """Return what may stand there."""
        return (" or " if len(self.choices) <= 2 else ", ").join(map(str, self.choices))

    def read(self, value: Any, place: Place) -> Any:
        """Return the choice."""
        # True equals 1, and is none of the words.
        if isinstance(value, bool) or value not in [c for c in self.choices if type(c) is type(value)]:
            near = None
            if isinstance(value, str):
                near = nearest(value, [choice for choice in self.choices if isinstance(choice, str)])
            return place.refuse(
                value, self.expected, rule=self.entry.rule,
                what=f"{display(value, quoted=True)} is not known, did you mean {near!r}?" if near else None,
            )  # fmt: skip
        return value

    def schema(self) -> dict[str, Any]:
        """Return the schema of the choices."""
        return {"enum": list(self.choices)}

    def example(self) -> Any:
        """Return the example, else the first choice."""
        return self.choices[0] if self.entry.example is None else self.entry.example


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class DateKind(Kind):
    """A day, as a TOML date or as ISO 8601 text; held as a date, or as text where ``text`` is set."""

    shape = (dt.date, str)
    text: bool = False
    moment: bool = False

    def form(self) -> str:
        """Return what may stand there."""
        return "a date such as 2026-03-31"

    def read(self, value: Any, place: Place) -> Any:
        """Return the date."""
        day = value if type(value) is dt.date else None
        if self.moment and isinstance(value, dt.datetime):
            day = value.date()
        if isinstance(value, str):
            try:
                day = parse_day(value)
            except ValueError:
                day = None
        if day is None:
            return self.wrong(value, place)
        return day.isoformat() if self.text else day

    def write(self, value: Any) -> Any:
        """Return a TOML date."""
        return dt.date.fromisoformat(value) if isinstance(value, str) else value

    def schema(self) -> dict[str, Any]:
        """Return the schema of a date."""
        return {"type": "string", "format": "date"}

    def example(self) -> Any:
        """Return a date."""
        return dt.date(2026, 3, 31) if self.entry.example is None else self.entry.example


class FileKind(Kind):
    """The path of a file or folder; the reader of the format says what it is relative to."""

    shape = str

    def form(self) -> str:
        """Return what may stand there."""
        return "the path of a file"

    def read(self, value: Any, place: Place) -> Any:
        """Return the path."""
        # A NUL ends a path of the operating system, and Python refuses it only when the file is opened.
        if not isinstance(value, str) or not value.strip() or "\0" in value:
            return self.wrong(value, place)
        return FilePath(value)

    def holds(self, value: Any) -> bool:
        """Tell whether it is a path."""
        return isinstance(value, FilePath)

    def write(self, value: Any) -> Any:
        """Return the path with slashes."""
        return FilePath(value).as_posix()

    def schema(self) -> dict[str, Any]:
        """Return the schema of a path."""
        return {"type": "string", "minLength": 1}

    def example(self) -> Any:
        """Return the example, else a name."""
        return self.entry.example or "file.csv"
