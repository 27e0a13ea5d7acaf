"""Which record may make a number of a test, and what stands against every other one."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.control_factory import enter, put_in_force
from toolkit.calibration.records.use import CalibrationUse, mark_of
from toolkit.calibration.registry.approval import approve, discard, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import standing
from toolkit.errors import RecordError

Sessions = Callable[..., Path]
MARCH, MAY = date(2026, 3, 1), date(2026, 5, 10)


@pytest.fixture
def two(registry: Registry, make_session: Sessions) -> Registry:
    """hub-r1 in force from 2026-02-01, hub-r2 from 2026-04-01, each decided on its day."""
    calibrate(make_session(hub_data(60, 3), name="later"), registry)
    for record_id, day in (("hub-r1", date(2026, 2, 1)), ("hub-r2", date(2026, 4, 1))):
        assert approve(
            registry, record_id, in_force_from=day, checked_by="B", known_on=day, reason="paper of that day"
        ).done
    return registry


def reasons(registry: Registry, named: str | None, on: date | None, known: date | None = None) -> list[str]:
    found = standing(registry, "hub", on=on, known_at=known, named=named)
    use = found.use(draft=True)
    assert use.draft == bool(found.reasons)
    assert list(use.draft_reasons) == [one.text for one in found.reasons]
    if not found.reasons:
        assert found.use(draft=False) == use
        return []
    with pytest.raises(RecordError) as caught:
        found.use(draft=False)
    assert caught.value.rule == "not-in-force"
    assert all(one.text in str(caught.value) and one.next_step in str(caught.value) for one in found.reasons)
    return list(use.draft_reasons)


def test_the_record_in_force_may_make_a_number_named_or_not(two: Registry) -> None:
    for named in (None, "hub-r2"):
        assert reasons(two, named, MAY) == []
        use = standing(two, "hub", on=MAY, named=named).use(draft=True)
        assert (use.id, use.status, use.mark, use.word) == ("hub-r2", "verified", None, None)
    for day in (date(2026, 2, 1), MARCH, date(2026, 4, 1), MAY):
        assert two.id_in_force("hub", on=day) == two.in_force("hub", on=day).id
    assert two.id_in_force("hub", on=date(2026, 1, 31)) is None


def test_a_candidate_is_refused_with_the_gates_that_it_fails(two: Registry, make_session: Sessions) -> None:
    turn = np.where(np.arange(hub_data(1, 1).shape[1]) == 2, -1.0, 1.0)  # E5, the third indication
    session = make_session(hub_data(60, 7) * turn, check_rows=hub_data(9, 8) * turn, name="turned")
    assert calibrate(session, two).record.id == "hub-r3"
    (told,) = reasons(two, "hub-r3", MAY)
    assert "sign (FY, E5; MZ, E5" in told
    use = standing(two, "hub", on=MAY, named="hub-r3").use(draft=True)
    assert use.mark is not None
    assert use.mark.startswith("DRAFT, NOT APPROVED: hub-r3")
    assert use.status.startswith("not approved: ")


def test_a_candidate_whose_gates_hold_waits_for_its_approval(two: Registry, make_session: Sessions) -> None:
    calibrate(make_session(hub_data(60, 9), name="sound"), two)
    (told,) = reasons(two, "hub-r3", MAY)
    assert "no gate fails" in told
    (step,) = standing(two, "hub", on=MAY, named="hub-r3").reasons
    assert "toolkit calibration approve hub-r3" in step.next_step


def test_every_day_has_its_own_reason(two: Registry) -> None:
    assert reasons(two, "hub-r2", MARCH) == ["not in force until 2026-04-01"]
    assert reasons(two, "hub-r1", MAY) == ["superseded by hub-r2, in force from 2026-04-01"]
    assert reasons(two, "hub-r2", None) == ["the test has no date: which record was in force cannot be told"]
    assert len(reasons(two, "hub-r1", date(2026, 1, 31))) == 1


def test_a_test_of_tomorrow_has_no_record_yet(two: Registry) -> None:
    (told,) = reasons(two, "hub-r2", dt.date.today() + dt.timedelta(days=40))  # noqa: DTZ011
    assert "in the future" in told


def test_a_discarded_record_makes_no_draft(two: Registry, make_session: Sessions) -> None:
    calibrate(make_session(hub_data(60, 9), name="sound"), two)
    discard(two, "hub-r3", reason="wrong cell mounted", by="C")
    held = standing(two, "hub", on=MAY, named="hub-r3")
    (reason,) = held.reasons
    assert reason.text.startswith("discarded on ")
    assert reason.text.endswith(": wrong cell mounted")
    with pytest.raises(RecordError) as caught:
        held.use(draft=True)
    assert "--draft" not in str(caught.value)


def test_an_approval_of_later_does_not_count_where_an_earlier_one_was_known(two: Registry) -> None:
    (told,) = reasons(two, "hub-r2", MAY, known=date(2026, 3, 15))
    assert told == "approved only after 2026-03-15: hub-r1 was in force then"


def test_a_withdrawal_counts_from_its_day_and_for_void_days_alone(two: Registry) -> None:
    known = date(2026, 6, 1)
    withdraw(two, "hub-r2", on=known, void_from=date(2026, 5, 1), reason="cell overloaded", by="B")
    assert reasons(two, "hub-r2", MAY, known) == [
        "withdrawn on 2026-06-01, void from 2026-05-01: cell overloaded"
    ]
    assert reasons(two, "hub-r2", date(2026, 4, 30), known) == []
    before = standing(two, "hub", on=MAY, known_at=date(2026, 5, 31))
    assert before.record.id == "hub-r2"
    assert before.reasons == ()
    # Who judges by an earlier day is told what became known since, and every page says it.
    assert before.since == ("withdrawn on 2026-06-01, void from 2026-05-01: cell overloaded",)
    assert str(before.use(draft=False).mark).startswith("KNOWN SINCE: hub-r2: withdrawn")


def test_a_record_of_another_machine_is_none_of_this_one(two: Registry) -> None:
    found = standing(two, "other", on=MAY, named="hub-r2")
    assert [one.text for one in found.reasons] == ["it is a record of hub, the test is of other"]


def test_a_record_is_expired_after_its_recall_interval(tmp_path: Path) -> None:
    registry = Registry(tmp_path / "cal")
    put_in_force(registry, enter(registry, tmp_path / "s1", date(2024, 2, 29)), recall="12 months")
    due = date(2025, 2, 28)
    assert standing(registry, "cell", on=due).reasons == ()
    late = standing(registry, "cell", on=due + dt.timedelta(days=1))
    assert [one.text for one in late.reasons] == [
        "expired: its recall interval of 12 months ended on 2025-02-28"
    ]
    # It is not void: an audit still finds it.
    assert registry.in_force("cell", on=due + dt.timedelta(days=1)).id == "cell-r1"
    done = approve(
        registry, "cell-r1", in_force_from=date(2024, 2, 29), checked_by="B", recall="18 months",
        reason="as found after a year: within tolerance",
    )  # fmt: skip
    assert done.done
    assert standing(registry, "cell", on=due + dt.timedelta(days=1)).reasons == ()


def test_a_mark_names_every_record_in_one_line() -> None:
    draft = CalibrationUse(id="a-r2", sha256="", unverified=False, draft_reasons=("x" * 500,))
    legacy = CalibrationUse(id="b-r1", sha256="", unverified=True)
    assert mark_of(()) is None
    assert mark_of((CalibrationUse(id="a-r1", sha256="", unverified=False),)) is None
    assert len(str(draft.mark)) <= 130
    assert mark_of((legacy,)) == "UNVERIFIED CALIBRATION: b-r1"
    both = str(mark_of((draft, legacy, CalibrationUse(**{**_fields(draft), "id": "c-r3"}))))
    assert both == "DRAFT, NOT APPROVED: a-r2, c-r3 - UNVERIFIED CALIBRATION: b-r1"
    assert legacy.status == "unverified (legacy import)"


def _fields(use: CalibrationUse) -> dict[str, object]:
    return {"id": use.id, "sha256": "", "unverified": False, "draft_reasons": use.draft_reasons}


def test_an_approval_after_the_day_of_knowledge_serves_where_no_earlier_one_does_and_says_so(
    two: Registry,
) -> None:
    early = date(2026, 1, 15)  # before the first decision
    late = standing(two, "hub", on=MARCH, known_at=early)
    assert late.record.id == "hub-r1"
    assert any("approved on 2026-02-01, after 2026-01-15" in text for text in late.since)
    known = standing(two, "hub", on=MARCH, known_at=MARCH)
    assert not any("approved on" in text for text in known.since)
    assert two.status("hub-r1", known_at=early).approved_later == date(2026, 2, 1)
    assert two.status("hub-r1", known_at=date(2026, 2, 1)).approved_later is None
