"""`list`, `in_force` and `verify` over a decade of records; the peer is the same with a tenth, ten times.

A ratio of 1 is linear growth. Every record holds the data of one session, fitted once, under an id of its
own, and is approved; ``python -m tests.benchmarks.registry_growth 20000`` prints the times of one registry.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import pairs, row
from tests.benchmarks.verify_records import SESSION, data_table
from toolkit.calibration.registry.registry import Registry

RECORDS = 2000
DECADE = 10
DAY = date(2026, 3, 1)


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time a registry of many records against one of a tenth."""
    many, few = (filled(folder / f"growth-{size}", size) for size in (RECORDS, RECORDS // DECADE))
    rows = []
    for name, ask in QUESTIONS.items():

        def peer(ask: Callable[[Registry], object] = ask) -> None:
            for _ in range(DECADE):
                ask(few)

        def ours(ask: Callable[[Registry], object] = ask) -> object:
            return ask(many)

        times = pairs(ours, peer, count)
        rows.append(row(f"{name}, {RECORDS} records", times[0], "a tenth, ten times", times[1], "1.2"))
    return rows


def _list(registry: Registry) -> object:
    from toolkit.lab.records.registry_answer import listed

    return listed(registry, None, known_at=None, everything=False)


def _verify(registry: Registry) -> object:
    from toolkit.calibration.registry.verify import verify_registry

    return verify_registry(registry)


QUESTIONS: dict[str, Callable[[Registry], object]] = {
    "in_force": lambda registry: registry.in_force("bench", on=DAY),
    "list": _list,
    "verify": _verify,
}


def filled(folder: Path, count: int) -> Registry:
    """Write a registry of ``count`` approved records, without lock and flushes."""
    from toolkit.calibration.fit.session_fit import fit_session
    from toolkit.calibration.registry import candidate
    from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, head_bytes, next_line
    from toolkit.calibration.session.read import read_session

    home, rng = folder / "calibrations" / "bench", np.random.default_rng(1)
    home.mkdir(parents=True)
    for name, rows, runs in (("loads", 60, True), ("check", 9, False)):
        (folder / f"{name}.csv").write_text(data_table(rng, rows, runs))
    (folder / "SESSION.toml").write_text(SESSION.format(number=1))
    session = read_session(folder / "SESSION.toml")
    unnumbered = candidate._record(fit_session(session))
    lines: list[bytes] = []
    head = START
    for number in range(1, count + 1):
        record = candidate._numbered(unnumbered, f"bench-r{number}", session)
        change = candidate.entering(record, candidate._contents(session, record), by=session.operator)
        for file, data in change.files.items():
            (home / file).write_bytes(data)
        approved = {
            "event": "approved", "id": record.id, "time": change.event["time"], "by": "checker",
            "known_on": "2026-02-01", "since": "2026-02-01", "unverifiable": [],
        }  # fmt: skip
        for event in (change.event, approved):
            line, head = next_line(len(lines) + 1, head, event)
            lines.append(line)
    (home / LEDGER).write_bytes(b"".join(lines))
    (home / HEAD).write_bytes(head_bytes(len(lines), head))
    return Registry(folder / "calibrations")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        records = int(sys.argv[1])
        registry = filled(Path(place), records)
        for question, act in QUESTIONS.items():
            started = time.perf_counter()
            act(registry)
            seconds = time.perf_counter() - started
            print(f"{question} of {records}: {seconds:.2f} s, {1e3 * seconds / records:.3f} ms a record")  # noqa: T201
