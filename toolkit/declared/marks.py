"""Marks of a declaration: what stands beside a type in ``Annotated``, and what a class says of its format."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Self, TypeVar

Path = tuple[str | int, ...]
T = TypeVar("T")


@dataclass(frozen=True)
class Entry:
    """What a field says for people, and how its entry is written.

    ``key`` is the entry's name in the file where it differs from the field's; ``example`` a value for the
    starter file, as a file holds it; ``expected`` replaces the sentence that a fault and the reference page
    make of the type and its bounds; ``rule`` the rule id of a fault in it; ``old`` are former spellings of
    the key, read but not written; ``output`` is False for a field that no file and no answer has; of a
    ``sparse`` one an answer has no key while it is None.

    What a new file says of it: ``asked`` names who asks for an entry without which the file itself can be
    read; ``together`` the other entry of its table, both or none of which stand there; an entry that a
    command writes, ``by_command``, is not offered to people at all.
    """

    help: str = ""
    key: str | None = None
    example: Any = None
    expected: str | None = None
    rule: str | None = None
    old: tuple[str, ...] = ()
    output: bool = True
    sparse: bool = False
    asked: str = ""
    together: str = ""
    by_command: str = ""


def derived(
    meaning: str = "", *, key: str | None = None, after: str | None = None, sparse: bool = False
) -> Callable[[T], T]:
    """Mark a method below ``@property``: an answer has its value too, behind that of the field ``after``.

    With none it stands at the end, with an empty text first. It is not read back.
    """

    def mark(method: T) -> T:
        vars(method)["derived"] = Entry(meaning, key=key, sparse=sparse), after
        return method

    return mark


@dataclass(frozen=True)
class NullIsNan:
    """A number that may be NaN, which is null in an answer; as a type, `OrNan`."""


OrNan = Annotated[float, NullIsNan()]


@dataclass(frozen=True)
class Above:
    """The number is larger than this, in the unit of the field's `Unit`."""

    limit: float


@dataclass(frozen=True)
class AtLeast:
    """The number is this or larger."""

    limit: float


@dataclass(frozen=True)
class Below:
    """The number is smaller than this."""

    limit: float


@dataclass(frozen=True)
class AtMost:
    """The number is this or smaller."""

    limit: float


_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
"""Characters that no document can print and no file name has; tabs and ends of lines are none of them."""


@dataclass(frozen=True)
class Text:
    """How a text may be: empty, stripped of spaces at its ends, of a pattern, or written as a number.

    No text has control characters. ``numbers``: ``"int"`` takes a whole number without quotes for its
    digits, ``"any"`` every number. ``accepts`` is asked of a text where no pattern can say it; the
    field's `Entry` says what is expected.
    """

    empty: bool = False
    strip: bool = False
    pattern: str | None = None
    numbers: str = ""
    accepts: Callable[[str], object] | None = None

    def steers(self, text: str) -> bool:
        """Tell whether a text has control characters."""
        return _CONTROL.search(text) is not None

    def fits(self, text: str) -> bool:
        """Tell whether a text is as it should be."""
        return (
            (self.empty or bool(text.strip()))
            and (self.pattern is None or re.fullmatch(self.pattern, text) is not None)
            and (self.accepts is None or bool(self.accepts(text)))
        )


@dataclass(frozen=True)
class Day:
    """A text that is a date: a TOML date or ISO 8601 text is read, ISO 8601 text is held.

    ``moment``: of a TOML date with a time the day is taken.
    """

    moment: bool = False


@dataclass(frozen=True)
class Short:
    """A value alone stands for a table with this one entry: ``"a text"`` for ``{ statement = "a text" }``."""

    key: str


@dataclass(frozen=True)
class UnitName:
    """A text that names a unit, of one of ``dimensions`` where some are given; held in its one spelling.

    ``as_written``: held as it stands in the file, for what is printed again.
    """

    dimensions: tuple[str, ...] = ()
    as_written: bool = False


