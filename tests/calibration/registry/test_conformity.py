"""No line of a ledger is believed that no command could have written, however sound its chain is."""

from __future__ import annotations

import datetime as dt
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.calibration.control_factory import enter, write_session
from tests.calibration.registry.test_clock import SESSION, rewrite
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.judgement import evidence_of
from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, head_bytes, next_line
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RecordError, RegistryError

Event = dict[str, Any]
PROJECT = Path(__file__).resolve().parents[3] / "calibrations"


@pytest.fixture
def approved(tmp_path: Path) -> Registry:
    registry = Registry(tmp_path / "cal")
    enter(registry, tmp_path / "s", SESSION)
    assert approve(registry, "cell-r1", in_force_from=SESSION, checked_by="B").done
    return registry


def events(registry: Registry, instrument: str = "cell") -> list[Event]:
    lines = (registry.folder / instrument / LEDGER).read_text().splitlines()
    bodies = [json.loads(line) for line in lines]
    return [{k: v for k, v in body.items() if k not in ("seq", "prev", "sha256")} for body in bodies]


def write(registry: Registry, rows: list[Event], instrument: str = "cell") -> None:
    """Write a ledger of these events, its chain and its head intact."""
    lines, prev = b"", START
    for seq, event in enumerate(rows, start=1):
        line, prev = next_line(seq, prev, event)
        lines += line
    (registry.folder / instrument / LEDGER).write_bytes(lines)
    (registry.folder / instrument / HEAD).write_bytes(head_bytes(len(rows), prev))


def withdrawn(event: Event, **changes: Any) -> Event:
    return {
        "event": "withdrawn", "id": "cell-r1", "time": event["time"], "clock": "unknown", "by": "C",
        "known_on": event["known_on"], "reason": "dropped", **changes,
    }  # fmt: skip


FORGERIES: dict[str, tuple[str, Callable[[list[Event]], list[Event]]]] = {
    "by the operator": ("names", lambda e: [e[0], {**e[1], "by": e[0]["by"].upper()}]),
    "by nobody": ("names", lambda e: [e[0], {**e[1], "by": " \u200b"}]),
    "checked and approved by one": ("names", lambda e: [e[0], {**e[1], "approved_by": "b"}]),
    "entered by another": ("names", lambda e: [{**e[0], "by": "Mallory"}, e[1]]),
    "no in-force date": ("approval", lambda e: [e[0], {k: v for k, v in e[1].items() if k != "since"}]),
    "no day": ("time", lambda e: [e[0], {k: v for k, v in e[1].items() if k != "known_on"}]),
    "before the session": ("approval", lambda e: [e[0], {**e[1], "since": "2019-01-01"}]),
    "dated back": ("time", lambda e: [e[0], {**e[1], "known_on": "2025-03-11"}]),
    "twice": ("approval", lambda e: [*e, e[1]]),
    "later than before": ("approval", lambda e: [*e, {**e[1], "since": "2025-04-01", "reason": "so"}]),
    "no interval": ("recall", lambda e: [e[0], {**e[1], "recall": "for ever"}]),
    "entered twice": ("ledger", lambda e: [e[0], e[0], e[1]]),
    "withdrawn without a reason": ("withdrawal", lambda e: [*e, withdrawn(e[1], reason=" ")]),
    "withdrawn by nobody": ("names", lambda e: [*e, withdrawn(e[1], by="")]),
    "withdrawn twice": ("withdrawal", lambda e: [*e, withdrawn(e[1]), withdrawn(e[1])]),
    "approved after its end": ("approval", lambda e: [e[0], withdrawn(e[1]), e[1]]),
    "discarded though approved": ("discard", lambda e: [*e, {**withdrawn(e[1]), "event": "discarded"}]),
    "an issue of nothing": ("ledger", lambda e: [*e, {**withdrawn(e[1]), "event": "issued"}]),
}  # fmt: skip


@pytest.mark.parametrize("name", FORGERIES)
def test_a_record_with_a_line_that_cannot_be_written_makes_no_number(approved: Registry, name: str) -> None:
    rule, forge = FORGERIES[name]
    write(approved, forge(events(approved)))
    with pytest.raises(RecordError) as caught:
        approved.load("cell-r1")
    error = caught.value
    assert error.rule == rule
    assert all((error.what, error.where, error.got, error.expected, error.next_step))
    (row,) = verify_registry(approved)
    assert (row.ok, (row.reason or "").split(":")[0]) == (False, rule)
    with pytest.raises((RecordError, RegistryError)):
        approved.in_force("cell", on=SESSION)


