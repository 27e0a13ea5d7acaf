"""in_force(on, known_at) against a model of the contract's words, over every day of drawn histories.

The model keeps a table of days, as a laboratory's clerk would, and knows nothing of ranks.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.calibration.registry import registry as module
from toolkit.calibration.registry.ledger import Entry, Ledger
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import RegistryError

DAYS = 8
START = dt.date(2026, 1, 1)
RECORDS = ("x-r1", "x-r2", "x-r3")


@dataclass(frozen=True)
class Approved:
    record: str
    known: int
    since: int


@dataclass(frozen=True)
class Withdrawn:
    record: str
    known: int
    since: int | None


Event = Approved | Withdrawn


@st.composite
def histories(draw: st.DrawFn) -> list[Event]:
    """Draw what `approve` and `withdraw` let happen, in the order of the ledger, not of the days."""
    day = st.integers(0, DAYS - 1)
    told: list[Event] = []
    since: dict[str, int] = {}
    gone: set[str] = set()
    for record in draw(st.lists(st.sampled_from(RECORDS), max_size=7)):
        if record in gone:
            continue
        if draw(st.integers(0, 2)) == 0:
            told.append(Withdrawn(record, draw(day), draw(st.none() | day)))
            gone.add(record)
        else:
            first = draw(day)
            # A second approval reaches further back, or it is refused.
            if first < since.get(record, DAYS):
                told.append(Approved(record, draw(day), first))
                since[record] = first
    return told


def clerk(history: list[Event], on: int, known_at: int) -> str | None:
    """Return the record in force, from a table that is filled in day by day."""
    void: set[tuple[str, int]] = set()
    for event in history:
        if isinstance(event, Withdrawn) and event.known <= known_at:
            starts = [e.since for e in history if isinstance(e, Approved) and e.record == event.record]
            first = event.since if event.since is not None else min(starts, default=0)
            void |= {(event.record, day) for day in range(first, DAYS)}
    approvals = [e for e in history if isinstance(e, Approved)]
    # What was known first; what a later approval says of the past only where that leaves the day empty.
    for group in ([e for e in approvals if e.known <= known_at], approvals):
        table: dict[int, str] = {}
        for day in range(on + 1):
            for event in group:
                if event.since == day and (event.record, on) not in void:
                    # The newest in-force date up to the day stands, among equals the last one entered.
                    table[on] = event.record
        if on in table:
            return table[on]
    return None


def entries(history: list[Event]) -> tuple[Entry, ...]:
    rows: list[tuple[str, str, int | None, int | None]] = [("entered", r, None, None) for r in RECORDS]
    rows += [
        ("approved" if isinstance(e, Approved) else "withdrawn", e.record, e.known, e.since) for e in history
    ]

    def day(number: int | None) -> dt.date | None:
        return None if number is None else START + dt.timedelta(days=number)

    return tuple(
        Entry(
            seq=seq, prev="", sha256="", event=event, id=record, time="", by="A",
            known_on=day(known), since=day(since),
        )
        for seq, (event, record, known, since) in enumerate(rows, start=1)
    )  # fmt: skip


@given(history=histories())
def test_every_day_of_every_history(history: list[Event]) -> None:
    ledger = Ledger(entries=entries(history), damage=None)

    registry = Registry(Path("nowhere"))
    with pytest.MonkeyPatch.context() as patch:
        # The gates of the record that applies are tested elsewhere: here only which one it is.
        patch.setattr(registry, "ledger", lambda _instrument: ledger)
        patch.setattr(module, "load_checked", lambda _folder, record_id, _ledger: record_id)
        for on in range(DAYS):
            for known_at in range(DAYS):
                days = {"on": START + dt.timedelta(days=on), "known_at": START + dt.timedelta(days=known_at)}
                expected = clerk(history, on, known_at)
                if expected is None:
                    with pytest.raises(RegistryError) as caught:
                        registry.in_force("x", **days)
                    assert caught.value.rule == "no-record-in-force"
                else:
                    assert str(registry.in_force("x", **days)) == expected, (history, on, known_at)


def covers(status: module.RecordStatus, on: dt.date) -> bool:
    """Tell whether a record by itself may serve a test of this day."""
    begun = status.in_force_from is not None and status.in_force_from <= on
    return begun and (status.void_from is None or on < status.void_from)


@given(history=histories(), known=st.integers(0, DAYS - 1))
def test_a_state_tells_what_the_days_tell(history: list[Event], known: int) -> None:
    # A record that its status calls void on every day is in force on none, and one alone that covers is.
    ledger = Ledger(entries=entries(history), damage=None)
    when = START + dt.timedelta(days=known)
    for record in RECORDS:
        status = module.status_of(record, ledger.of(record), when)
        alone = [e for e in history if e.record == record]
        days = [clerk(alone, on, known) is not None for on in range(DAYS)]
        assert days == [covers(status, START + dt.timedelta(days=on)) for on in range(DAYS)]
        assert not (status.void_always and any(days))
