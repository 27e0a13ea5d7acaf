"""Rewritten, cut and forked ledgers against what others hold: checkpoints, proofs and witnesses."""

from __future__ import annotations

import functools
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.trust.forgeries.changes import Forgery, changed
from tests.trust.forgeries.laboratory import (
    DECISIONS,
    KEYS,
    RIG,
    believed,
    laboratory,
    lines_of,
    signed_again,
)
from tests.trust.signatures import signed_by
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import ToolkitError
from toolkit.lab.signatures.people import anchor_document, check_against, checkpoint_of
from toolkit.lab.signatures.people import lines_of as texts_of
from toolkit.trust.anchor import parse_anchor
from toolkit.trust.checkpoint import countersign, parse_checkpoint


def forgeries() -> Iterator[Forgery]:
    """Yield what everybody's keys together can do to a log, and what can be done to a proof."""
    with laboratory() as home:
        registry = Registry(home / "calibrations", signers=[KEYS["anna"]])
        lines, checkpoint = lines_of(home), checkpoint_of(registry, RIG)
        documents = [anchor_document(registry, RIG, seq, checkpoint) for seq in range(1, len(lines) + 1)]
    for number in range(len(lines)):
        # With the keys of everybody who signed: an operator's stolen key can do no more.
        yield _held(
            "rewritten log", f"from line {number + 1} on, all keys stolen", number, documents, checkpoint.text
        )
        yield _held("truncated tail", f"to {number} lines", number, documents, checkpoint.text, cut=True)
    for number in (0, len(lines) - 1):
        document = json.loads(documents[number])
        other = json.loads(documents[number - 1])
        for kind, place, forged in changed(document, other, but=frozenset({"schema"})):
            yield Forgery(
                kind="proof of a document", what=f"entry {number + 1}, {place}: {kind}",
                accepted=functools.partial(_proof_holds, json.dumps(forged)),
            )  # fmt: skip
    text = checkpoint.text
    for byte in range(0, len(text.encode()) - 1, 3):
        data = bytearray(text.encode())
        data[byte] ^= 1
        yield Forgery(
            kind="forked checkpoint", what=f"bit of byte {byte}",
            accepted=functools.partial(_checkpoint_holds, bytes(data).decode(errors="replace")),
        )  # fmt: skip


def _held(
    kind: str, what: str, number: int, documents: list[str], checkpoint: str, *, cut: bool = False
) -> Forgery:
    def accepted() -> bool:
        with laboratory() as home, tempfile.TemporaryDirectory() as place:
            registry = Registry(home / "calibrations")
            folder = Path(place)
            countersign(
                folder,
                "north",
                KEYS["mallory"],
                parse_checkpoint(checkpoint),
                texts_of(registry, RIG),
                time=1,
            )
            lines = lines_of(home)
            if cut:
                signed_again(home, lines[:number], {})
            else:
                lines[number] = {**lines[number], "time": "2026-03-01T11:00:00Z"} if number == 0 else {
                    **lines[number], "reason": "another"
                }  # fmt: skip
                keys = {at: [KEYS[DECISIONS[at][1]]] for at in range(number, len(lines))}
                signed_again(home, lines, keys)
            forged = Registry(home / "calibrations")
            if not believed(home):
                raise AssertionError("the ledger by itself was to be in order")
            try:
                countersign(
                    folder,
                    "north",
                    KEYS["mallory"],
                    checkpoint_of(forged, RIG),
                    texts_of(forged, RIG),
                    time=2,
                )
            except ToolkitError:
                witnessed = False
            else:
                witnessed = True
            held = []
            for document in (*documents, checkpoint):
                path = folder / "document.json"
                path.write_text(document)
                held.append(_continues(forged, path))
            return witnessed or any(held)

    return Forgery(kind=kind, what=what, accepted=accepted)


def _proof_holds(text: str) -> bool:
    with laboratory() as home, tempfile.TemporaryDirectory() as place:
        path = Path(place) / "document.json"
        path.write_text(text)
        try:
            anchor = parse_anchor(json.loads(text))
            signed = signed_by(anchor.checkpoint, "anna", KEYS["anna"].public)
            continues = _continues(Registry(home / "calibrations"), path)
        except ToolkitError:
            return False
        return continues and anchor.proved and signed


def _checkpoint_holds(text: str) -> bool:
    with laboratory() as home, tempfile.TemporaryDirectory() as place:
        path = Path(place) / "checkpoint"
        path.write_text(text)
        try:
            signed = signed_by(parse_checkpoint(text), "anna", KEYS["anna"].public)
            continues = _continues(Registry(home / "calibrations"), path)
        except ToolkitError:
            return False
        return signed and continues


def _continues(registry: Registry, document: Path) -> bool:
    return check_against(registry, RIG, document)[1].continuity == "continues"
