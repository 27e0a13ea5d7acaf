"""Reading and proving a ledger; the peers do nothing but hash its bytes, or verify its signatures.

A line is hashed twice, for the chain and for the tree: that is the floor. A signature is verified once.
``python -m tests.benchmarks.ledger_time 1000000`` reads a ledger of a million lines once.
"""

from __future__ import annotations

import hashlib
import json
import sys
import time
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from tests.benchmarks.timing import pairs, row
from tests.trust.forgeries.laboratory import KEYS, RIG, event_of, laboratory, signed_again
from toolkit.calibration.registry.ledger import START, head_bytes, next_line, parse_ledger
from toolkit.calibration.registry.registry import Registry
from toolkit.trust.merkle import Growing, leaf_hash

LINES, SIGNED = 100_000, 1_000


def ledger_of(count: int) -> tuple[bytes, bytes]:
    """Return the two files of a ledger in which records are entered and approved in turn."""
    lines, prev = [], START
    for number in range(1, count + 1):
        record = f"m15-r{(number + 1) // 2}"
        more = {"record": "a" * 64, "file": "b" * 64, "inputs": "c" * 64}
        if number % 2 == 0:
            more = {"known_on": "2026-01-01", "since": "2026-01-01", "clock": "synchronised"}
        event = {"event": "approved" if number % 2 == 0 else "entered", "id": record, "by": "x", **more}
        line, prev = next_line(number, prev, {**event, "time": "2026-01-01T00:00:00Z"})
        lines.append(line)
    return b"".join(lines), head_bytes(count, prev)


def read(data: bytes, head: bytes) -> bytes:
    """Read a ledger, chain and form, and return the root of its tree."""
    ledger = parse_ledger(data, head)
    assert ledger.damage is None
    return Growing(map(leaf_hash, ledger.lines)).root()


def floor(data: bytes) -> None:
    """Hash every line twice."""
    for line in data.split(b"\n"):
        hashlib.sha256(line).digest()
        hashlib.sha256(line).digest()


def run(_folder: Path, count: int) -> list[dict[str, object]]:
    """Time a ledger without signatures, and one in which each line has one."""
    data, head = ledger_of(LINES)
    times = pairs(lambda: read(data, head), lambda: floor(data), max(count // 2, 1))
    rows = [row(f"read {LINES} lines of a ledger", times[0], "hashlib, each line twice", times[1], "20")]
    private = Ed25519PrivateKey.generate()
    message, public = b"x" * 600, private.public_key()
    signature = private.sign(message)

    def verify() -> None:
        for _ in range(SIGNED):
            public.verify(signature, message)

    with laboratory() as home:
        lines = [event_of("entered", f"rig-r{number}", by="Carl Example") for number in range(SIGNED)]
        for line in lines:
            line["subject"] = {"sha256": line["record"]}
        signed_again(home, lines, {number: [KEYS["carl"]] for number in range(SIGNED)})

        def prove() -> None:
            assert Registry(home / "calibrations").ledger(RIG).damage is None

        times = pairs(prove, verify, count)
    per_record = [1e3 * seconds / SIGNED for seconds in times[0]]
    rows.append(row(f"prove {SIGNED} signed lines", times[0], "cryptography, Ed25519 alone", times[1], "3"))
    rows.append(row("of which a record", per_record, "", None, "5 ms", unit="ms"))
    return rows


if __name__ == "__main__":
    data, head = ledger_of(int(sys.argv[1]))
    started = time.perf_counter(), time.process_time()
    read(data, head)
    wall, busy = time.perf_counter() - started[0], time.process_time() - started[1]
    started = time.perf_counter(), time.process_time()
    floor(data)
    print(json.dumps({"wall_s": wall, "cpu_s": busy, "floor_cpu_s": time.process_time() - started[1]}))  # noqa: T201
