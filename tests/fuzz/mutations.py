"""Mutations of inputs: each is a name and its words, plain JSON, so that what failed can be written down.

`tests.fuzz.draws` chooses them for the bytes of a format, `apply` carries them out: the same recipe on the
same bytes gives the same bytes. A recipe whose place is no longer there, after another mutation, changes
nothing.
"""

from __future__ import annotations

import datetime as dt
import io
import json
import re
import struct
import tomllib
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

Mutation = Sequence[Any]
Recipe = Sequence[Mutation]

VALUES: dict[str, Any] = {
    "true": True,
    "zero": 0,
    "minus": -1,
    "huge": 10**400,
    "large": 2**63,
    "float": 1.5,
    "tiny": 5e-324,
    "far": 1.7e308,
    "nan": float("nan"),
    "inf": float("inf"),
    "empty": "",
    "blank": "  ",
    "text": "nothing known",
    "nul": "a\0b",
    "wide": "\u202e\U0001f6de",
    "lone": "\ufffd",
    "long": "x" * 5000,
    "path": "../../etc/passwd",
    "device": "/dev/zero",
    "brace": "{{}} %s $(x)",
    "number": "1e3",
    "date": dt.date(2026, 3, 2),
    "moment": dt.datetime(2026, 3, 2, 1, 2, 3, tzinfo=dt.UTC),
    "clock": dt.time(1, 2),
    "year": dt.date(1, 1, 1),
    "list": [],
    "texts": ["a", "b"],
    "numbers": [1.0, 2.0],
    "nested": [[[]]],
    "table": {},
    "unknown": {"zzz": 1},
    "tables": [{}],
    "quantity": {"value": 1, "unit": "parsec"},
    "metres": {"value": 1.0, "unit": "m"},
}
PARTS = {
    "entity": b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "x"><!ENTITY c "&b;&b;&b;&b;">]><a>&c;</a>',
    "outside": b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>',
    "deep": b"<a>" * 5000 + b"</a>" * 5000,
    "cut": b"<a><b>",
    "empty": b"",
    "bytes": bytes(range(256)) * 8,
    "inflated": b"<a>" + b" " * 3_000_000 + b"</a>",
}
MUTATE: dict[str, Callable[..., bytes]] = {}
UNKNOWN = "zzz"


def apply(data: bytes, recipe: Recipe) -> bytes:
    """Return the bytes after every mutation of a recipe."""
    for name, *words in recipe:
        data = MUTATE[name](data, *words)
    return data


def _mutation(function: Callable[..., bytes]) -> Callable[..., bytes]:
    MUTATE[function.__name__.lstrip("_")] = function
    return function


# Trees: TOML and JSON.


def tree_of(data: bytes) -> tuple[Any, bool]:
    """Return the entries of a TOML or JSON file, and whether it is JSON."""
    if data.lstrip()[:1] in (b"{", b"["):
        return json.loads(data), True
    return tomllib.loads(data.decode()), False


def _written(tree: Any, as_json: bool) -> bytes:
    if as_json:
        return json.dumps(tree, default=str).encode()
    return "".join(f"{_quoted(key)} = {_toml(value)}\n" for key, value in tree.items()).encode()


