"""Faults of a file's entries: all are told at once, each with its key, its line and what was expected.

tomllib tells values and no places. So the text is scanned for them, only where a fault is to be shown, and
only text that tomllib has read: the scan follows the grammar of TOML 1.0 and checks nothing.
"""

from __future__ import annotations

import datetime as dt
import functools
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from toolkit.declared.marks import Format, Path, Quantity
from toolkit.errors import ConfigError

_LONGEST = 160
MOST_TOLD = 100
"""Faults of a file that are told one by one, and looked into for what was meant."""
_SPACE = re.compile(r"[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}(?!")' r"|'''.*?'{3,5}(?!')" r'|"(?:[^"\\\n]|\\.)*"' r"|'[^'\n]*'", re.DOTALL
)
# A date and a time may stand apart by one space.
_BARE_VALUE = re.compile(r"\d{4}-\d\d-\d\d \d\d:[^\s,\]}#]*|[^\s,\]}#]+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """An entry that cannot stand.

    A declared class yields its own from ``faults(self)``: ``key`` is the path of keys below the class's table
    (``("column", 2, "symbol")``, lists counted from 0; empty for the table itself), ``expected`` what may
    stand there. ``what`` is a sentence without the key, where "cannot be used" does not say enough; ``rule``
    a rule id of its own; ``got`` what stood there, if it is not the entry itself.
    """

    key: Path = ()
    expected: str
    got: Any = None
    what: str | None = None
    rule: str | None = None
    kind: Literal["wrong", "missing", "unknown"] = "wrong"
    near: str | None = None
    form: Format = field(default_factory=Format)

    @property
    def name(self) -> str:
        """The entry with the tables that it stands in: ``column[3].symbol``, lists counted from 1."""
        return key_text(self.key)

    @property
    def rule_id(self) -> str:
        """The rule id: the fault's own, else the format's for its kind."""
        if self.rule is not None:
            return self.rule
        if self.kind == "unknown":
            return "unknown-key"
        return self.form.missing if self.kind == "missing" else self.form.wrong

    @property
    def hint(self) -> str:
        """What was meant by an unknown key, or what is known."""
        return f"did you mean {self.near!r}?" if self.near else f"known are {self.expected}"

    @property
    def text(self) -> str:
        """The fault in a line."""
        name = self.name or "the file"
        if self.kind == "unknown":
            return f"{name}: unknown key; {self.hint}"
        if self.kind == "missing":
            return f"{name}: missing; expected {self.expected}"
        problem = self.what or f"{display(self.got, quoted=True)} cannot be used"
        return f"{name}: {problem}; expected {self.expected}"


def key_text(path: Path) -> str:
    """Return a path of keys as people read it.

    >>> key_text(("column", 2, "symbol"))
    'column[3].symbol'
    """
    text = ""
    for part in path:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def display(value: Any, *, quoted: bool = False) -> str:
    """Return a value as a settings file writes it, cut where it is long.

    >>> display({"value": 80, "unit": "km/h"})
    '{ value = 80, unit = "km/h" }'
    """
    if value is None:
        return "nothing"
    if isinstance(value, Quantity):
        return f"{_inline(value.value)} {value.unit}"
    if isinstance(value, str) and not quoted:
        text = value if value.strip() else "an empty text"
    else:
        text = _inline(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ..."


def _inline(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_inline(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, int) and abs(value) >= 10**_LONGEST:
        return "a whole number of more digits than can be read"  # nor can Python print every one
    return value.isoformat() if isinstance(value, dt.date | dt.time) else str(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A text that entries were read from: its name in messages, and what it extends.

    ``inherited`` are the paths of the entries that were taken from ``base``.
    """

    where: object
    text: str | None = None
    base: Source | None = None
    inherited: frozenset[Path] = frozenset()

    def place(self, path: Path) -> tuple[Source, int | None]:
        """Return the source and the line of an entry, or of the nearest table above it."""
        if self.base is not None and any(path[:size] in self.inherited for size in range(1, len(path) + 1)):
            return self.base.place(path)
        lines = {} if self.text is None else lines_of(self.text)
        while path:
            if path in lines:
                return self, lines[path]
            path = path[:-1]
        return self, None

    def excerpt(self, line: int) -> str:
        """Return a line with its number: ``12 | speed = 80``."""
        text = _split(self.text or "")[line - 1].strip()
        return f"{line} | {text if len(text) <= _LONGEST else text[:_LONGEST] + ' ...'}"


@functools.lru_cache(maxsize=4)
def _split(text: str) -> list[str]:
    return text.replace("\r\n", "\n").split("\n")


def refuse(faults: Sequence[Fault], source: Source) -> None:
    """Raise the error of a file with faults; return where there is none.

    Raises
    ------
    ConfigError
        the rule of the fault; of several with different rules that of the format
    """
    if not faults:
        return
    if len(faults) > 1:
        _refuse_all(faults, source)
    fault = faults[0]
    document, line = source.place(fault.key)
    if fault.kind == "unknown":
        table = key_text(fault.key[:-1])
        raise ConfigError(
            f"unknown key {str(fault.key[-1])!r}",
            where=f"{document.where}: {table}" if table else document.where,
            line=None if line is None else document.excerpt(line),
            got=fault.key[-1],
            expected=fault.near or fault.expected,
            next_step=f"{fault.hint} " * bool(fault.near) + _next_step(fault, "correct or remove it"),
            rule=fault.rule_id,
        )
    name = fault.name or "the file"
    what = fault.what or ("is missing" if fault.kind == "missing" else "has a value that cannot be used")
    raise ConfigError(
        f"{name} {what}" if fault.what is None else f"{name}: {what}",
        where=f"{document.where}: {fault.name}" if fault.name else document.where,
        line=None if line is None else document.excerpt(line),
        got=display(fault.got),
        expected=fault.expected,
        next_step=_next_step(fault),
        rule=fault.rule_id,
    )


def _refuse_all(faults: Sequence[Fault], source: Source) -> None:
    lines = []
    for fault in faults[:MOST_TOLD]:
        document, line = source.place(fault.key)
        lines.append(fault.text)
        if line is not None:
            elsewhere = f"{document.where}, " if document is not source else ""
            lines.append(f"  {elsewhere}{document.excerpt(line)}")
    if len(faults) > MOST_TOLD:
        lines.append(f"and {len(faults) - MOST_TOLD} more")
    rules = {fault.rule_id for fault in faults}
    raise ConfigError(
        f"{len(faults)} entries cannot be used",
        where=source.where,
        got="\n".join([lines[0], *(" " * 12 + text for text in lines[1:])]),
        expected="what stands with each of them",
        next_step=_next_step(faults[0], "correct every entry that is named"),
        rule=rules.pop() if len(rules) == 1 else faults[0].form.wrong,
    )


def _next_step(fault: Fault, act: str | None = None) -> str:
    """Return the format's next step; ``act`` replaces its first part, what follows a semicolon stays."""
    first, semicolon, then = fault.form.next_step.partition(";")
    return (act or first.format(key=fault.name or "the file")) + semicolon + then


@functools.lru_cache(maxsize=4)  # the faults of a file ask one after another
def lines_of(text: str) -> Mapping[Path, int]:
    """Return the line, from 1, of every entry and table of a well-formed TOML text.

    The elements of lists count from 0. A table that stands in several places has the line of its own header,
    or of the first entry in it.

    >>> lines = lines_of('a = 1\\n[[b]]\\nc = [1,\\n  { d.e = 2 }]')
    >>> lines["a",], lines["b", 0], lines["b", 0, "c", 0], lines["b", 0, "c", 1, "d", "e"]
    (1, 2, 3, 4)
    """
    return _Scan(text).run()


class _Scan:
    def __init__(self, text: str) -> None:
        # tomllib counts as it does: a carriage return before the end of a line is no part of it.
        self.text = text.replace("\r\n", "\n").removeprefix("\ufeff")
        self.at = 0
        self.line = 1
        self.counted = 0
        self.lines: dict[Path, int] = {}
        self.sizes: dict[Path, int] = {}

    def run(self) -> dict[Path, int]:
        table: Path = ()
        while self._skip(_BLANK) < len(self.text):
            if self._next("[["):
                table = self._list_header()
            elif self._next("["):
                table = self._below((), self._key())
                self.lines[table] = self._line()
                self._next("]")
            else:
                self._entry(table)
        return self.lines

    def _list_header(self) -> Path:
        path = self._below((), self._key())
        number = self.sizes.get(path, 0)
        self.sizes[path] = number + 1
        self.lines.setdefault(path, self._line())
        self.lines[*path, number] = self._line()
        self._next("]]")
        return (*path, number)

    def _below(self, table: Path, key: tuple[str, ...]) -> Path:
        """Return the path of a header's key: below a list of tables, the last table is meant."""
        path = table
        for place, part in enumerate(key):
            path = (*path, part)
            if place < len(key) - 1:
                self.lines.setdefault(path, self._line())
                if path in self.sizes:
                    path = (*path, self.sizes[path] - 1)
        return path

    def _entry(self, table: Path) -> None:
        path = table
        for part in self._key():
            path = (*path, part)
            self.lines.setdefault(path, self._line())
        self._skip(_SPACE)
        self._next("=")
        self._value(path)

    def _key(self) -> tuple[str, ...]:
        parts = []
        while True:
            self._skip(_SPACE)
            if string := _STRING.match(self.text, self.at):
                parts.append(str(tomllib.loads(f"key = {string[0]}")["key"]))
                self.at = string.end()
            elif bare := _BARE_KEY.match(self.text, self.at):
                parts.append(bare[0])
                self.at = bare.end()
            self._skip(_SPACE)
            if not self._next("."):
                return tuple(parts)

    def _value(self, path: Path) -> None:
        self._skip(_SPACE)
        if self._next("["):
            number = 0
            while self._skip(_BLANK) < len(self.text) and not self._next("]"):
                self.lines[*path, number] = self._line()
                self._value((*path, number))
                number += 1
                self._skip(_BLANK)
                self._next(",")
        elif self._next("{"):
            while self._skip(_BLANK) < len(self.text) and not self._next("}"):
                self._entry(path)
                self._skip(_BLANK)
                self._next(",")
        else:
            word = _STRING.match(self.text, self.at) or _BARE_VALUE.match(self.text, self.at)
            self.at = word.end() if word else self.at + 1

    def _skip(self, pattern: re.Pattern[str]) -> int:
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at
        return self.at

    def _next(self, sign: str) -> bool:
        if not self.text.startswith(sign, self.at):
            return False
        self.at += len(sign)
        return True

    def _line(self) -> int:
        self.line += self.text.count("\n", self.counted, self.at)
        self.counted = self.at
        return self.line
