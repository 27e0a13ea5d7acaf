"""Altered records: what was changed behind the registry's back is refused when the record is read.

The first changes are careless; those of `forgery` come with every hash computed anew, and only what a record
is made of can tell.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import CalibrationRecord, LoadFit, sealed, to_bytes
from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, head_bytes, next_line
from toolkit.calibration.registry.refit import polarity
from toolkit.calibration.registry.registry import Registry
from toolkit.files import sha256_bytes
from toolkit.qualification.gates.bench import Act, Bench, Demonstration, Refusals
from toolkit.qualification.gates.virtual_hub import RIG

# A registry changed by one who can compute every hash: records, ledger and head agree with each other.


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


_RECORD = f"{RIG}-r1"
_FILE, _DATA = f"{_RECORD}.json", f"{_RECORD}.loads.csv"
Change = Callable[[CalibrationRecord], CalibrationRecord]


def _load(registry: Registry) -> Act:
    def act() -> Refusals:
        registry.load(_RECORD)
        return ()

    return act


def _careless(name: str, rules: str, change: Callable[[Path], object]) -> Demonstration:
    def prepare(bench: Bench) -> Act:
        change(bench.registry.folder / RIG)
        return _load(bench.registry)

    return Demonstration(name=name, stage="record read", rules=tuple(rules.split()), prepare=prepare)


def _forged(name: str, rule: str, change: Change) -> Demonstration:
    def alter(folder: Path) -> None:
        forge(folder, change(Registry(folder.parent).load(_RECORD)))

    return _careless(f"{name}, every hash computed anew", rule, alter)


def _replaced(file: str, old: bytes, new: bytes) -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        path = folder / file
        data = path.read_bytes()
        if old not in data:
            raise ValueError(f"{file} does not hold {old!r}")
        path.write_bytes(data.replace(old, new, 1))

    return change


def _first_load(change: Callable[[LoadFit], LoadFit]) -> Change:
    def alter(record: CalibrationRecord) -> CalibrationRecord:
        first, *following = record.loads
        return dataclasses.replace(record, loads=(change(first), *following))

    return alter


def _negated(load: LoadFit) -> LoadFit:
    coefficients = (-load.coefficients[0], *load.coefficients[1:])
    return dataclasses.replace(load, coefficients=coefficients, polarity=polarity(coefficients))


def _smaller(load: LoadFit) -> LoadFit:
    covariance = tuple(tuple(value / 4 for value in row) for row in load.covariance)
    return dataclasses.replace(load, covariance=covariance)


def _less_scatter(load: LoadFit) -> LoadFit:
    if load.scatter is None:
        raise ValueError("the record has no scatter components")
    return dataclasses.replace(
        load, scatter=dataclasses.replace(load.scatter, within=load.scatter.within / 2)
    )


def _shifted_golden(record: CalibrationRecord) -> CalibrationRecord:
    golden = record.golden
    outputs = tuple(tuple(1.001 * value for value in row) for row in golden.outputs)
    return dataclasses.replace(record, golden=dataclasses.replace(golden, outputs=outputs))


def _exchange_loads(folder: Path) -> None:
    record = Registry(folder.parent).load(_RECORD)
    path = folder / _DATA
    data = path.read_bytes().replace(b",3000.0,", b",3100.0,")
    path.write_bytes(data)
    files = tuple(
        dataclasses.replace(part, sha256=sha256_bytes(data)) if part.role == "loads" else part
        for part in record.data
    )
    forge(folder, dataclasses.replace(record, data=files))


def _cut_off(folder: Path) -> None:
    lines = (folder / LEDGER).read_bytes().splitlines(keepends=True)
    (folder / LEDGER).write_bytes(b"".join(lines[:-1]))


DEMONSTRATIONS: tuple[Demonstration, ...] = (
    _careless("record as it was entered", "", Path.exists),
    _careless("file of the record removed", "missing", lambda folder: (folder / _FILE).unlink()),
    _careless("file of the record cut off", "unreadable", lambda folder: (folder / _FILE).write_bytes(b"{")),
    _careless("digit of the record's file changed", "hash", _replaced(_FILE, b"6000.0", b"6001.0")),
    _careless("reference loads changed", "data", _replaced(_DATA, b"6000.0", b"6001.0")),
    _careless("ledger line changed", "ledger", _replaced(LEDGER, b"virtual checker", b"virtual approver")),
    _careless("last ledger line cut off", "ledger", _cut_off),
    _forged("coefficient negated", "refit", _first_load(_negated)),
    _forged("covariance divided by four", "refit", _first_load(_smaller)),
    _forged("scatter within a run halved", "refit", _first_load(_less_scatter)),
    _forged("golden vectors changed", "golden", _shifted_golden),
    _forged("date changed", "data", lambda record: dataclasses.replace(record, date="2020-03-03")),
    _careless("reference loads exchanged, every hash computed anew", "refit", _exchange_loads),
)