def _toml(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return _quoted(value)
        case dt.date() | dt.time():
            return value.isoformat()
        case dict():
            return "{" + ", ".join(f"{_quoted(key)} = {_toml(entry)}" for key, entry in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def paths(tree: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the path of every entry of a tree."""
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in entries:
        yield (*path, key)
        yield from paths(value, (*path, key))


def _changed(data: bytes, path: Sequence[str | int], change: Callable[[Any, Any], None]) -> bytes:
    try:
        tree, as_json = tree_of(data)
        parent = tree
        for key in path[:-1]:
            parent = parent[key]
        change(parent, path[-1])
        return _written(tree, as_json)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError):
        return data


@_mutation
def _set(data: bytes, path: Sequence[str | int], value: str) -> bytes:
    return _changed(data, path, lambda parent, key: parent.__setitem__(key, VALUES[value]))


@_mutation
def _drop(data: bytes, path: Sequence[str | int]) -> bytes:
    return _changed(data, path, lambda parent, key: parent.pop(key))


@_mutation
def _misspell(data: bytes, path: Sequence[str | int]) -> bytes:
    return _changed(data, path, lambda parent, key: parent.__setitem__(key + "e", parent.pop(key)))


@_mutation
def _add(data: bytes, path: Sequence[str | int], value: str) -> bytes:
    return _changed(data, [*path, UNKNOWN], lambda parent, key: parent.__setitem__(key, VALUES[value]))


@_mutation
def _double(data: bytes, path: Sequence[str | int]) -> bytes:
    return _changed(data, path, lambda parent, key: parent.insert(key, parent[key]))


@_mutation
def _nest(data: bytes, path: Sequence[str | int]) -> bytes:
    return _changed(data, path, lambda parent, key: parent.__setitem__(key, [parent[key]]))


# Text by its lines, and whatever is bytes.


def split_lines(data: bytes) -> list[bytes]:
    """Return the lines with their ends."""
    return data.splitlines(keepends=True)


@_mutation
def _line_drop(data: bytes, at: int) -> bytes:
    lines = split_lines(data)
    return b"".join(lines[:at] + lines[at + 1 :])


@_mutation
def _line_double(data: bytes, at: int, times: int) -> bytes:
    lines = split_lines(data)
    return b"".join(lines[:at] + lines[at : at + 1] * times + lines[at:])


@_mutation
def _line_swap(data: bytes, at: int, other: int) -> bytes:
    lines = split_lines(data)
    if max(at, other) < len(lines):
        lines[at], lines[other] = lines[other], lines[at]
    return b"".join(lines)


@_mutation
def _word(data: bytes, at: int, number: int, snippet: str) -> bytes:
    """Put a snippet in the place of one word of one line."""
    lines = split_lines(data)
    if at < len(lines):
        words = re.split(rb"([,;\t =\[\]]+)", lines[at])
        if number < len(words):
            words[number] = snippet.encode()
        lines[at] = b"".join(words)
    return b"".join(lines)


@_mutation
def _replace(data: bytes, old: str, new: str) -> bytes:
    return data.replace(old.encode(), new.encode())


@_mutation
def _encode(data: bytes, encoding: str) -> bytes:
    return data.decode("utf-8", "replace").encode(encoding, "replace")


@_mutation
def _cut(data: bytes, permille: int) -> bytes:
    return data[: len(data) * permille // 1000]


@_mutation
def _insert(data: bytes, permille: int, snippet: str) -> bytes:
    at = len(data) * permille // 1000
    return data[:at] + snippet.encode() + data[at:]


@_mutation
def _flip(data: bytes, at: int, mask: int) -> bytes:
    return data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :] if at < len(data) else data


@_mutation
def _length(data: bytes, at: int, value: int, size: int) -> bytes:
    """Write a number of 4 or 8 bytes over whatever stands there: lengths, counts, offsets."""
    packed = struct.pack("<Q", value % 2**64)[:size]
    return data[:at] + packed + data[at + size :] if at + size <= len(data) else data


@_mutation
def _zero(data: bytes, at: int, size: int) -> bytes:
    return data[:at] + bytes(min(size, max(len(data) - at, 0))) + data[at + size :]


# Parts of a zip archive.


def unpacked(data: bytes) -> list[tuple[str, bytes]]:
    """Return the parts of a zip archive, in its order."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(entry.filename, archive.read(entry)) for entry in archive.infolist()]


def _packed(parts: Sequence[tuple[str, bytes]]) -> bytes:
    stream = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        warnings.simplefilter("ignore")  # names that stand twice
        for name, content in parts:
            archive.writestr(name, content)
    return stream.getvalue()


def _repacked(data: bytes, change: Callable[[list[tuple[str, bytes]]], list[tuple[str, bytes]]]) -> bytes:
    try:
        return _packed(change(unpacked(data)))
    except (zipfile.BadZipFile, zlib.error, LookupError, ValueError, OSError, NotImplementedError, EOFError):
        return data


@_mutation
def _part(data: bytes, name: str, mutation: Mutation) -> bytes:
    """Mutate one part by any other mutation."""
    return _repacked(data, lambda parts: [(n, apply(c, [mutation]) if n == name else c) for n, c in parts])


@_mutation
def _part_drop(data: bytes, name: str) -> bytes:
    return _repacked(data, lambda parts: [(n, c) for n, c in parts if n != name])


@_mutation
def _part_set(data: bytes, name: str, content: str) -> bytes:
    return _repacked(data, lambda parts: [(n, PARTS[content] if n == name else c) for n, c in parts])


@_mutation
def _part_add(data: bytes, name: str, content: str) -> bytes:
    return _repacked(data, lambda parts: [*parts, (name, PARTS[content])])


@_mutation
def _part_rename(data: bytes, name: str, new: str) -> bytes:
    return _repacked(data, lambda parts: [(new if n == name else n, c) for n, c in parts])
