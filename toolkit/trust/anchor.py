"""Whether today's log continues what was issued: documents and witnesses hold checkpoints of it.

A document holds its anchor whole, as JSON, and in a compact form that fits into a QR code: a line with its
kind and the place of the entry, the hash of the entry, its way to the root, and the checkpoint.
"""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from toolkit.errors import TrustError
from toolkit.trust.checkpoint import Checkpoint, parse_checkpoint
from toolkit.trust.merkle import HASH_BYTES, included, inclusion_proof, leaf_hash, root_of

Continuity = Literal["continues", "rolled_back", "forked", "unknown"]
COMPACT = "toolkit-proof@v1"
MOST_BYTES = 2048
"""Of a compact form."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """What a document carries: a line of the log, its place (from 0), and the proof of it in a checkpoint.

    ``leaf`` is the line's hash; the compact form holds that alone, and ``line`` is None then.
    """

    leaf: bytes
    index: int
    path: tuple[bytes, ...]
    checkpoint: Checkpoint
    line: str | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON form; hashes are base64, as a checkpoint has them."""
        return {
            "line": self.line,
            "index": self.index,
            "path": [_text(step) for step in self.path],
            "checkpoint": self.checkpoint.text,
        }

    @property
    def proved(self) -> bool:
        """Tell whether the line is in the tree of the checkpoint, at its place."""
        return included(self.leaf, self.index, self.checkpoint.size, self.path, self.checkpoint.root)

    @property
    def compact(self) -> bytes:
        """The form of a QR code.

        Raises
        ------
        TrustError
            ``proof-size``: more than `MOST_BYTES`, by very many signatures
        """
        words = [
            f"{COMPACT} {self.index}",
            _text(self.leaf),
            _text(b"".join(self.path)),
            self.checkpoint.text,
        ]
        data = "\n".join(words).encode()
        if len(data) > MOST_BYTES:
            raise TrustError(
                "the proof does not fit into a QR code", where=self.checkpoint.origin,
                got=f"{len(data)} bytes", expected=f"at most {MOST_BYTES}",
                next_step="sign with fewer keys; nothing was issued", rule="proof-size",
            )  # fmt: skip
        return data


def anchor_of(lines: Sequence[str], index: int, checkpoint: Checkpoint) -> Anchor:
    """Return the anchor of a log's line (from 0; without its line feed) in a checkpoint of the log."""
    leaves = [leaf_hash(line.encode()) for line in lines[: checkpoint.size]]
    path = tuple(inclusion_proof(leaves, index))
    return Anchor(leaf=leaves[index], index=index, path=path, checkpoint=checkpoint, line=lines[index])


def parse_anchor(entries: Mapping[str, Any], *, where: object = None) -> Anchor:
    """Read the JSON form of an anchor.

    Raises
    ------
    TrustError
        ``anchor``: it is none; ``checkpoint``
    """
    try:
        path = tuple(base64.b64decode(step, validate=True) for step in entries["path"])
        line, index, text = entries["line"], entries["index"], entries["checkpoint"]
        sound = isinstance(line, str) and type(index) is int and isinstance(text, str)
    except (KeyError, TypeError, ValueError, binascii.Error):
        sound = False
    if not sound or any(len(step) != HASH_BYTES for step in path):
        raise _unreadable(json.dumps(entries, default=str), where)
    checkpoint = parse_checkpoint(text, where=where)
    return Anchor(leaf=leaf_hash(line.encode()), index=index, path=path, checkpoint=checkpoint, line=line)


def parse_compact(text: str, *, where: object = None) -> Anchor:
    """Read what a QR code says.

    Raises
    ------
    TrustError
        ``anchor``: it is none; ``checkpoint``
    """
    try:
        head, leaf_text, path_text, checkpoint = text.split("\n", 3)
        kind, number = head.split(" ")
        leaf, way = (base64.b64decode(part, validate=True) for part in (leaf_text, path_text))
        index = int(number) if number.isascii() and number.isdigit() else -1
    except (ValueError, binascii.Error) as error:
        raise _unreadable(text, where) from error
    if kind != COMPACT or index < 0 or len(leaf) != HASH_BYTES or len(way) % HASH_BYTES:
        raise _unreadable(text, where)
    path = tuple(way[at : at + HASH_BYTES] for at in range(0, len(way), HASH_BYTES))
    return Anchor(leaf=leaf, index=index, path=path, checkpoint=parse_checkpoint(checkpoint, where=where))


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _unreadable(got: str, where: object) -> TrustError:
    return TrustError(
        "the proof in a document cannot be read", where=where, got=got[:80],
        expected="line, index, path and checkpoint, as the document was issued",
        next_step="take the document as it was issued", rule="anchor",
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Comparison:
    """How a log stands to a checkpoint of earlier, and why."""

    continuity: Continuity
    why: str


def compare(lines: Sequence[str], checkpoint: Checkpoint, anchor: Anchor | None = None) -> Comparison:
    """Hold today's log against a checkpoint of earlier.

    ``anchor``, of the document that carries the checkpoint, tells among which entries the first differs.
    """
    leaves = [leaf_hash(line.encode()) for line in lines[: checkpoint.size]]
    issued, present = checkpoint.size, len(leaves)
    differing = [] if anchor is None else _differing(leaves, anchor)
    if present < issued:
        place = f"; {_first(differing[0])}" if differing else ""
        return Comparison(
            "rolled_back",
            f"{issued} entries were issued and {present} are there: entries were removed{place}",
        )
    if root_of(leaves) == checkpoint.root:
        return Comparison(
            "continues", f"its first {issued} entries are those that were issued; {len(lines) - issued} more"
        )
    why = _first(differing[0] if differing else (0, issued))
    if anchor is not None and (anchor.index, anchor.index + 1) in differing[1:]:
        why += f"; entry {anchor.index + 1}, the document's own, differs too"
    return Comparison("forked", f"entries were rewritten: {why}")


def _first(place: tuple[int, int]) -> str:
    start, stop = place
    entry = f"entry {stop}" if stop == start + 1 else f"one of the entries {start + 1} to {stop}"
    return f"the first that differs from what was issued is {entry}"


def _differing(leaves: Sequence[bytes], anchor: Anchor) -> list[tuple[int, int]]:
    """Return the ranges of entries that differ, in order: the anchor's own, and those beside its way."""
    beside = _beside(anchor.checkpoint.size, anchor.index)
    roots = dict(zip(beside, reversed(anchor.path), strict=False))
    roots[anchor.index, anchor.index + 1] = anchor.leaf
    return [
        (start, stop)
        for (start, stop), root in sorted(roots.items())
        if stop <= len(leaves) and root_of(leaves[start:stop]) != root
    ]


def _beside(size: int, index: int) -> list[tuple[int, int]]:
    """Return the ranges of the subtrees beside a leaf's way, from the root down."""
    ranges, start, stop = [], 0, size
    while stop - start > 1:
        middle = start + (1 << (stop - start - 1).bit_length() - 1)
        if index < middle:
            ranges.append((middle, stop))
            stop = middle
        else:
            ranges.append((start, middle))
            start = middle
    return ranges
