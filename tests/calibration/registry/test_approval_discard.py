"""A candidate's end, and a dry run: what they leave, what they hide, and what they can never undo."""

from __future__ import annotations

import datetime as dt
import multiprocessing
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests import commands
from tests.calibration.calibration_factory import hub_data
from tests.calibration.registry.test_candidate_legacy import GOOD
from toolkit.calibration.control import calibrate as control
from toolkit.calibration.control.chart import control_chart
from toolkit.calibration.registry import settled
from toolkit.calibration.registry.approval import approve, discard, withdraw
from toolkit.calibration.registry.candidate import calibrate, import_legacy
from toolkit.calibration.registry.clock import today
from toolkit.calibration.registry.history import approved_ids
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.cli import calibrate as calibrate_command
from toolkit.errors import ConfigError, RegistryError

Make = Callable[..., Path]
Run = Callable[..., tuple[int, dict[str, Any]]]
FORK = multiprocessing.get_context("fork")
FEBRUARY = dt.date(2026, 2, 1)


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def approved(registry: Registry, record_id: str = "hub-r1") -> bool:
    return approve(registry, record_id, in_force_from=FEBRUARY, checked_by="B").done


@pytest.fixture
def run(registry: Registry) -> Run:
    def call(*words: object) -> tuple[int, dict[str, Any]]:
        code, answer = commands.answer(*words, "--calibrations", registry.folder)
        return code, answer.get("error", answer)

    return call


def test_a_discarded_candidate_is_hidden_and_known_for_ever(run: Run, registry: Registry) -> None:
    before = files(registry.folder)
    code, told = run("calibration", "discard", "hub-r1", "--reason", "cable was loose", "--by", "C")
    assert (code, told["status"], told["head"]) == (0, "discarded", registry.head("hub"))
    after = files(registry.folder)
    # Nothing but a line at the end of the ledger, and its head.
    assert {name for name in after if after[name] != before.get(name)} == {
        "hub/ledger.jsonl",
        "hub/head.json",
    }
    assert after["hub/ledger.jsonl"].startswith(before["hub/ledger.jsonl"])
    assert run("calibration", "list")[1]["records"] == []
    assert run("calibration", "list")[1]["hidden"] == 1
    row = run("calibration", "list", "--all")[1]["records"][0]
    assert (row["id"], row["status"], row["reason"]) == ("hub-r1", "discarded", "cable was loose")
    assert run("calibration", "show", "hub-r1")[1]["record"]["status"] == "discarded"
    events = run("calibration", "history", "hub")[1]["events"]
    assert [(e["event"], e["by"], e["reason"]) for e in events][1:] == [("discarded", "C", "cable was loose")]
    assert run("calibration", "verify")[0] == 0
    # As known the day before, it was a candidate.
    assert run("calibration", "list", "--known-at", "2026-01-06")[1]["records"][0]["status"] == "candidate"


def test_it_can_never_be_approved_withdrawn_or_discarded_again(run: Run, registry: Registry) -> None:
    discard(registry, "hub-r1", reason="loose cable", by="C")
    head = registry.head("hub")
    decision = ("--in-force-from", "2026-02-01", "--checked-by", "B")
    for words, rule in (
        (("approve", "hub-r1", *decision), "approval"),
        (("withdraw", "hub-r1", "--on", "2026-02-01", "--reason", "x", "--by", "B"), "withdrawal"),
        (("discard", "hub-r1", "--reason", "x", "--by", "C"), "discard"),
    ):
        code, told = run("calibration", *words)
        assert (code, told["rule"]) == (2, rule)
        assert "loose cable" in told["got"]
        assert all(told.values())
    assert registry.head("hub") == head
    with pytest.raises(RegistryError) as caught:
        registry.in_force("hub", on=FEBRUARY)
    assert caught.value.rule == "no-record-in-force"
    assert approved_ids(registry.ledger("hub")) == []


def test_only_a_candidate_that_was_never_approved_is_discarded(run: Run, registry: Registry) -> None:
    assert approved(registry)
    code, told = run("calibration", "discard", "hub-r1", "--reason", "x", "--by", "C")
    assert (code, told["rule"]) == (2, "discard")
    assert "withdrawn" in told["expected"]
    withdraw(registry, "hub-r1", on=today(), reason="drift", by="C")
    assert run("calibration", "discard", "hub-r1", "--reason", "x", "--by", "C")[0] == 2
    for words, rule in (
        (("hub-r1", "--reason", " ", "--by", "C"), "discard"),
        (("hub-r1", "--reason", "x", "--by", " "), "names"),
        (("hub-r9", "--reason", "x", "--by", "C"), "missing"),
        (("other-r1", "--reason", "x", "--by", "C"), "missing"),
        (("hub", "--reason", "x", "--by", "C"), "record-id"),
    ):  # fmt: skip
        code, told = run("calibration", "discard", *words)
        assert (code, told["rule"]) == (2, rule)
        assert all(told.values())
    assert len(registry.ledger("hub").entries) == 3
    assert not (registry.folder / "other").exists()


