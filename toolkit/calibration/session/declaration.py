"""Declared entries of a settings file: which keys may stand where, and what each holds.

All faults of a file are told at once: a person mends it in one go, and before anything was computed.
"""

from __future__ import annotations

import datetime as dt
import difflib
import re
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from toolkit.errors import ConfigError

Names = Mapping[str, Sequence[str]]
LIKE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """An entry that cannot stand: ``name`` in ``table``; ``near`` is the known key that was meant."""

    kind: Literal["unknown", "missing", "wrong"]
    table: str
    name: str
    got: object
    expected: str
    near: str | None = None
    rule: str = "session"

    @property
    def key(self) -> str:
        """The entry with the tables that it stands in."""
        return f"{self.table}.{self.name}" if self.table else self.name

    @property
    def text(self) -> str:
        """The fault in a line."""
        if self.kind == "unknown":
            hint = f"did you mean {self.near!r}?" if self.near else f"known are {self.expected}"
            return f"{self.key}: unknown key; {hint}"
        told = "missing" if self.kind == "missing" else f"{self.got!r} cannot be used"
        return f"{self.key}: {told}; expected {self.expected}"


@dataclass(frozen=True, slots=True)
class Value:
    """An entry that is no table, or one that is checked elsewhere: ``holds`` tells whether it can be used."""

    expected: str
    holds: Callable[[Any], bool] = lambda _: True
    required: bool = False
    rule: str = "session"

    def faults(self, value: Any, table: str, name: str, _names: Names) -> Iterator[Fault]:
        """Yield what is wrong with an entry."""
        if not self.holds(value):
            yield Fault(
                kind="wrong", table=table, name=name, got=value, expected=self.expected, rule=self.rule
            )


@dataclass(frozen=True, slots=True)
class Table:
    """A table with the keys that may stand in it; ``keyed`` by the session's loads or indications.

    ``rows``: it stands in a list, [[name]]. ``otherwise`` is what may stand in its place.
    """

    entries: Mapping[str, Value | Table] | Value | Table
    keyed: str | None = None
    rows: bool = False
    otherwise: Value | Table | None = None

    def faults(self, value: Any, table: str, name: str, names: Names) -> Iterator[Fault]:
        """Yield what is wrong in a table, and below it."""
        key = f"{table}.{name}" if table else name
        if self.rows and isinstance(value, list) and all(isinstance(one, dict) for one in value):
            for number, one in enumerate(value, start=1):
                yield from self.inside(one, f"{key} {number}", names)
        elif not self.rows and isinstance(value, dict):
            yield from self.inside(value, key, names)
        elif self.otherwise is not None:
            yield from self.otherwise.faults(value, table, name, names)
        else:
            yield Fault(kind="wrong", table=table, name=name, got=value, expected=self._form(key, names))

    def _form(self, key: str, names: Names) -> str:
        form = f"[[{key}]]" if self.rows else f"[{key}]"
        known = self._known(names)
        return f"a table {form}" + (f" with {', '.join(known)}" if known else "")

    def _known(self, names: Names) -> Sequence[str]:
        return list(self.entries) if isinstance(self.entries, Mapping) else names.get(self.keyed or "", ())

    def inside(self, value: Mapping[str, Any], key: str, names: Names) -> Iterator[Fault]:
        """Yield what is wrong with the entries of a table."""
        known = self._known(names)
        entries = self.entries.items() if isinstance(self.entries, Mapping) else ()
        required = {name: one for name, one in entries if isinstance(one, Value) and one.required}
        lacking, meant = [name for name in required if name not in value], set()
        for name, one in value.items():
            if isinstance(self.entries, Mapping):
                declared = self.entries.get(name)
            else:
                # Of names that are themselves at fault nothing can be said.
                declared = self.entries if name in known or not known else None
            if declared is not None:
                yield from declared.faults(one, key, name, names)
                continue
            meant.add(near := _near(name, known, value))
            yield Fault(
                kind="unknown", table=key, name=name, got=name, expected=", ".join(sorted(known)), near=near,
                rule="unknown-key",
            )  # fmt: skip
        for name in lacking:
            if name not in meant:  # a key that was misspelt is not missing too
                one = required[name]
                yield Fault(
                    kind="missing", table=key, name=name, got=None, expected=one.expected, rule=one.rule
                )


def faults_of(raw: Mapping[str, Any], declared: Table, names: Names) -> tuple[Fault, ...]:
    """Return every fault of a file's entries; ``names``: what tables are keyed by."""
    return tuple(declared.inside(raw, "", names))


def refuse(faults: Sequence[Fault], *, where: object) -> None:
    """Raise the error of a file with faults; return where there is none.

    Raises
    ------
    ConfigError
        ``unknown-key`` or the rule of the fault where there is one; ``session`` for several
    """
    if not faults:
        return
    one = faults[0]
    if len(faults) > 1:
        lines = "\n".join([one.text, *(" " * 12 + fault.text for fault in faults[1:])])
        expected = "; ".join(
            f"{fault.key}: {fault.near or fault.expected}" if fault.kind == "unknown" else
            f"{fault.key}: {fault.expected}" for fault in faults
        )  # fmt: skip
        raise ConfigError(
            f"{len(faults)} entries cannot be used",
            where=where, got=lines, expected=expected,
            next_step="correct every entry that is named; nothing was written",
            rule=one.rule if len({fault.rule for fault in faults}) == 1 else "session",
        )  # fmt: skip
    if one.kind == "unknown":
        raise ConfigError(
            f"unknown key {one.name!r}",
            where=f"{where}: {one.table}" if one.table else where,
            got=one.name,
            expected=one.near or one.expected,
            next_step=f"did you mean {one.near!r}? " * bool(one.near)
            + "correct or remove it; nothing was written",
            rule=one.rule,
        )
    raise ConfigError(
        f"{one.key} is missing" if one.kind == "missing" else f"{one.key} has a value that cannot be used",
        where=f"{where}: {one.key}",
        got="nothing" if one.kind == "missing" else "an empty text" if not str(one.got).strip() else one.got,
        expected=one.expected,
        next_step=f"correct {one.key}; nothing was written",
        rule=one.rule,
    )


def is_text(value: object) -> bool:
    """Tell whether an entry is a text, or a whole number that was written without quotes."""
    return (isinstance(value, str) and bool(value.strip())) or type(value) is int


def is_date(value: object) -> bool:
    """Tell whether an entry is a date, as a TOML date or as a text."""
    return type(value) is dt.date or (
        isinstance(value, str) and re.fullmatch(r"\d{4}-\d\d-\d\d", value) is not None and _parses(value)
    )


def _parses(text: str) -> bool:
    try:
        dt.date.fromisoformat(text)
    except ValueError:
        return False
    return True


def _near(name: str, known: Sequence[str], present: Container[str]) -> str | None:
    # Without regard to case: "dot" is DOT. Of two that are as near, the one that is not there yet was meant.
    def likeness(one: str) -> tuple[float, bool, str]:
        return difflib.SequenceMatcher(None, name.lower(), one.lower()).ratio(), one not in present, one

    near = max(known, key=likeness, default=None)
    return None if near is None or likeness(near)[0] < LIKE else near
