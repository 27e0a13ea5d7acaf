"""What a record was compared with is the same when its approval's line is read as when it was written."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given

from tests.calibration.registry.test_registry_in_force_model import Event, entries, histories
from toolkit.calibration.registry.history import approved_before, approved_ids
from toolkit.calibration.registry.ledger import Ledger


@given(history=histories())
def test_the_records_before_a_line_are_those_that_the_ledger_of_then_had(history: list[Event]) -> None:
    # The day of knowledge of `approved_ids` is at least that of the last line.
    lines = tuple(replace(entry, time="2999-01-01T00:00:00Z") for entry in entries(history))
    ledger = Ledger(entries=lines, damage=None)
    for at, entry in enumerate(ledger.entries):
        if entry.event != "approved":
            continue
        then = replace(ledger, entries=ledger.entries[:at])
        expected = approved_ids(then, but=entry.id)
        assert approved_before(ledger, entry.seq, but=entry.id) == expected
        assert ledger.newest_before[entry.seq] == next(iter(expected), None)
