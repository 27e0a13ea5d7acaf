"""Days and times that cannot be: refused when they are written, and seen by verify."""

from __future__ import annotations

import ctypes
import datetime as dt
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.calibration.control_factory import enter, write_session
from tests.calibration.registry.test_candidate_legacy import GOOD
from tests.trust.forgeries.laboratory import KEYS, event_of, laboratory
from toolkit.calibration.registry import approval, candidate, clock, ledger, life
from toolkit.calibration.registry.approval import approve, discard, withdraw
from toolkit.calibration.registry.candidate import import_legacy
from toolkit.calibration.registry.clock import clock_state
from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, head_bytes, next_line
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import standing
from toolkit.calibration.registry.store import Change
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RegistryError
from toolkit.lab.signatures.issuing import issue

SESSION = dt.date(2025, 3, 10)
TODAY = clock.today()
LATER = TODAY + dt.timedelta(days=3)


@pytest.fixture
def entered(tmp_path: Path) -> Registry:
    registry = Registry(tmp_path / "cal")
    enter(registry, tmp_path / "s", SESSION)
    return registry


def refused(registry: Registry, act: Callable[[], object]) -> RegistryError:
    """Return the error of an act that must change nothing."""
    before = registry.head("cell")
    with pytest.raises(RegistryError) as caught:
        act()
    assert registry.head("cell") == before
    error = caught.value
    assert (error.rule, error.exit_code) == ("time", 2)
    assert all((error.what, error.where, error.got, error.expected, error.next_step))
    return error


