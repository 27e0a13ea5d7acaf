"""Kinds of change, each for every value that it can be made to."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Value = Any
_ABSENT = object()


@dataclass(frozen=True, slots=True, kw_only=True)
class Forgery:
    """One attempt. ``accepted`` makes it and tells whether any reader that should refuse it does not."""

    kind: str
    what: str
    accepted: Callable[[], bool]


def paths(value: Value, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the place of every part of a JSON value, folders of parts and leaves."""
    if place:
        yield place
    if isinstance(value, Mapping):
        for key in value:
            yield from paths(value[key], (*place, key))
    elif isinstance(value, list):
        for index in range(len(value)):
            yield from paths(value[index], (*place, index))


def at(value: Value, place: Sequence[Any]) -> Value:
    """Return a part; what is absent is None."""
    for key in place:
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            return None
    return value


def with_part(value: Value, place: Sequence[Any], part: Value) -> Value:
    """Return a JSON value with another part; `_ABSENT` drops it."""
    key, *rest = place
    copy = dict(value) if isinstance(value, Mapping) else list(value)
    if rest:
        copy[key] = with_part(value[key], rest, part)
    elif part is _ABSENT:
        del copy[key]
    else:
        copy[key] = part
    return copy


def changes(value: Value, place: Sequence[Any], other: Value) -> Iterator[tuple[str, Value]]:
    """Yield what a part becomes by each kind of change; ``other`` is a value like the whole, of elsewhere."""
    part = at(value, place)
    yield "dropped", _ABSENT
    yield "emptied", type(part)() if isinstance(part, str | list | dict) else None
    yield "of another type", [part] if isinstance(part, str) else "text"
    yield "from elsewhere", at(other, place)
    if isinstance(part, str) and part:
        yield "last character", part[:-1] + ("0" if part[-1] != "0" else "1")
        yield "more behind", part + " "
        yield "drawn alike", part[0] + "\u200b" + part[1:]
    elif isinstance(part, list):
        yield "doubled", [*part, *part]
    elif isinstance(part, dict):
        yield "one entry more", {**part, "more": "x"}
    elif isinstance(part, int):
        yield "one more", part + 1


def changed(
    value: Value, other: Value, *, but: frozenset[str] = frozenset()
) -> Iterator[tuple[str, str, Value]]:
    """Yield kind, place and the value changed there: every part by every kind of change that changes it."""
    for place in paths(value):
        if place[0] in but:
            continue
        name = ", ".join(map(str, place))
        for kind, part in changes(value, place, other):
            forged = with_part(value, place, part)
            if forged != value:
                yield kind, name, forged


def bytes_changed(data: bytes, first: int, last: int, count: int) -> Iterator[tuple[str, bytes]]:
    """Yield bytes with a bit, a byte less and a byte more, at places spread over a part of them."""
    for share in range(count):
        place = first + (last - 1 - first) * share // max(count - 1, 1)
        yield f"bit of byte {place}", data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :]
        yield f"without byte {place}", data[:place] + data[place + 1 :]
        yield f"byte {place} doubled", data[: place + 1] + data[place:]


def signature_changed(armour: str) -> Iterator[tuple[str, str]]:
    """Yield an SSH signature with each of its fields changed, armoured as ssh-keygen does."""
    lines = armour.strip().splitlines()
    try:
        blob = base64.b64decode("".join(lines[1:-1]))
    except binascii.Error:
        return
    at, number = 10, 0
    names = ("public key", "purpose", "reserved", "digest", "signature")
    while at < len(blob):
        size = int.from_bytes(blob[at : at + 4], "big")
        for what, body in (("emptied", b""), ("longer", blob[at + 4 : at + 4 + size] + b"x")):
            forged = blob[:at] + len(body).to_bytes(4, "big") + body + blob[at + 4 + size :]
            if forged != blob:
                text = base64.b64encode(forged).decode()
                rows = [text[n : n + 70] for n in range(0, len(text), 70)]
                yield f"{names[number]} {what}", "\n".join([lines[0], *rows, lines[-1], ""])
        at, number = at + 4 + size, number + 1
