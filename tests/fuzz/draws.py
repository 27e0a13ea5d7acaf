"""What is drawn for which kind of bytes: the places that matter, by the structure of the format."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

from tests.fuzz.mutations import PARTS, VALUES, Mutation, paths, split_lines, tree_of, unpacked

SNIPPETS = (
    "\0",
    "nan",
    "inf",
    "-",
    "1e999",
    "9" * 400,
    "1,5",
    ";",
    ",",
    "\t",
    '"',
    "'",
    "#N/A",
    "=1+1",
    "\u00b0",
    "\r",
    "\n",
    "[",
    "]",
    "{",
    "$",
    "!",
    "0x10",
    "1_000",
    "\u0661",
    "",
    " ",
    "\x1a",
    "2026-02-30",
    "TRUE",
    "***End_of_Header***",
)
ENCODINGS = ("utf-16", "utf-16-be", "utf-32", "utf-8-sig", "cp037", "utf-7")


def draw(data: bytes, kind: str, rng: random.Random) -> list[Mutation]:
    """Return one to three mutations of a ``tree``, ``text``, ``zip`` or ``binary``."""
    return [_DRAW[kind](data, rng) for _ in range(rng.choice((1, 1, 1, 2, 3)))]


def _draw_tree(data: bytes, rng: random.Random) -> Mutation:
    listed = list(paths(tree_of(data)[0]))
    if rng.random() < 0.15 or not listed:
        return _draw_text(data, rng)
    path = rng.choice(listed)
    kinds = ["set"] * 8 + ["drop"] * 2 + ["add", "nest"]
    kinds += ["misspell"] * 3 if isinstance(path[-1], str) else ["double"] * 3
    kind = rng.choice(kinds)
    if kind == "add":
        return ["add", list(path[:-1]), rng.choice(list(VALUES))]
    return [kind, list(path), rng.choice(list(VALUES))] if kind == "set" else [kind, list(path)]


def _draw_text(data: bytes, rng: random.Random) -> Mutation:
    lines = len(split_lines(data))
    # Heads decide more than rows do.
    at = rng.randrange(min(lines, 12)) if rng.random() < 0.6 else rng.randrange(max(lines, 1))
    snippet = rng.choice(SNIPPETS)
    return rng.choice(
        (
            ["line_drop", at],
            ["line_double", at, rng.choice((1, 2, 500))],
            ["line_swap", at, rng.randrange(lines)],
            ["word", at, rng.randrange(12), snippet],
            ["word", at, rng.randrange(12), snippet],
            ["word", at, rng.randrange(12), snippet],
            ["insert", rng.randrange(1000), snippet],
            ["cut", rng.randrange(1000)],
            ["encode", rng.choice(ENCODINGS)],
            ["replace", rng.choice((",", ";", "\t", "\n", ".", "=", "[", "]")), snippet],
            ["flip", rng.randrange(max(len(data), 1)), 1 << rng.randrange(8)],
        )
    )


def _draw_binary(data: bytes, rng: random.Random) -> Mutation:
    # Headers, and the blocks at both ends, hold the lengths.
    span = rng.choice((256, 4096, len(data)))
    at = rng.randrange(min(span, len(data)))
    value = rng.choice((0, 1, 2**31 - 1, 2**32 - 1, 2**63, len(data), len(data) + 1, rng.randrange(2**32)))
    return rng.choice(
        (
            ["flip", at, 1 << rng.randrange(8)],
            ["length", at, value, rng.choice((4, 8))],
            ["length", at - at % 8, value, 8],
            ["zero", at, rng.choice((1, 16, 512))],
            ["cut", rng.randrange(1000)],
            ["insert", rng.randrange(1000), rng.choice(SNIPPETS)],
        )
    )


def _draw_zip(data: bytes, rng: random.Random) -> Mutation:
    if rng.random() < 0.15:
        return _draw_binary(data, rng)
    parts = unpacked(data)
    name, content = rng.choice(parts)
    other, _ = rng.choice(parts)
    inner = _draw_xml(content, rng)
    return rng.choice(
        (
            ["part", name, inner],
            ["part", name, inner],
            ["part", name, inner],
            ["part", name, inner],
            ["part_drop", name],
            ["part_set", name, rng.choice(list(PARTS))],
            [
                "part_add",
                rng.choice((name, f"../{name}", name.upper(), "word/x.xml")),
                rng.choice(list(PARTS)),
            ],
            ["part_rename", name, rng.choice((other, name.upper(), "/" + name, "", "a" * 300, "a\0b"))],
        )
    )


_TARGETS = (
    "http://a.b/c",
    "file:///etc/passwd",
    "\\\\a\\b",
    "../../../x",
    "",
    "a\0b",
    "#",
    "rId1",
    "missing.xml",
)


def _draw_xml(content: bytes, rng: random.Random) -> Mutation:
    attributes = re.findall(rb'[\w:]+="[^"]*"', content[:200_000]) or [b'a="b"']
    tags = re.findall(rb"<[\w:]+", content[:200_000]) or [b"<a"]
    attribute, tag = (rng.choice(found).decode("utf-8", "replace") for found in (attributes, tags))
    key = attribute.split("=", 1)[0]
    return rng.choice(
        (
            ["replace", attribute, f'{key}="{rng.choice(SNIPPETS)}"'],
            ["replace", attribute, ""],
            ["replace", attribute, f'{key}="{rng.choice(_TARGETS)}"'],
            ["replace", attribute, f'{key}="{rng.choice(("99999999999", "-1", "1e9", "true"))}"'],
            ["replace", tag, rng.choice(("<zzz", "<", "<!--", tag + " " + attribute))],
            ["replace", tag, rng.choice(tags).decode("utf-8", "replace")],
            ["cut", rng.randrange(1000)],
            ["insert", rng.randrange(1000), rng.choice(SNIPPETS)],
            ["encode", rng.choice(ENCODINGS)],
        )
    )


_DRAW: dict[str, Callable[[bytes, random.Random], Mutation]] = {
    "tree": _draw_tree,
    "text": _draw_text,
    "binary": _draw_binary,
    "zip": _draw_zip,
}
