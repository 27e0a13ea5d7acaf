"""As found and as left: the record in force is held against the rows before anything is adjusted."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from tests.calibration.control_factory import enter, put_in_force
from toolkit.calibration.control.as_found import as_found, as_found_before, as_found_history, in_use_before
from toolkit.calibration.registry.approval import withdraw
from toolkit.calibration.registry.registry import Registry


@pytest.fixture
def used(tmp_path: Path) -> Registry:
    """cell-r1 of 2024-01-10, in force from that day."""
    registry = Registry(tmp_path / "cal")
    put_in_force(registry, enter(registry, tmp_path / "s1", dt.date(2024, 1, 10)))
    return registry


def test_a_span_that_grew_is_found_with_its_error(used: Registry, tmp_path: Path) -> None:
    # The span grew by 0.2 %: the old record reads 1002 N for 1000 N; the tolerance is 0.1 % of 1000 N.
    made = enter(used, tmp_path / "s2", dt.date(2025, 1, 10), span=1.002, phase="as_found")
    found = as_found(used, made.record)
    assert (found.record, found.since, found.session_record) == ("cell-r1", dt.date(2024, 1, 10), "cell-r2")
    one = found.loads[0]
    assert one.max_error == pytest.approx(2.0, abs=2e-3)
    assert one.max_percent_fs == pytest.approx(0.2, abs=2e-4)
    assert (one.tolerance, one.full_scale, one.within) == (1.0, 1000.0, False)
    assert one.reference[one.worst_row - 1] == 1000.0
    assert len(one.error) == 30
    assert found.worst_share == pytest.approx(2.0, abs=2e-3)
    assert [finding.rule for finding in made.findings if finding.rule == "as-found"] == ["as-found"]


def test_within_tolerance_there_is_no_finding(used: Registry, tmp_path: Path) -> None:
    made = enter(used, tmp_path / "s2", dt.date(2025, 1, 10), span=1.0008, phase="as_found")
    assert as_found(used, made.record).within is True
    assert [finding for finding in made.findings if finding.rule == "as-found"] == []


def test_only_an_as_found_session_is_judged_so(used: Registry, tmp_path: Path) -> None:
    made = enter(used, tmp_path / "s2", dt.date(2025, 1, 10), span=1.01)
    assert [finding for finding in made.findings if finding.rule == "as-found"] == []


def test_the_first_session_has_nothing_to_be_held_against(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    made = enter(registry, tmp_path / "s1", dt.date(2024, 1, 10), phase="as_found")
    assert as_found(registry, made.record).within is None
    told = [finding for finding in made.findings if finding.rule == "as-found"]
    assert [finding.level for finding in told] == ["note"]


def test_a_record_that_cannot_be_applied_is_told(used: Registry, tmp_path: Path) -> None:
    made = enter(used, tmp_path / "s2", dt.date(2025, 1, 10), phase="as_found", zero="included")
    found = as_found(used, made.record)
    assert found.within is None
    assert found.reason is not None
    assert "tared" in found.reason
    assert [f.level for f in made.findings if f.rule == "as-found"] == ["warning"]


def test_the_record_of_the_day_itself_is_not_the_one_that_was_in_use(used: Registry, tmp_path: Path) -> None:
    # Adjusted and put in force on the very day of the as-found session.
    day = dt.date(2025, 1, 10)
    found = enter(used, tmp_path / "s2", day, span=1.002, phase="as_found")
    put_in_force(used, enter(used, tmp_path / "s3", day, span=1.003, phase="as_left"))
    assert as_found(used, found.record).record == "cell-r1"
    before = in_use_before(used, "cell", day + dt.timedelta(days=1))
    assert before is not None
    assert before.id == "cell-r3"


def test_a_later_withdrawal_does_not_change_what_was_in_force_then(used: Registry, tmp_path: Path) -> None:
    made = enter(used, tmp_path / "s2", dt.date(2025, 1, 10), phase="as_found")
    withdraw(used, "cell-r1", on=dt.date(2025, 6, 1), reason="the reference was wrong", by="B")
    assert as_found(used, made.record).record == "cell-r1"
    assert in_use_before(used, "cell", dt.date(2025, 7, 1)) is None


def test_as_left_belongs_to_the_as_found_before_it(used: Registry, tmp_path: Path) -> None:
    enter(used, tmp_path / "s2", dt.date(2025, 1, 10), span=1.002, phase="as_found")
    left = enter(used, tmp_path / "s3", dt.date(2025, 1, 11), phase="as_left").record
    found = as_found_before(used, left)
    assert found is not None
    assert found.session_record == "cell-r2"
    # A second as-left session without its own as-found one has none: the first has taken it.
    assert (
        as_found_before(used, enter(used, tmp_path / "s4", dt.date(2026, 1, 11), phase="as_left").record)
        is None
    )


def test_a_history_of_results_without_those_withdrawn(used: Registry, tmp_path: Path) -> None:
    for at, (year, span) in enumerate(((2024, 1.0005), (2025, 1.0009), (2026, 1.004))):
        enter(used, tmp_path / f"y{at}", dt.date(year, 1, 20), span=span, phase="as_found")
    found = as_found_history(used, "cell")
    assert [(one.date.year, one.within) for one in found] == [(2024, True), (2025, True), (2026, False)]
    withdraw(used, found[1].session_record, on=dt.date(2026, 2, 1), reason="a wrong weight", by="B")
    assert [one.date.year for one in as_found_history(used, "cell")] == [2024, 2026]


@pytest.mark.campaign("sessions of years: what was found by one session is told in every run")
def test_the_record_of_each_session_is_that_of_the_whole_ledger(used: Registry, tmp_path: Path) -> None:
    # By the rule's words, approval for approval: the newest first day, the last entry among equals, known
    # before later told, nothing void, nothing of the session's own day or later.
    for at in range(2, 8):
        entered = enter(used, tmp_path / f"s{at}", dt.date(2024, at, 10), span=1 + 1e-4 * at)
        if at != 4:
            put_in_force(used, entered)
    withdraw(used, "cell-r3", on=dt.date(2024, 5, 20), reason="x", by="B")
    ledger = used.ledger("cell")
    for day in (dt.date(2024, 1, 1) + dt.timedelta(days=3 * n) for n in range(90)):
        expected = []
        for name in ledger.entered():
            status = used.status(name, known_at=day)
            if status.void_from is not None and day >= status.void_from:
                continue
            for entry in ledger.of(name):
                if entry.event == "approved" and entry.since is not None and entry.since <= day:
                    known = entry.known_on is not None and entry.known_on <= day
                    expected.append((known, entry.since, entry.seq, name))
        earlier = [rank for rank in expected if dt.date.fromisoformat(used.load(rank[3]).date) < day]
        before = in_use_before(used, "cell", day)
        assert (None if before is None else before.id) == (max(earlier)[3] if earlier else None), day


def test_the_history_refits_what_it_uses_alone(
    used: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from toolkit.calibration.control import as_found as module
    from toolkit.errors import RecordError

    enter(used, tmp_path / "s2", dt.date(2025, 1, 10), phase="as_found")
    enter(used, tmp_path / "s3", dt.date(2025, 2, 10))
    refitted: list[str] = []
    load_many = module.load_many
    monkeypatch.setattr(
        module,
        "load_many",
        lambda folder, ids, ledger: refitted.extend(ids) or load_many(folder, ids, ledger),
    )
    assert len(as_found_history(used, "cell")) == 1
    assert refitted == ["cell-r2"]
    # A record whose bytes were changed is never passed over by what it now says.
    path = used.folder / "cell" / "cell-r2.json"
    path.write_text(path.read_text().replace("as_found", "as_left_"))
    with pytest.raises(RecordError):
        as_found_history(used, "cell")