def test_a_session_or_a_source_in_the_future_is_not_entered(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    registry.folder.mkdir()
    refused(registry, lambda: candidate.calibrate(write_session(tmp_path / "s", LATER), registry))
    (tmp_path / "old.toml").write_text(GOOD.replace("1999-01-01", LATER.isoformat()))
    refused(registry, lambda: import_legacy(tmp_path / "old.toml", registry))
    assert not list(registry.folder.iterdir())


def test_a_decision_has_its_day_between_its_session_and_today(entered: Registry) -> None:
    def decide(day: dt.date, reason: str | None) -> Callable[[], object]:
        return lambda: approve(
            entered, "cell-r1", in_force_from=SESSION, checked_by="B", known_on=day, reason=reason
        )

    assert "future" in refused(entered, decide(LATER, "planned")).what
    assert "before the session" in refused(entered, decide(SESSION - dt.timedelta(days=1), "late")).what
    assert "dated back" in refused(entered, decide(SESSION, None)).what
    assert "dated back" in refused(entered, decide(SESSION, "  ")).what
    assert approve(
        entered, "cell-r1", in_force_from=SESSION, checked_by="B", known_on=SESSION, reason="on paper"
    ).done
    assert (
        "future" in refused(entered, lambda: withdraw(entered, "cell-r1", on=LATER, reason="x", by="B")).what
    )
    early = SESSION - dt.timedelta(days=1)
    assert (
        "before" in refused(entered, lambda: withdraw(entered, "cell-r1", on=early, reason="x", by="B")).what
    )


def test_a_withdrawal_that_is_dated_back_is_noted(entered: Registry) -> None:
    withdraw(entered, "cell-r1", on=TODAY - dt.timedelta(days=1), reason="dropped", by="B")
    assert entered.ledger("cell").entries[-1].note == "entered 1 day after it became known"


def test_a_withdrawal_of_today_has_no_note(entered: Registry) -> None:
    withdraw(entered, "cell-r1", on=TODAY, reason="dropped", by="B")
    assert entered.ledger("cell").entries[-1].note is None


def test_a_clock_that_was_set_back_writes_nothing(entered: Registry, monkeypatch: pytest.MonkeyPatch) -> None:
    last = entered.ledger("cell").entries[-1].time
    before = (clock.moment(last) - dt.timedelta(seconds=1)).strftime("%Y-%m-%dT%H:%M:%SZ")
    monkeypatch.setattr(approval, "now", lambda: before)
    error = refused(entered, lambda: approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B"))
    assert (error.got, error.expected) == (before, f"a time from {last} on")
    monkeypatch.setattr(approval, "now", lambda: last)
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B").done


def of_a_fast_clock(registry: Registry) -> str:
    """Let the last line be signed in five years; return its time."""
    last = registry.ledger("cell").entries[-1].seq
    late = (dt.datetime.now(tz=dt.UTC) + dt.timedelta(days=5 * 365)).strftime("%Y-%m-%dT%H:%M:%SZ")
    rewrite(registry, lambda seq, event: event.update(time=late) if seq == last else None)
    return late


def test_a_line_after_this_computers_clock_is_told_and_moves_no_day(entered: Registry) -> None:
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B", reason="late").done
    late = of_a_fast_clock(entered)
    assert late in str(entered.ledger("cell").doubt)
    assert entered.ledger("cell").known_on() == TODAY
    (row,) = [row for row in verify_registry(entered) if not row.ok]
    assert row.id == LEDGER
    assert late in str(row.reason)
    assert any(late in text for text in standing(entered, "cell", on=TODAY).since)


def test_a_ledger_of_the_past_is_told_of_nothing(entered: Registry) -> None:
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B").done
    assert entered.ledger("cell").doubt is None
    assert all(row.ok for row in verify_registry(entered))
    assert standing(entered, "cell", on=TODAY).since == ()


def test_a_withdrawal_is_entered_after_a_line_of_a_fast_clock_and_the_ledger_goes_on(
    entered: Registry,
) -> None:
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B", reason="late").done
    of_a_fast_clock(entered)
    error = refused(
        entered,
        lambda: approve(
            entered, "cell-r1", in_force_from=SESSION, checked_by="B", reason="x", recall="1 year"
        ),
    )
    assert "before that of the entry before it" in error.what
    withdraw(entered, "cell-r1", on=TODAY, reason="its line is of a fast clock", by="B")
    assert entered.status("cell-r1").state == "withdrawn"
    assert entered.ledger("cell").damage is None
    assert entered.ledger("cell").doubt is not None


def test_an_approval_of_a_fast_clock_is_withdrawn_on_the_day_that_it_is_and_leaves_no_day(
    entered: Registry, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    # A fast clock is wrong in both: the time of the line and the day of the decision.
    late = dt.datetime.now(tz=dt.UTC) + dt.timedelta(days=100)
    with monkeypatch.context() as fast:
        fast.setattr(approval, "now", lambda: late.strftime("%Y-%m-%dT%H:%M:%SZ"))
        fast.setattr(life, "check_begun", lambda *_words: None)
        assert approve(
            entered, "cell-r1", in_force_from=SESSION, checked_by="B", reason="late", known_on=late.date()
        ).done
    assert entered.ledger("cell").known_on() == late.date()
    refused(entered, lambda: withdraw(entered, "cell-r1", on=late.date(), reason="fast clock", by="B"))
    withdraw(entered, "cell-r1", on=TODAY, reason="fast clock", by="B")
    assert entered.status("cell-r1").state == "withdrawn"
    assert entered.id_in_force("cell", on=TODAY) is None
    assert entered.ledger("cell").known_on() == TODAY
    assert {row.id for row in verify_registry(entered) if not row.ok} == {LEDGER}
    enter(entered, tmp_path / "s2", SESSION + dt.timedelta(days=1))
    assert approve(entered, "cell-r2", in_force_from=SESSION, checked_by="B", reason="late").done


def test_a_candidate_of_a_fast_clock_is_discarded_and_the_ledger_goes_on(
    entered: Registry, tmp_path: Path
) -> None:
    late = of_a_fast_clock(entered)

    def enter_another(folder: str) -> None:
        enter(entered, tmp_path / folder, SESSION + dt.timedelta(days=1))

    error = refused(entered, lambda: enter_another("s2"))
    assert error.expected == f"a time from {late} on"
    assert "discard the candidate that it is about" in str(error.next_step)
    discard(entered, "cell-r1", reason="its line is of a fast clock", by="B")
    assert entered.status("cell-r1").state == "discarded"
    enter_another("s3")
    assert approve(entered, "cell-r2", in_force_from=SESSION, checked_by="B", reason="late").done
    assert entered.ledger("cell").damage is None
    assert entered.id_in_force("cell", on=TODAY) == "cell-r2"


@pytest.mark.parametrize("end", ["discard", "withdraw"])
def test_a_candidate_whose_session_is_of_a_fast_clock_can_be_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str
) -> None:
    registry = Registry(tmp_path / "cal")
    late = dt.datetime.now(tz=dt.UTC) + dt.timedelta(days=100)
    with monkeypatch.context() as fast:
        fast.setattr(candidate, "now", lambda: late.strftime("%Y-%m-%dT%H:%M:%SZ"))
        fast.setattr(candidate, "check_begun", lambda *_words: None)
        enter(registry, tmp_path / "s", late.date())
    # Its session has not begun: no day of a decision lies after it yet.
    error = refused(
        registry, lambda: approve(registry, "cell-r1", in_force_from=TODAY, checked_by="B", reason="x")
    )
    assert "before the session" in error.what
    if end == "discard":
        discard(registry, "cell-r1", reason="fast clock", by="B")
    else:
        withdraw(registry, "cell-r1", on=TODAY, reason="fast clock", by="B")
    assert registry.status("cell-r1").ended
    enter(registry, tmp_path / "s2", SESSION)
    assert approve(registry, "cell-r2", in_force_from=SESSION, checked_by="B", reason="late").done
    assert [row.id for row in verify_registry(registry) if not row.ok] == [LEDGER]


def test_a_document_of_a_fast_clock_keeps_nothing_out(entered: Registry, tmp_path: Path) -> None:
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B", reason="late").done
    document = {"name": "report T", "content": "c" * 64, "tested": SESSION.isoformat()}

    def release() -> None:
        issue(entered, "cell-r1", document, decided=entered.ledger("cell").decided)

    release()
    late = of_a_fast_clock(entered)
    release()
    enter(entered, tmp_path / "s2", SESSION + dt.timedelta(days=1))
    assert approve(entered, "cell-r2", in_force_from=SESSION, checked_by="B", reason="late").done
    assert entered.ledger("cell").damage is None
    assert entered.id_in_force("cell", on=TODAY) == "cell-r2"
    assert late in str(entered.ledger("cell").doubt)


def test_a_clock_that_was_set_back_writes_nothing_after_a_document_either(
    entered: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    issue(entered, "cell-r1", {"name": "report T"}, decided=entered.ledger("cell").decided)
    last = entered.ledger("cell").entries[-1].time
    before = (clock.moment(last) - dt.timedelta(seconds=1)).strftime("%Y-%m-%dT%H:%M:%SZ")
    monkeypatch.setattr(approval, "now", lambda: before)
    refused(entered, lambda: approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B"))


def test_a_clock_that_was_set_back_brings_no_withdrawn_record_back(
    entered: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B").done
    withdraw(entered, "cell-r1", on=TODAY, reason="dropped", by="B")
    before = TODAY - dt.timedelta(days=30)
    for module in (clock, ledger, approval):
        monkeypatch.setattr(module, "today", lambda: before)
    assert entered.status("cell-r1").state == "withdrawn"
    assert entered.statuses("cell")["cell-r1"].state == "withdrawn"
    assert entered.id_in_force("cell", on=TODAY) is None
    with pytest.raises(RegistryError, match="no calibration of cell is in force"):
        entered.in_force("cell", on=TODAY)
    # Who asks for what was known on a day is answered for that day.
    assert entered.status("cell-r1", known_at=before).state == "approved"


def rewrite(registry: Registry, change: Callable[[int, dict[str, object]], None]) -> None:
    """Write an instrument's ledger anew, its chain intact."""
    folder = registry.folder / "cell"
    lines, prev = b"", START
    bodies = [json.loads(line) for line in (folder / LEDGER).read_text().splitlines()]
    for seq, body in enumerate(bodies, start=1):
        event = {key: value for key, value in body.items() if key not in ("seq", "prev", "sha256")}
        change(seq, event)
        line, prev = next_line(seq, prev, event)
        lines += line
    (folder / LEDGER).write_bytes(lines)
    (folder / HEAD).write_bytes(head_bytes(len(bodies), prev))


@pytest.mark.parametrize(
    ("line", "key", "value", "rule", "words"),
    [
        (1, "time", "2999-01-01T00:00:00Z", "ledger", "a clock was set back"),
        (1, "time", "2025-03-09T09:59:59Z", "time", "lies after its entry"),
        (2, "known_on", "2025-03-09", "time", "before the session"),
        (2, "known_on", "2999-01-01", "time", "by a decision of 2999-01-01"),
    ],
)
def test_verify_sees_what_was_written_so(
    entered: Registry, line: int, key: str, value: str, rule: str, words: str
) -> None:
    assert approve(entered, "cell-r1", in_force_from=SESSION, checked_by="B").done
    assert all(one.ok for one in verify_registry(entered))

    def change(seq: int, event: dict[str, object]) -> None:
        if seq == line:
            event[key] = value

    rewrite(entered, change)
    (bad,) = [one for one in verify_registry(entered) if not one.ok]
    assert (bad.id, (bad.reason or "").split(":")[0]) == ("cell-r1", rule)
    assert words in (bad.reason or "")


def test_no_laboratory_is_refused_for_its_time_zone() -> None:
    # At 10:00 UTC the next day begins on the Line Islands, UTC+14.
    noon = dt.datetime(2026, 3, 1, 10, 0, tzinfo=dt.UTC)
    assert clock.begun(dt.date(2026, 3, 2), noon)
    assert not clock.begun(dt.date(2026, 3, 2), noon - dt.timedelta(seconds=1))
    assert not clock.begun(dt.date(2026, 3, 3), noon)


def test_the_projects_ledgers_are_in_order() -> None:
    project = Registry(Path(__file__).resolve().parents[3] / "calibrations")
    assert all(row.ok for row in verify_registry(project))


def test_an_entry_tells_the_state_of_the_clock_and_waits_for_nobody(
    entered: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert entered.ledger("cell").entries[-1].clock in ("synchronised", "not synchronised", "unknown")
    for answer, state in ((0, "synchronised"), (5, "not synchronised"), (-1, "unknown"), (None, "unknown")):
        library = (
            SimpleNamespace() if answer is None else SimpleNamespace(adjtimex=lambda _buffer, a=answer: a)
        )
        monkeypatch.setattr(ctypes, "CDLL", lambda *_words, library=library, **_more: library)
        assert clock_state() == state
        monkeypatch.undo()


def test_no_entry_lies_before_the_newest_version_of_the_people() -> None:
    event = event_of("entered", "cell-r1", "2025-11-30T23:59:59Z", by="Carl Example")
    with laboratory() as home:
        registry = Registry(home / "calibrations", signers=[KEYS["carl"]])
        with pytest.raises(RegistryError) as refusal:
            registry.commit("cell", lambda _ledger: Change(files={}, event=event))
    assert refusal.value.rule == "time"
    assert (refusal.value.got, "2025-12-01T00:00:00Z" in str(refusal.value.expected)) == (event["time"], True)
