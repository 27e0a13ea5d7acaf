"""What happened to a record, as the ledger tells it, and what was known on a day."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Literal

from toolkit.calibration.registry.ledger import Entry, Ledger
from toolkit.errors import RegistryError

State = Literal["candidate", "approved", "withdrawn", "discarded"]
ENDED: tuple[State, ...] = ("withdrawn", "discarded")


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordStatus:
    """A record's state for a day of knowledge.

    ``in_force_from`` is the earliest day of its approvals, ``void_from`` the first day on which it is
    void; both None where there is none. ``void_always``: void on every day of its use, as a discarded
    candidate is. ``reason`` is that of the withdrawal or discard, else of the approval. ``unverifiable`` are
    the terms that its check loads could not verify, as "load: term". ``recall`` is the interval that the last
    approval with one has set.
    """

    id: str
    state: State
    in_force_from: date | None
    void_from: date | None
    void_always: bool
    known_on: date | None
    reason: str | None
    entered_by: str
    checked_by: str | None
    approved_by: str | None
    unverifiable: tuple[str, ...]
    recall: str | None = None

    @property
    def ended(self) -> bool:
        """Whether the record was withdrawn or discarded."""
        return self.state in ENDED

    def covers(self, on: date) -> bool:
        """Tell whether the record may serve a test of this day (it may still be superseded)."""
        return (
            self.in_force_from is not None
            and self.in_force_from <= on
            and (self.void_from is None or on < self.void_from)
        )


def status_of(record_id: str, entries: Sequence[Entry], known_at: date) -> RecordStatus:
    """Return a record's state from its own ledger entries (oldest first).

    Only the end of a record waits for its day of knowledge: for ``known_at`` before it the record stands.
    An approval counts whenever it was entered: a ledger begins later than the calibrations that it tells
    of, and ``in_force_from`` says from when (see `Registry.in_force` for what was known first).
    """
    entered = next(entry for entry in entries if entry.event == "entered")
    approvals = [entry for entry in entries if entry.event == "approved"]
    end = next(
        (e for e in entries if e.event in ENDED and e.known_on is not None and e.known_on <= known_at), None
    )
    since = min((e.since for e in approvals if e.since is not None), default=None)
    void_from = None
    if end is not None:
        void_from = end.since if end.since is not None else (since or date.min)
    last = approvals[-1] if approvals else None
    state: State = "approved" if approvals else "candidate"
    if end is not None:
        state = "discarded" if end.event == "discarded" else "withdrawn"
    told = end or last
    return RecordStatus(
        id=record_id,
        state=state,
        in_force_from=since,
        void_from=void_from,
        void_always=void_from is not None and (since is None or void_from <= since),
        known_on=told.known_on if told else None,
        reason=told.reason if told else None,
        entered_by=entered.by,
        checked_by=last.by if last else None,
        approved_by=last.approved_by if last else None,
        unverifiable=last.unverifiable if last else (),
        recall=next((entry.recall for entry in reversed(approvals) if entry.recall), None),
    )


def is_discarded(ledger: Ledger, record_id: str) -> bool:
    """Tell whether a record was discarded."""
    return any(entry.event == "discarded" for entry in ledger.of(record_id))


def discarded_before(ledger: Ledger, record_id: str, what: str, where: object) -> RegistryError:
    """Return the error of data that were entered before and whose record was discarded."""
    end = next(entry for entry in ledger.of(record_id) if entry.event == "discarded")
    return RegistryError(
        f"{what} was entered before, and its record was discarded",
        where=where,
        got=f"{record_id}, discarded on {end.known_on} by {end.by}: {end.reason}",
        expected="other data or settings, or --again to enter the same ones under a new id",
        next_step="correct what was wrong, or repeat the command with --again; nothing was written",
        rule="discarded",
    )