STRAY_LINES: dict[str, tuple[str, Callable[[list[Event]], list[Event]]]] = {
    "of no record": ("no record of that name", lambda e: [*e, {**e[1], "id": "cell-r9"}]),
    "before its entry": ("no record of that name", lambda e: [e[1], e[0]]),
    "of another instrument": ("no record of cell", lambda e: [{**e[0], "id": "other-r1"}, *e]),
    "back in time": ("a clock was set back", lambda e: [{**e[0], "time": "2999-01-01T00:00:00Z"}, e[1]]),
    "of an earlier form": (
        "does not state the clock", lambda e: [e[0], {k: v for k, v in e[1].items() if k != "clock"}],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", STRAY_LINES)
def test_a_line_that_belongs_nowhere_damages_the_whole_ledger(approved: Registry, name: str) -> None:
    words, forge = STRAY_LINES[name]
    write(approved, forge(events(approved)))
    assert words in (approved.ledger("cell").damage or "")
    with pytest.raises(RecordError, match="may not be used"):
        approved.load("cell-r1")
    with pytest.raises(RegistryError, match="damaged"):
        approved.status("cell-r1")
    rows = verify_registry(approved)
    assert rows
    assert not any(row.ok for row in rows)


def test_a_record_whose_gates_failed_is_not_in_force_by_a_line(tmp_path: Path) -> None:
    """`approve` refused it; the very line that it would have written is believed by nobody."""
    registry = Registry(tmp_path / "cal")
    enter(registry, tmp_path / "s", SESSION)
    good = registry.load("cell-r1")
    assert approve(registry, "cell-r1", in_force_from=SESSION, checked_by="B").done
    enter(registry, tmp_path / "t", SESSION + dt.timedelta(days=30), span=-1.0)
    refused = approve(registry, "cell-r2", in_force_from=SESSION + dt.timedelta(days=30), checked_by="B")
    assert not refused.done
    rows = events(registry)
    write(registry, [*rows, {**rows[1], "id": "cell-r2", "time": rows[-1]["time"], "since": "2025-04-09"}])
    with pytest.raises(RecordError, match=r"no command writes its line 4 \(approved\)") as caught:
        registry.in_force("cell", on=SESSION + dt.timedelta(days=40))
    assert caught.value.rule == "approval"
    assert {failed.rule for failed in refused.failed} & set(
        (caught.value.got or "").replace("(", " ").split()
    )
    assert [row.ok for row in verify_registry(registry)] == [True, False]
    assert registry.load("cell-r1") == good
    # To withdraw it is the way out, as of every record that should not have been approved.
    withdraw(registry, "cell-r2", on=dt.date.fromisoformat(rows[1]["known_on"]), reason="forged", by="B")
    assert all(row.ok for row in verify_registry(registry))
    assert registry.in_force("cell", on=SESSION + dt.timedelta(days=40)) == good


def test_lines_of_before_the_clock_was_stated_need_no_reason_for_their_day(approved: Registry) -> None:
    def older(_seq: int, event: dict[str, object]) -> None:
        del event["clock"]
        if event["event"] == "approved":
            event["known_on"] = SESSION.isoformat()

    rewrite(approved, older)
    assert all(row.ok for row in verify_registry(approved))


def test_an_approval_names_what_no_check_load_verifies(tmp_path: Path) -> None:
    # Certificates print it: a legacy record has no check loads, so that nothing of it is verified.
    shutil.copytree(PROJECT / "m15", tmp_path / "m15")
    registry = Registry(tmp_path)
    rows = events(registry, "m15")
    rows[4]["unverifiable"].remove("FY: E5")
    write(registry, rows, "m15")
    with pytest.raises(RecordError, match="no command writes its line 5") as caught:
        registry.load("m15-r2")
    assert (caught.value.rule, "nothing of FY: E5" in (caught.value.got or "")) == ("approval", True)


def test_evidence_of_what_the_registry_does_not_keep_is_read_back() -> None:
    record = Registry(PROJECT).load("m15-r2")
    older = "polarity reading: 99.8 lbf by the record where 100 lbf were applied; it shows D51, E5"
    read = evidence_of([older], record).read
    assert read.loads == {"FY"}
    assert read.indications == {"D51", "E5"}
    named = older.replace("reading:", "reading of MZ:").replace("lbf", "lbf*ft")
    assert evidence_of([named], record).read.loads == {"MZ"}
    # A reading of the wrong sign confirms nothing, nor does what is no evidence at all.
    assert evidence_of([older.replace(" 100 ", " -100 "), "so they say"], record).read.loads == frozenset()
    machine = evidence_of(["signs as machine rig, version 3, states them: FY D51, MZ E5"], record)
    assert machine.machine == ("rig", "3")
    assert machine.stated.pairs == {("FY", "D51"), ("MZ", "E5")}


def test_an_approval_by_a_machine_and_a_reading_is_judged_alike_when_it_is_read(
    tmp_path: Path,
) -> None:
    """What the gates say of a record at its approval they say again of the line that was written."""
    registry = Registry(tmp_path / "cal")
    path = write_session(tmp_path / "s", SESSION)
    text = path.read_text()
    begin = text.index("polarity = ")
    path.write_text(text[:begin] + text[text.index("[check]") :])
    calibrate(path, registry)
    assert not approve(registry, "cell-r1", in_force_from=SESSION, checked_by="B").done
    reading = tmp_path / "reading.toml"
    reading.write_text("[[polarity]]\n" + text[begin:].split("{ ", 1)[1].split(" }]")[0].replace(
        ", indications", "\nindications").replace(", value", "\nvalue") + "\n")  # fmt: skip
    assert approve(registry, "cell-r1", in_force_from=SESSION, checked_by="B", polarity=reading).done
    assert registry.load("cell-r1").id == "cell-r1"
    rows = events(registry)
    write(registry, [rows[0], {k: v for k, v in rows[1].items() if k != "evidence"}])
    with pytest.raises(RecordError, match="no command writes") as caught:
        registry.load("cell-r1")
    assert "polarity-reading" in (caught.value.got or "")