@dataclass(frozen=True, init=False)
class Unit:
    """A number with a unit: written ``{ value = 80, unit = "km/h" }``, held in SI.

    ``units``: one for each dimension that may stand there; the first is that in which a plain float is
    written, and in which bounds are meant. ``plain``: a number alone is taken in that unit. ``beside``: the
    number stands alone and its unit in the entry of this key of the same table. ``difference``: of a
    temperature, the zero of the scale does not count.
    """

    units: tuple[str, ...]
    plain: bool
    beside: str | None
    difference: bool

    def __init__(
        self, *units: str, plain: bool = False, beside: str | None = None, difference: bool = False
    ) -> None:
        for name, value in (
            ("units", units), ("plain", plain), ("beside", beside), ("difference", difference),
        ):  # fmt: skip
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Size:
    """How many entries a list or a table of names has at least, and at most."""

    least: int = 1
    most: int | None = None


@dataclass(frozen=True)
class Distinct:
    """No entry of a list stands twice; of tables, no value of this field."""

    by: str | None = None


@dataclass(frozen=True)
class Keyed:
    """A table whose keys are names, ``[cells.D51]``.

    On a tuple of dataclasses the name is held in the field ``by``; a tuple of pairs and a mapping need none.
    """

    by: str | None = None


@dataclass(frozen=True, init=False)
class Names:
    """A text, or the keys of a `Keyed` table, are among names: those given, or what another entry declares.

    ``Names("zero", "SA")`` are these two; ``Names(of="loads")`` those of a list of texts at the top of the
    file; ``Names(of="column.symbol", role="indication")`` the symbols of the tables ``[[column]]`` whose
    ``role`` is that one. Where the other entry is itself at fault, nothing is said.
    """

    fixed: tuple[str, ...]
    of: str | None
    where: tuple[tuple[str, str], ...]

    def __init__(self, *fixed: str, of: str | None = None, **where: str) -> None:
        object.__setattr__(self, "fixed", fixed)
        object.__setattr__(self, "of", of)
        object.__setattr__(self, "where", tuple(where.items()))

    def names(self, root: Mapping[str, Any]) -> tuple[str, ...]:
        """Return the names that may stand there, of the parsed file; empty where nothing can be said."""
        if self.of is None:
            return self.fixed
        key, _, inside = self.of.partition(".")
        entry = root.get(key)
        if isinstance(entry, Mapping) and not inside:
            return (*self.fixed, *entry)
        entries = entry if isinstance(entry, list | tuple) else ()
        if inside:
            entries = [
                table.get(inside)
                for table in entries
                if isinstance(table, Mapping) and all(table.get(name) == text for name, text in self.where)
            ]
        names = tuple(name for name in entries if isinstance(name, str))
        return (*self.fixed, *names) if names else ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """What a class says of the format that it declares, as ``FORMAT: ClassVar[Format] = Format(...)``.

    A table inside another one goes by the format of the outer one unless it has its own.

    ``title`` names the file in messages and pages (``machine definition``); ``wrong`` and ``missing`` are the
    rule ids of a value that cannot be used and of an entry that is not there, ``unit`` that of a unit that
    nobody knows; ``next_step`` tells what to do
    about it, and may name the entry: ``correct {key}``. ``schema`` is the number of the newest form, None
    where a file has none; ``schema_required`` whether a file must state it; ``older`` turns the parsed file
    of an older number into one of the next.
    """

    title: str = "settings file"
    wrong: str = "wrong-value"
    missing: str = "missing-key"
    unit: str = "unknown-unit"
    next_step: str = "correct the line"
    schema: int | None = None
    schema_required: bool = False
    older: Mapping[int, Callable[[dict[str, Any]], dict[str, Any]]] | None = None


class Quantity(float):
    """A number in SI that remembers how it was written: ``value`` in ``unit``.

    It computes, compares and prints as the float that it is.

    >>> speed = Quantity(20.0, value=72, unit="km/h")
    >>> speed * 2, speed.value, speed.unit
    (40.0, 72, 'km/h')
    """

    __slots__ = ("unit", "value")
    value: float
    unit: str

    def __new__(cls, si: float, *, value: float, unit: str) -> Self:
        """Return the number of an SI value and of what was written."""
        number = super().__new__(cls, si)
        number.value, number.unit = value, unit
        return number

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle and copy with what was written."""
        return (_quantity, (float(self), self.value, self.unit))


def _quantity(si: float, value: float, unit: str) -> Quantity:
    return Quantity(si, value=value, unit=unit)
