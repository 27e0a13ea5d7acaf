"""Texts that people enter and the laboratory keeps: what may stand in one, and how any other is shown.

A ledger only grows, and every document of a record prints what its lines say. A character that no document
can print is therefore refused where a text enters: a command's words, a form, a settings file, a line of a
ledger. What was kept before, and the names of files, may have such characters: they are shown as escapes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from toolkit.errors import ConfigError

# Control characters but tabs and ends of lines; separators of lines that are no ends of lines; surrogates,
# which stand for bytes that are no UTF-8; what turns the reading order (UAX 9; Boucher, Anderson, Trojan
# Source, 2021); and noncharacters, which no XML holds (Unicode 15, 23.7).
_UNPRINTABLE = re.compile(
    "\r(?!\n)|[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufdd0-\ufdef"
    + "".join(f"{chr(plane + 0xFFFE)}-{chr(plane + 0xFFFF)}" for plane in range(0, 0x110000, 0x10000))
    + "]"
)
_LINES = re.compile("[\t\r\n]")
_SHORTHAND = re.compile(r"(?<!\\)(?:\\\\)*\\([bfr]|u[0-9A-Fa-f]{4}|U[0-9A-Fa-f]{8})")
_BASIC = {"b": "\b", "f": "\f", "r": "\r"}


def unprintable(text: str, *, lines: bool = True) -> str | None:
    r"""Return the first character of a text that no document can print; None where there is none.

    ``lines``: a text may have several lines, and tabs; a name has one.

    >>> unprintable("Käthe") is None, unprintable("K\x08the"), unprintable("two\nlines", lines=False)
    (True, '\x08', '\n')
    """
    match = _UNPRINTABLE.search(text) or (None if lines else _LINES.search(text))
    return None if match is None else match[0]


def escaped(text: str, *, lines: bool = True) -> str:
    r"""Return a text with each character that cannot be printed as its escape.

    >>> print(escaped("a\x1b[2J" + chr(0x202E) + "b"))
    a\x1b[2J\u202eb
    """
    text = _UNPRINTABLE.sub(_escape, text)
    return text if lines else _LINES.sub(_escape, text)


def _escape(match: re.Match[str]) -> str:
    return match[0].encode("unicode_escape").decode("ascii")


def check_text(text: str, *, where: object, line: str | None = None, lines: bool = True) -> None:
    """Refuse a text that cannot be printed.

    Raises
    ------
    ConfigError
        ``unprintable``
    """
    sign = unprintable(text, lines=lines)
    if sign is None:
        return
    shape = "" if sign not in "\t\r\n" else " of one line"
    raise ConfigError(
        "a text has a character that no document can print",
        where=where, line=line, got=escaped(text, lines=lines),
        expected=f"a printable text{shape}: no control characters, no bytes that are no UTF-8, no marks that "
        "turn the reading order",
        next_step=f"write it again without U+{ord(sign[0]):04X}; nothing was changed", rule="unprintable",
    )  # fmt: skip


def check_entries(
    entries: Any, *, where: object, source: str | None = None, names: tuple[str, ...] = ()
) -> None:
    """Refuse texts and keys that cannot be printed, at any depth of tables and lists.

    Parameters
    ----------
    entries : what was parsed
    where : the file, or the record
    source : the text that was parsed, for the line of the fault
    names : keys whose texts have one line

    Raises
    ------
    ConfigError
        ``unprintable``, naming the entry
    """
    for path, text in _texts(entries, ""):
        lines = path not in names
        if (sign := unprintable(text, lines=lines)) is not None:
            place = f"{where}: {escaped(path, lines=False)}" if path else where
            check_text(text, where=place, line=_line(source, sign), lines=lines)


def _texts(value: Any, path: str) -> Any:
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, Mapping):
        for key, below in value.items():
            inside = f"{path}.{key}" if path else str(key)
            yield inside, str(key)
            yield from _texts(below, inside)
    elif isinstance(value, list | tuple):
        for number, below in enumerate(value, start=1):
            yield from _texts(below, f"{path}[{number}]")


def _line(source: str | None, sign: str) -> str | None:
    """Return the first line in which a character stands, by itself or as an escape of TOML or JSON."""
    for number, line in enumerate((source or "").split("\n"), start=1):
        meant = {
            _BASIC.get(code) or chr(int(code[1:], 16)) for code in _SHORTHAND.findall(line)
            if code in _BASIC or int(code[1:], 16) < 0x110000
        }  # fmt: skip
        if sign in line or sign in meant:
            return f"{number} | {line.strip()}"
    return None
