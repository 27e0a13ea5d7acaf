"""Whether today's log continues what was issued: documents and witnesses hold checkpoints of it."""

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

Continuity = Literal["continues", "rolled_back", "forked"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Anchor:
    """What a document carries: a line of the log, its place (from 0), and the proof of it in a checkpoint."""

    line: str
    index: int
    path: tuple[bytes, ...]
    checkpoint: Checkpoint

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON form; hashes are base64, as a checkpoint has them."""
        return {
            "line": self.line,
            "index": self.index,
            "path": [base64.b64encode(step).decode() for step in self.path],
            "checkpoint": self.checkpoint.text,
        }

    @property
    def proved(self) -> bool:
        """Tell whether the line is in the tree of the checkpoint, at its place."""
        leaf = leaf_hash(self.line.encode())
        return included(leaf, self.index, self.checkpoint.size, self.path, self.checkpoint.root)


def anchor_of(lines: Sequence[str], index: int, checkpoint: Checkpoint) -> Anchor:
    """Return the anchor of a log's line (from 0; without its line feed) in a checkpoint of the log."""
    leaves = [leaf_hash(line.encode()) for line in lines[: checkpoint.size]]
    path = tuple(inclusion_proof(leaves, index))
    return Anchor(line=lines[index], index=index, path=path, checkpoint=checkpoint)


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
        raise TrustError(
            "the proof in a document cannot be read", where=where, got=json.dumps(entries, default=str)[:80],
            expected="line, index, path and checkpoint, as the document was issued",
            next_step="take the document as it was issued", rule="anchor",
        )  # fmt: skip
    return Anchor(line=line, index=index, path=path, checkpoint=parse_checkpoint(text, where=where))


@dataclass(frozen=True, slots=True)
class Comparison:
    """How a log stands to a checkpoint of earlier, and why."""

    continuity: Continuity
    why: str


def compare(lines: Sequence[str], checkpoint: Checkpoint, anchor: Anchor | None = None) -> Comparison:
    """Hold today's log against a checkpoint of earlier.

    ``anchor``, of the document that carries the checkpoint, tells where the log was changed.
    """
    if checkpoint.size > len(lines):
        return Comparison(
            "rolled_back",
            f"{checkpoint.size} entries were issued and {len(lines)} are there: entries were removed",
        )
    leaves = [leaf_hash(line.encode()) for line in lines[: checkpoint.size]]
    if root_of(leaves) == checkpoint.root:
        later = len(lines) - checkpoint.size
        return Comparison(
            "continues", f"its first {checkpoint.size} entries are those that were issued; {later} more"
        )
    if anchor is not None and leaf_hash(anchor.line.encode()) != leaves[anchor.index]:
        return Comparison("forked", f"entry {anchor.index + 1} was rewritten: the document has another")
    place = "" if anchor is None else _changed(leaves, anchor)
    return Comparison("forked", f"among the first {checkpoint.size} entries some were rewritten{place}")


def _changed(leaves: Sequence[bytes], anchor: Anchor) -> str:
    """Say which entries differ, by the subtrees beside the anchored line, whose roots the path states."""
    ranges = [
        f"{start + 1}" if stop == start + 1 else f"{start + 1} to {stop}"
        for (start, stop), step in zip(_beside(len(leaves), anchor.index), reversed(anchor.path), strict=True)
        if root_of(leaves[start:stop]) != step
    ]
    return f": in {' and '.join(ranges)}" if ranges else ""


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
