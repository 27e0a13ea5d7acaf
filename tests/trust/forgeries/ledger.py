"""The ledger and the log of people, changed by whoever can write to the home: chain and head are in order."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.trust.forgeries.changes import Forgery, changed, signature_changed, with_part
from tests.trust.forgeries.laboratory import (
    KEYS,
    RIG,
    chained,
    laboratory,
    lines_of,
    new_signer,
    rewritten_people,
    write_lines,
)
from toolkit.calibration.registry.ledger import parse_ledger
from toolkit.calibration.registry.people_log import PeopleLog
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.signatures import unproved
from toolkit.errors import ToolkitError
from toolkit.files import sha256_bytes
from toolkit.trust.people import NAMESPACE

Lines = list[dict[str, Any]]
_REWRITTEN = frozenset({"seq", "prev", "sha256"})  # a rewritten chain has them in order


def forgeries() -> Iterator[Forgery]:
    """Yield every part of every line by every kind of change, and every order of the lines."""
    with laboratory() as home:
        lines, log = lines_of(home), _people_lines(home)
        texts = [path.read_bytes() for path in sorted((home / "people").glob("people-*.toml"))]
    for number, line in enumerate(lines):
        other = lines[(number + 3) % len(lines)]
        for kind, place, forged in _of_line(line, other):
            yield _ledger(kind, f"line {number + 1} ({line['event']}): {place}", _put(lines, number, forged))
    for what, order in _orders(lines):
        yield _ledger("order of lines", what, order)
    for number, line in ((0, log[0]), (len(log) - 1, log[-1])):
        for kind, place, forged in _of_line(line, log[number - 1]):
            if (kind, place) == ("dropped", "signatures, 1"):
                continue  # a policy of one signature: what is left makes the decision
            yield _log(kind, f"people, version {number + 1}: {place}", _put(log, number, forged))
    for what, order in _orders(log):
        yield _log("order of lines", f"people, {what}", order)
    for number, text in enumerate(texts):
        for old, new in (
            ('"checker"', '"head"'),
            ('"Dora Example"', '"Dora"'),
            ('"dora"', '"mallory"'),
            ("2999", "2001"),
        ):
            yield from _people_file(
                log, number, text.replace(old.encode(), new.encode(), 1), f"{old} to {new}"
            )
        key = KEYS["anna"].public.line.encode()
        yield from _people_file(
            log, number, text.replace(key, new_signer().public.line.encode()), "anna's key"
        )


def _of_line(line: dict[str, Any], other: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    yield from changed(line, other, but=_REWRITTEN)
    for name, value in (("more", "x"), ("note", "x"), ("recall", "1 month"), ("approved_by", "anna")):
        if name not in line:
            yield "one entry more", name, {**line, name: value}
    row = line["signatures"][0]
    for kind, sig in signature_changed(row["sig"]):
        yield "signature", kind, with_part(line, ("signatures", 0, "sig"), sig)
    for name in ("mallory", "emil"):
        signed = KEYS[name].armour(b"{}", NAMESPACE)
        yield "signature", f"of {name}", with_part(line, ("signatures", 0, "sig"), signed)
    stranger = {**row, "by": "mallory", "key": KEYS["mallory"].public.fingerprint}
    yield "signature", "one more", with_part(line, ("signatures",), [*line["signatures"], stranger])


def _orders(lines: Lines) -> Iterator[tuple[str, Lines]]:
    for number in range(len(lines)):
        if number < len(lines) - 1:
            yield f"line {number + 1} dropped", [*lines[:number], *lines[number + 1 :]]
            swapped = [*lines[:number], lines[number + 1], lines[number], *lines[number + 2 :]]
            yield f"lines {number + 1} and {number + 2} exchanged", swapped
        yield f"line {number + 1} replayed at the end", [*lines, lines[number]]
        yield f"line {number + 1} doubled", [*lines[: number + 1], *lines[number:]]


def _put(lines: Lines, number: int, line: dict[str, Any]) -> Lines:
    return [*lines[:number], line, *lines[number + 1 :]]


def _ledger(kind: str, what: str, lines: Lines) -> Forgery:
    return Forgery(kind=kind, what=what, accepted=functools.partial(_ledger_believed, lines))


def _log(kind: str, what: str, lines: Lines) -> Forgery:
    return Forgery(kind=kind, what=what, accepted=functools.partial(_log_believed, lines))


@functools.cache
def _log_of_people() -> PeopleLog:
    with laboratory() as home:
        return Registry(home / "calibrations").people()


def _ledger_believed(lines: Lines) -> bool:
    """Tell whether the judgement that every reader goes by takes rewritten lines for the laboratory's."""
    try:
        text, head = chained(lines)
    except (TypeError, ValueError):
        return False  # no text of a ledger
    ledger, log = parse_ledger(text, head), _log_of_people()
    return ledger.damage is None and unproved(ledger, log.history, log.places(RIG)) is None


def _log_believed(lines: Lines) -> bool:
    with rewritten_people() as home:
        try:
            write_lines(home / "people", lines)
        except (TypeError, ValueError):
            return False
        return _people_believed(home)


def _people_believed(home: Path) -> bool:
    try:
        Registry(home / "calibrations").people()
    except ToolkitError:
        return False
    return True


def _people_lines(home: Path) -> Lines:
    return [json.loads(line) for line in (home / "people/ledger.jsonl").read_bytes().splitlines()]


def _people_file(log: Lines, number: int, text: bytes, what: str) -> Iterator[Forgery]:
    """Yield a version of the people's file that was changed: alone, and with the hashes that name it."""

    def accepted(*, named: bool) -> bool:
        digest = sha256_bytes(text)
        with rewritten_people() as home:
            (home / f"people/people-{number + 1}.toml").write_bytes(text)
            if named:
                subject = {**log[number]["subject"], "sha256": digest}
                write_lines(
                    home / "people", _put(log, number, {**log[number], "file": digest, "subject": subject})
                )
            return _people_believed(home)

    for named in (False, True):
        name = f"version {number + 1}: {what}, {'its hashes too' if named else 'its hash left'}"
        yield Forgery(kind="people's file", what=name, accepted=functools.partial(accepted, named=named))
