"""Recall intervals in the ledger, due dates, and the drift that recommends another interval."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest

from tests.calibration.control_factory import enter, put_in_force
from toolkit.calibration.control.as_found import AsFound, AsFoundLoad
from toolkit.calibration.control.recall import due_findings, due_of, recommend
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.ledger import parse_ledger
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.status import parse_interval
from toolkit.errors import RegistryError

DAY = dt.date(2024, 2, 29)


@pytest.fixture
def used(tmp_path: Path) -> Registry:
    registry = Registry(tmp_path / "cal")
    put_in_force(registry, enter(registry, tmp_path / "s1", DAY), recall="12 Months")
    return registry


@pytest.mark.parametrize(
    ("text", "day", "due"),
    [
        ("12 months", DAY, dt.date(2025, 2, 28)),
        ("1 year", DAY, dt.date(2025, 2, 28)),
        ("1 month", dt.date(2023, 12, 31), dt.date(2024, 1, 31)),
        ("2 months", dt.date(2023, 12, 31), DAY),
        ("90 days", DAY, dt.date(2024, 5, 29)),
        ("52 weeks", DAY, dt.date(2025, 2, 27)),
    ],
)
def test_an_interval_by_the_calendar(text: str, day: dt.date, due: dt.date) -> None:
    assert parse_interval(text).after(day) == due


@pytest.mark.parametrize(
    "text", ["", "12", "months", "0 months", "-1 year", "1.5 years", "51 years", "١ year x", "9999 years"]
)
def test_what_is_no_interval_is_refused(text: str, used: Registry) -> None:
    before = (used.folder / "cell" / "ledger.jsonl").read_bytes()
    with pytest.raises(RegistryError) as caught:
        approve(used, "cell-r1", in_force_from=DAY, checked_by="B", reason="x", recall=text)
    assert caught.value.rule == "recall"
    assert (used.folder / "cell" / "ledger.jsonl").read_bytes() == before


def test_due_is_the_session_date_plus_the_interval(used: Registry) -> None:
    assert used.status("cell-r1").recall == "12 months"
    due = due_of(used, "cell", dt.date(2025, 2, 28))
    assert (due.due, due.days_left, due.overdue) == (dt.date(2025, 2, 28), 0, False)
    assert due_findings(due) == ()
    late = due_of(used, "cell", dt.date(2025, 3, 1))
    assert (late.days_left, late.overdue) == (-1, True)
    assert [one.rule for one in due_findings(late)] == ["overdue"]
    assert "1 day ago" in due_findings(late)[0].message


def test_the_interval_can_be_set_anew_with_a_reason(used: Registry) -> None:
    with pytest.raises(RegistryError):
        approve(used, "cell-r1", in_force_from=DAY, checked_by="B", recall="6 months")
    approve(used, "cell-r1", in_force_from=DAY, checked_by="B", recall="6 months", reason="drift")
    assert used.status("cell-r1").recall == "6 months"
    with pytest.raises(RegistryError):
        approve(used, "cell-r1", in_force_from=DAY, checked_by="B", recall="6 months", reason="again")


def test_without_an_interval_nobody_can_say(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    put_in_force(registry, enter(registry, tmp_path / "s1", DAY))
    due = due_of(registry, "cell", DAY)
    assert (due.recall, due.due, due.overdue) == (None, None, False)
    assert [(one.rule, one.level) for one in due_findings(due)] == [("recall-unknown", "note")]


def test_a_ledger_of_the_time_before_recall_intervals_stays_readable() -> None:
    # A chain as it was written then; its two hashes are part of the project's registry.
    folder = Path(__file__).resolve().parents[3] / "calibrations" / "m15-virtual"
    lines, head = (folder / "ledger.jsonl").read_bytes(), (folder / "head.json").read_bytes()
    assert b"recall" not in b"".join(lines.splitlines(keepends=True)[:2])
    ledger = parse_ledger(lines, head)
    assert ledger.damage is None
    assert ledger.entries[1].recall is None


def found(day: dt.date, since: dt.date, share: float) -> AsFound:
    """Return an as-found result whose largest error is a share of its tolerance of 2 N."""
    load = AsFoundLoad(
        load="FY", unit="N", reference=(1000.0,), error=(2 * share,), tolerance=2.0, full_scale=1000.0,
        max_error=2 * share, max_percent_fs=0.2 * share, worst_row=1,
    )  # fmt: skip
    return AsFound(
        instrument="cell", date=day, session_record="cell-r9", record="cell-r1", record_sha256="0" * 64,
        since=since, loads=(load,), reason=None,
    )  # fmt: skip


def test_the_recommended_interval_by_hand() -> None:
    # Shares of 0.4 in 400 days and -0.4 in 200 days: the faster one reaches 0.8 after 400 days.
    first, second, third = dt.date(2020, 1, 1), dt.date(2021, 2, 4), dt.date(2021, 8, 23)
    history = [found(second, first, 0.4), found(third, second, -0.4)]
    told = recommend(history, present_days=None)
    assert told.days == 400
    assert told.drift_per_year == pytest.approx(0.4 / 200 * 365.25)
    assert recommend(history, present_days=365).days == 400
    # One step is kept between half and one and a half of the interval in use.
    assert recommend(history, present_days=100).days == 150
    assert recommend(history, present_days=1000).days == 500
    assert "kept between" in recommend(history, present_days=100).reason


def test_one_result_is_no_trend() -> None:
    told = recommend([found(dt.date(2021, 1, 1), dt.date(2020, 1, 1), 0.4)], present_days=365)
    assert (told.days, told.results) == (None, 1)
    assert "at least 2" in told.reason
