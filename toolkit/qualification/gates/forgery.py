"""A registry changed by one who can compute every hash: records, ledger and head agree with each other."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import CalibrationRecord, sealed, to_bytes
from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, head_bytes, next_line
from toolkit.files import sha256_bytes

_OF_THE_CHAIN = ("seq", "prev", "sha256")


def rewrite_ledger(folder: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    """Write an instrument's ledger anew, each event changed and the chain intact."""
    bodies = [json.loads(line) for line in (folder / LEDGER).read_bytes().splitlines()]
    lines, previous = b"", START
    for number, body in enumerate(bodies, start=1):
        event = change({key: value for key, value in body.items() if key not in _OF_THE_CHAIN})
        line, previous = next_line(number, previous, event)
        lines += line
    (folder / LEDGER).write_bytes(lines)
    (folder / HEAD).write_bytes(head_bytes(len(bodies), previous))


def forge(folder: Path, record: CalibrationRecord) -> None:
    """Write a changed record in place of the entered one, with its hashes in the ledger."""
    record = sealed(record)
    data = to_bytes(record)
    (folder / f"{record.id}.json").write_bytes(data)
    hashes = {"record": record.sha256, "file": sha256_bytes(data), "inputs": record.inputs_sha256}
    rewrite_ledger(
        folder,
        lambda event: (
            {**event, **hashes} if event["event"] == "entered" and event["id"] == record.id else event
        ),
    )