def test_the_same_session_again_is_refused_with_the_reason(
    run: Run, registry: Registry, make_session: Make
) -> None:
    discard(registry, "hub-r1", reason="weights of the other stand", by="C")
    before = files(registry.folder)
    session = make_session()
    for more in ((), ("--dry-run",)):
        code, told = run("calibrate", session, *more)
        assert (code, told["rule"]) == (2, "discarded")
        assert "hub-r1, discarded on" in told["got"]
        assert "by C: weights of the other stand" in told["got"]
        assert "--again" in told["next_step"]
    assert files(registry.folder) == before
    code, told = run("calibrate", session, "--again")
    assert (code, told["record"]["id"], told["record"]["existing"]) == (0, "hub-r2", False)
    # From now on that one is the session's record, with --again or without.
    for more in ((), ("--again",)):
        assert run("calibrate", session, *more)[1]["record"]["id"] == "hub-r2"
    assert approved(registry, "hub-r2")
    assert [row.ok for row in verify_registry(registry)] == [True, True]
    discard_error = run("calibration", "discard", "hub-r2", "--reason", "x", "--by", "C")
    assert discard_error[0] == 2


def test_a_legacy_import_is_discarded_alike(tmp_path: Path, registry: Registry) -> None:
    path = tmp_path / "old.toml"
    path.write_text(GOOD)
    record, _ = import_legacy(path, registry)
    discard(registry, record.id, reason="digits of another machine", by="C")
    with pytest.raises(RegistryError, match="entered before") as caught:
        import_legacy(path, registry)
    assert caught.value.rule == "discarded"
    other, existing = import_legacy(path, registry, again=True)
    assert (other.id != record.id, existing) == (True, False)


def test_the_chart_leaves_a_discarded_session_out(registry: Registry, make_session: Make) -> None:
    assert approved(registry)
    for number in (2, 3):
        values = hub_data(60, number)
        calibrate(make_session(values, name=f"s{number}", date=f"2026-0{number + 1}-05"), registry)
    points = [len(one.points) for one in control_chart(registry, "hub").series]
    discard(registry, "hub-r3", reason="loose cable", by="C")
    chart = control_chart(registry, "hub")
    assert ("hub-r3", "discarded") in chart.left_out
    assert [len(one.points) for one in chart.series] == [count - 1 for count in points]


def _killed(folder: Path, at: int) -> None:
    count, real = [0], os.fsync

    def step(handle: int) -> None:
        count[0] += 1
        if count[0] == at:
            os._exit(9)
        real(handle)

    os.fsync = step
    discard(Registry(folder), "hub-r1", reason="x", by="C")
    os._exit(0)


def test_a_killed_discard_happened_or_did_not(registry: Registry, tmp_path: Path) -> None:
    codes = []
    for at in range(1, 12):
        folder = tmp_path / f"cal-{at}"
        folder.mkdir()
        settled.copy_files(registry.folder / "hub", folder / "hub")
        victim = FORK.Process(target=_killed, args=(folder, at))
        victim.start()
        victim.join()
        copy = Registry(folder)
        assert [row.ok for row in verify_registry(copy)] == [True]
        assert copy.status("hub-r1").state in ("candidate", "discarded")
        codes.append(victim.exitcode)
    assert {0, 9} == set(codes)


def test_a_dry_run_answers_as_the_run_does_and_makes_nothing(
    run: Run, registry: Registry, make_session: Make, tmp_path: Path
) -> None:
    assert approved(registry)
    session = make_session(-hub_data(60, 3), name="turned", date="2026-03-05", phase='"as_found"')
    before, folders = files(tmp_path), sorted(tmp_path.rglob("*"))
    dry_code, dry = run("calibrate", session, "--dry-run")
    assert (files(tmp_path), sorted(tmp_path.rglob("*"))) == (before, folders)
    code, told = run("calibrate", session)
    assert (dry_code, dry["dry_run"], dry["record"]["status"]) == (1, True, "not entered")
    assert (code, told["dry_run"], told["record"]["status"]) == (1, False, "candidate")
    for one in (dry, told):
        del one["dry_run"], one["record"]["status"]
    assert dry == told
    # Of a session that is recorded it says so.
    code, told = run("calibrate", session, "--dry-run")
    assert (told["record"]["existing"], told["record"]["status"]) == (True, "candidate")


def test_a_dry_run_makes_no_registry(make_session: Make, tmp_path: Path) -> None:
    made = control.rehearse(make_session(), Registry(tmp_path / "none"))
    assert (made.record.id, made.existing) == ("hub-r1", False)
    assert made.path == tmp_path / "none" / "hub" / "hub-r1.json"
    assert not (tmp_path / "none").exists()
    with pytest.raises(ConfigError, match="a dry run makes no files"):
        calibrate_command.command(make_session(), tmp_path / "none", dry_run=True, figures=tmp_path / "f")
    assert not (tmp_path / "f").exists()


def test_a_dry_run_in_a_damaged_registry_names_its_places(registry: Registry, make_session: Make) -> None:
    (registry.folder / "hub" / "head.json").write_text("{}")
    before = files(registry.folder)
    with pytest.raises(RegistryError) as caught:
        control.rehearse(make_session(name="other", operator='"D"'), registry)
    assert caught.value.where == str(registry.folder / "hub" / "ledger.jsonl")
    assert files(registry.folder) == before


def test_a_dry_run_finishes_no_write_of_another(registry: Registry, make_session: Make) -> None:
    folder = registry.folder / "hub"
    (folder / ".ledger.jsonl.x.part").write_bytes(b"half")
    before = files(registry.folder)
    made = control.rehearse(make_session(np.round(hub_data(50, 9), 6), name="other"), registry)
    assert made.record.id == "hub-r2"
    assert files(registry.folder) == before
