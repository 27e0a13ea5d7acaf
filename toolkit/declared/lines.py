"""Where each entry of a TOML file stands: tomllib tells values and no places.

The text is scanned only where a fault is to be shown, and only text that tomllib has read: the scan follows
the grammar of TOML 1.0 and checks nothing.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping

from toolkit.declared.marks import Path

_SPACE = re.compile(r"[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]+|#[^\n]*)*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_STRING = re.compile(
    r'"""(?:[^\\]|\\.)*?"{3,5}(?!")' r"|'''.*?'{3,5}(?!')" r'|"(?:[^"\\\n]|\\.)*"' r"|'[^'\n]*'", re.DOTALL
)
# A date and a time may stand apart by one space.
_BARE_VALUE = re.compile(r"\d{4}-\d\d-\d\d \d\d:[^\s,\]}#]*|[^\s,\]}#]+")


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
