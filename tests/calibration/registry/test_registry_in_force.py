"""Which record applies to a test's day, as known on another day; approval and withdrawal."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.clock import today
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import withdrawal
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RecordError, RegistryError
from toolkit.lab.records.registry_answer import void_day

PROJECT = Registry(Path(__file__).resolve().parents[3] / "calibrations")


@pytest.fixture
def two(registry: Registry, make_session: Callable[..., Path]) -> Registry:
    """hub-r1 in force from 2026-02-01, hub-r2 from 2026-04-01, each decided on its day."""
    calibrate(make_session(hub_data(60, 3), name="later"), registry)
    for record_id, day in (("hub-r1", date(2026, 2, 1)), ("hub-r2", date(2026, 4, 1))):
        done = approve(registry, record_id, in_force_from=day, checked_by="B", known_on=day, reason="late")
        assert done.done, done.failed
    return registry


def test_the_newest_record_not_after_the_day(two: Registry) -> None:
    assert two.in_force("hub", on=date(2026, 2, 1)).id == "hub-r1"
    assert two.in_force("hub", on=date(2026, 3, 31)).id == "hub-r1"
    assert two.in_force("hub", on=date(2026, 4, 1)).id == "hub-r2"


def test_before_every_record_is_an_error_that_lists_the_candidates(two: Registry) -> None:
    with pytest.raises(RegistryError) as caught:
        two.in_force("hub", on=date(2026, 1, 31))
    assert "hub-r1 (in force from 2026-02-01)" in str(caught.value)


def test_an_instrument_without_records_is_refused_with_those_that_have_some(
    two: Registry, tmp_path: Path
) -> None:
    with pytest.raises(RegistryError) as misspelt:
        two.in_force("hubb", on=date(2026, 3, 1))
    assert misspelt.value.rule == "no-record-in-force"
    assert "no record of hubb" in str(misspelt.value.got)
    assert str(misspelt.value.expected).startswith("an instrument with records: hub;")
    assert "did you mean 'hub'" in str(misspelt.value.next_step)
    with pytest.raises(RegistryError) as empty:
        Registry(tmp_path / "empty").in_force("hub", on=date(2026, 3, 1))
    assert "approved record" in str(empty.value.expected)
    assert "did you mean" not in str(empty.value.next_step)


def test_a_withdrawal_counts_from_the_day_it_became_known(two: Registry) -> None:
    withdraw(two, "hub-r2", on=date(2026, 6, 1), void_from=date(2026, 5, 1), reason="cell overloaded", by="B")
    day = date(2026, 5, 10)
    assert two.in_force("hub", on=day, known_at=date(2026, 5, 31)).id == "hub-r2"
    assert two.in_force("hub", on=day, known_at=date(2026, 6, 1)).id == "hub-r1"
    assert two.in_force("hub", on=date(2026, 4, 30), known_at=date(2026, 6, 1)).id == "hub-r2"
    status = two.status("hub-r2", known_at=date(2026, 6, 1))
    assert (status.state, status.void_from, status.void_always) == ("withdrawn", date(2026, 5, 1), False)
    assert two.status("hub-r2", known_at=date(2026, 5, 31)).state == "approved"


def test_without_a_first_void_day_a_record_is_void_on_every_day(two: Registry) -> None:
    withdraw(two, "hub-r1", on=date(2026, 6, 1), reason="wrong sign", by="B")
    assert two.status("hub-r1").void_always
    with pytest.raises(RegistryError):
        two.in_force("hub", on=date(2026, 3, 1), known_at=date(2026, 6, 1))
    assert two.in_force("hub", on=date(2026, 3, 1), known_at=date(2026, 5, 1)).id == "hub-r1"


def test_a_repair_in_the_past_is_known_from_its_own_day(
    two: Registry, make_session: Callable[..., Path]
) -> None:
    calibrate(make_session(hub_data(60, 5), name="repair"), two)
    with pytest.raises(RegistryError) as caught:
        approve(two, "hub-r3", in_force_from=date(2025, 1, 1), checked_by="B")
    assert "reason" in str(caught.value)
    approve(
        two, "hub-r3", in_force_from=date(2026, 1, 1), checked_by="B", reason="repairs the tests since",
        known_on=date(2026, 7, 1),
    )  # fmt: skip
    withdraw(two, "hub-r1", on=date(2026, 7, 1), reason="wrong sign", by="B")
    assert two.in_force("hub", on=date(2026, 3, 1), known_at=date(2026, 7, 1)).id == "hub-r3"
    assert two.in_force("hub", on=date(2026, 3, 1), known_at=date(2026, 6, 30)).id == "hub-r1"


def test_names_must_differ_and_a_decision_is_made_once(registry: Registry) -> None:
    day = date(2026, 2, 1)
    for checked, approved in (("Operator  ONE", None), ("B", "b"), ("B", "operator one"), ("", None)):
        with pytest.raises(RegistryError) as caught:
            approve(registry, "hub-r1", in_force_from=day, checked_by=checked, approved_by=approved)
        assert caught.value.rule == "names"
    approve(registry, "hub-r1", in_force_from=day, checked_by="B", approved_by="C")
    with pytest.raises(RegistryError):
        approve(registry, "hub-r1", in_force_from=day, checked_by="B")
    with pytest.raises(RegistryError) as caught:
        withdraw(registry, "hub-r1", on=day, reason="known before it was approved", by="B")
    assert caught.value.rule == "time"
    withdraw(registry, "hub-r1", on=today(), reason="x", by="B")
    for again in (
        lambda: withdraw(registry, "hub-r1", on=day, reason="x", by="B"),
        lambda: approve(registry, "hub-r1", in_force_from=day, checked_by="B", reason="y"),
        lambda: withdraw(registry, "hub-r9", on=day, reason="x", by="B"),
        lambda: withdraw(registry, "other-r1", on=day, reason="x", by="B"),
    ):
        with pytest.raises(RegistryError):
            again()
    with pytest.raises(RecordError):
        registry.load("hub-r9")


def test_a_flipped_sign_blocks_and_changes_nothing(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    approve(registry, "hub-r1", in_force_from=date(2026, 2, 1), checked_by="B")
    flipped, check = hub_data(60, 4), hub_data(9, 30)
    flipped[:, 2] *= -1
    check[:, 2] *= -1
    made = calibrate(make_session(flipped, check_rows=check, name="flipped"), registry)
    # The polarity readings, taken apart from the rows, know better too.
    assert {f.rule for f in made.findings} == {"sign", "polarity-reading"}
    head = registry.head("hub")
    decision = approve(registry, "hub-r2", in_force_from=date(2026, 3, 1), checked_by="B")
    assert not decision.done
    assert {(one.rule, one.where) for one in decision.failed if one.rule != "polarity-reading"} == {
        ("sign", "FY, E5"), ("sign", "MZ, E5"), ("sign", "MX, E5"),
    }  # fmt: skip
    assert registry.head("hub") == head


def test_span_and_check_loads_block_too_and_another_span_of_a_replacement_needs_a_reason(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    approve(registry, "hub-r1", in_force_from=date(2026, 2, 1), checked_by="B")
    scaled, check = hub_data(60, 4), hub_data(9, 30)
    scaled[:, 0] *= 1.05
    made = calibrate(make_session(scaled, check_rows=check, name="span"), registry)
    assert {f.rule for f in made.findings} == {"span", "check-load"}
    decision = approve(registry, made.record.id, in_force_from=date(2026, 3, 1), checked_by="B")
    assert {one.rule for one in decision.failed} == {"span", "check-load"}
    check[:, 0] *= 1.05
    other = make_session(scaled, check_rows=check, name="serial", tail='[cells.D51]\nserial = "new"\n')
    made = calibrate(other, registry)
    assert {f.rule for f in made.findings if f.level == "warning"} == {"serial", "span"}
    assert {f.rule for f in made.findings if f.level == "note"} == {"replacement"}
    words = {"in_force_from": date(2026, 3, 1), "checked_by": "B"}
    assert {one.rule for one in approve(registry, made.record.id, **words).failed} == {"replacement"}
    decision = approve(registry, made.record.id, **words, reason="D51 was overloaded on 2 February")
    assert decision.done
    (entry,) = [e for e in registry.ledger("hub").of(made.record.id) if e.event == "approved"]
    assert any("reason: D51 was overloaded" in text for text in entry.evidence)
    assert sum(text.startswith("span: ") for text in entry.evidence) == 3


def test_terms_that_the_check_loads_cannot_verify_are_listed_and_do_not_block(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    # Three check loads for four terms: nothing has full rank.
    made = calibrate(make_session(check_rows=hub_data(3, 8), name="few"), registry)
    decision = approve(registry, made.record.id, in_force_from=date(2026, 2, 1), checked_by="B")
    assert decision.done
    assert "FY: D51" in decision.unverifiable
    assert registry.status(made.record.id).unverifiable == decision.unverifiable
    full = approve(registry, "hub-r1", in_force_from=date(2026, 1, 6), checked_by="B")
    assert full.done
    assert full.unverifiable == ()


def test_the_projects_records_of_the_source_document() -> None:
    # Thesis, section 4.1: E5 positive is right; the old calibration took it as negative.
    assert PROJECT.status("m15-r1").void_always
    record = PROJECT.in_force("m15", on=date(2019, 6, 4))
    assert (record.id, record.verified) == ("m15-r2", False)
    assert record.load("FY").coefficients == (0.99719, 0.99718, 1.0228, 0.6473)
    assert record.load("MZ").coefficients == (-0.15688, 0.16197, 0.0026666, 0.68759)


def test_a_date_from_the_session_on_is_noted_and_one_before_it_needs_a_reason(registry: Registry) -> None:
    # hub-r1 is of 2026-01-05.
    decided = date(2026, 11, 21)
    with pytest.raises(RegistryError) as caught:
        approve(registry, "hub-r1", in_force_from=date(2026, 1, 4), checked_by="B", known_on=decided)
    assert caught.value.rule == "approval"
    assert "2026-01-05" in str(caught.value)
    with pytest.raises(RegistryError) as caught:
        approve(registry, "hub-r1", in_force_from=date(2026, 1, 6), checked_by="B", known_on=decided)
    assert caught.value.rule == "time"
    done = approve(
        registry, "hub-r1", in_force_from=date(2026, 1, 6), checked_by="B", known_on=decided, reason="late"
    )
    assert done.note == "in force from 319 days before the decision"
    assert registry.ledger("hub").entries[-1].note == done.note
    assert all(row.ok for row in verify_registry(registry))


def test_a_decision_on_its_day_has_no_note(registry: Registry) -> None:
    day = date(2026, 2, 1)
    done = approve(registry, "hub-r1", in_force_from=day, checked_by="B", known_on=day, reason="late")
    assert (done.note, registry.ledger("hub").entries[-1].note) == (None, None)


def test_the_error_names_every_name_that_must_differ(registry: Registry) -> None:
    with pytest.raises(RegistryError) as caught:
        approve(
            registry, "hub-r1", in_force_from=date(2026, 2, 1), checked_by="Bob", approved_by="Bob"
        )  # fmt: skip
    assert caught.value.got == "approved by 'Bob', also checked by"
    assert caught.value.expected == "a name that is none of 'operator one' (entered by), 'Bob' (checked by)"


def test_a_candidate_that_was_withdrawn_is_void_from_no_day_that_somebody_names(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    calibrate(make_session(hub_data(60, 3), name="later"), registry)
    withdraw(registry, "hub-r1", on=date(2026, 6, 1), void_from=date(2026, 5, 1), reason="wrong", by="B")
    status = registry.status("hub-r1")
    assert status.void_always
    assert void_day(status) is None  # it never was in force: no day before the first of May is spared
    assert withdrawal(status, date(2026, 4, 1))[0].text == "withdrawn on 2026-06-01: wrong"
