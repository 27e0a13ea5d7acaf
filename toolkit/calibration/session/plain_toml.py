"""The plain part of TOML, read fast: one key or header a line, values on their line.

`verify` parses the session of every record, and most of its time went into that. Sessions are written by
people and by programs in the same few forms; these are read here, at a third of the time. Whatever is not
certainly one of them (quotes with escapes, dotted keys, values over several lines, a key that stands twice)
is not judged: the answer is None, and `tomllib` reads it, or says what is wrong.
"""

from __future__ import annotations

import datetime as dt
import functools
import json
import re
from typing import Any

_KEY = re.compile(r"[A-Za-z0-9_-]+")
_HEADER = re.compile(r"\[([A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*)\]")
_ENTRY = re.compile(r"\[\[([A-Za-z0-9_-]+)\]\]")
_DATE = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
_INTEGER = re.compile(r"-?(?:0|[1-9][0-9]*)")
_FLOAT = re.compile(r"-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?")
_TEXT_OR_KEY = re.compile(r'("[^"\\]*")|([A-Za-z0-9_-]+) *=')
# What stands outside of texts and keys in an array or an inline table.
_BARE = re.compile(r"(?:true|false|[-+0-9.eE,{}\[\] ])*")


class _NotPlainError(Exception):
    """The line is for `tomllib`."""


def plain_toml(data: bytes) -> dict[str, Any] | None:
    """Return what `tomllib` returns, or None where the text is not plain.

    >>> plain_toml(b'[cells.D51]\\nserial = "51-7"\\nscale = { value = 2.5, unit = "mV/V" }\\n')
    {'cells': {'D51': {'serial': '51-7', 'scale': {'value': 2.5, 'unit': 'mV/V'}}}}
    >>> plain_toml(b"a.b = 1") is None
    True
    """
    try:
        text = data.decode("utf-8")
        lines = text.split("\n")
        if not "".join(lines).isprintable():
            return None
        return _parse(lines)
    except (_NotPlainError, ValueError, RecursionError):
        return None


def _parse(lines: list[str]) -> dict[str, Any]:
    top: dict[str, Any] = {}
    table = top
    # Tables and lists that a header may go on with; those of a value may not.
    opened: set[int] = set()
    for line in lines:
        line = line.strip(" ")
        if not line or line[0] == "#":
            continue
        if line[0] == "[":
            table = _entry(line, top, opened) if line.startswith("[[") else _table(line, top, opened)
            continue
        key, _, value = line.partition("=")
        key, value = key.rstrip(" "), value.lstrip(" ")
        if key in table or not value or _KEY.fullmatch(key) is None:
            raise _NotPlainError
        table[key] = _value(value)
    return top


def _table(line: str, top: dict[str, Any], opened: set[int]) -> dict[str, Any]:
    match = _HEADER.fullmatch(line)
    if match is None:
        raise _NotPlainError
    *path, last = match[1].split(".")
    node = top
    for part in path:
        child = node.get(part)
        if child is None:
            child = node[part] = {}
            opened.add(id(child))
        elif id(child) not in opened or not isinstance(child, dict):
            raise _NotPlainError
        node = child
    if last in node:
        raise _NotPlainError
    made: dict[str, Any] = {}
    node[last] = made
    opened.add(id(made))
    return made


def _entry(line: str, top: dict[str, Any], opened: set[int]) -> dict[str, Any]:
    match = _ENTRY.fullmatch(line)
    if match is None:
        raise _NotPlainError
    entries = top.get(match[1])
    if entries is None:
        entries = top[match[1]] = []
        opened.add(id(entries))
    elif id(entries) not in opened or not isinstance(entries, list):
        raise _NotPlainError
    made: dict[str, Any] = {}
    entries.append(made)
    return made


def _value(text: str) -> Any:
    first = text[0]
    if first == '"':
        if text.count('"') != 2 or text[-1] != '"' or "\\" in text:
            raise _NotPlainError
        return text[1:-1]
    if first in "[{":
        return _DECODER.decode(_as_json(text))
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _DATE.fullmatch(text):
        return dt.date.fromisoformat(text)
    if text in ("true", "false"):
        return text == "true"
    raise _NotPlainError


@functools.lru_cache(maxsize=1024)
def _as_json(text: str) -> str:
    if _BARE.fullmatch(_TEXT_OR_KEY.sub("", text)) is None:
        raise _NotPlainError
    if "=" in text:
        text = _TEXT_OR_KEY.sub(lambda found: found[1] or f'"{found[2]}":', text)
    return text


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) != len(pairs):
        raise _NotPlainError
    return made


_DECODER = json.JSONDecoder(object_pairs_hook=_once)
