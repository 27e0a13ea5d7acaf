"""What happened to a record, as the ledger tells it, and what was known on a day."""

from __future__ import annotations

import calendar
import datetime as dt
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Literal

from toolkit.calibration.registry.ledger import ENDING, Entry, Ledger
from toolkit.errors import RegistryError

State = Literal["candidate", "approved", "withdrawn", "discarded"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordStatus:
    """A record's state for a day of knowledge.

    ``in_force_from`` is the earliest day of its approvals, ``void_from`` the first day on which it is
    void; both None where there is none. ``void_always``: void on every day of its use, as a discarded
    candidate is. ``reason`` is that of the withdrawal or discard, else of the approval. ``unverifiable`` are
    the terms that its check loads could not verify, as "load: term". ``recall`` is the interval that the last
    approval with one has set. ``approved_later`` is the day of its first approval where that lies after the
    day of knowledge: nobody knew of it then, and it serves where no earlier approval does.
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
    approved_later: date | None = None

    @property
    def ended(self) -> bool:
        """Whether the record was withdrawn or discarded."""
        return self.state in ENDING


def status_of(record_id: str, entries: Sequence[Entry], known_at: date) -> RecordStatus:
    """Return a record's state from its own ledger entries (oldest first).

    Only the end of a record waits for its day of knowledge: for ``known_at`` before it the record stands.
    An approval counts whenever it was entered: a ledger begins later than the calibrations that it tells
    of, and ``in_force_from`` says from when (see `Registry.in_force` for what was known first).
    """
    entered = next(entry for entry in entries if entry.event == "entered")
    approvals = [entry for entry in entries if entry.event == "approved"]
    end = next(
        (e for e in entries if e.event in ENDING and e.known_on is not None and e.known_on <= known_at), None
    )
    since = min((e.since for e in approvals if e.since is not None), default=None)
    void_from = None
    if end is not None:
        # A record that never was in force has no day before which it could have served.
        void_from = date.min if since is None else (end.since or since)
    approved_on = min((e.known_on for e in approvals if e.known_on is not None), default=None)
    last = approvals[-1] if approvals else None
    state: State = "approved" if approvals else "candidate"
    if end is not None:
        state = "discarded" if end.event == "discarded" else "withdrawn"
    decision = end or last
    return RecordStatus(
        id=record_id,
        state=state,
        in_force_from=since,
        void_from=void_from,
        void_always=void_from is not None and (since is None or void_from <= since),
        known_on=decision.known_on if decision else None,
        reason=decision.reason if decision else None,
        entered_by=entered.by,
        checked_by=last.by if last else None,
        approved_by=last.approved_by if last else None,
        unverifiable=last.unverifiable if last else (),
        recall=next((entry.recall for entry in reversed(approvals) if entry.recall), None),
        approved_later=None if approved_on is None or approved_on <= known_at else approved_on,
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


# A recall interval: how long after its session's date an instrument is due again.


_TEXT = re.compile(r"\s*(?P<count>[1-9][0-9]{0,3})\s*(?P<unit>day|week|month|year)s?\s*\Z", re.IGNORECASE)
_MOST = {"day": 18263, "week": 2609, "month": 600, "year": 50}


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A number of days, weeks, months or years by the calendar; its text is the ledger's."""

    count: int
    unit: str

    def __str__(self) -> str:
        return f"{self.count} {self.unit}" + ("" if self.count == 1 else "s")

    def after(self, day: dt.date) -> dt.date:
        """Return the day that lies this interval after another; a month's last day stays one.

        >>> Interval(count=1, unit="month").after(dt.date(2024, 1, 31))
        datetime.date(2024, 2, 29)
        """
        if self.unit in ("day", "week"):
            return day + dt.timedelta(days=self.count * (7 if self.unit == "week" else 1))
        months = day.year * 12 + day.month - 1 + self.count * (12 if self.unit == "year" else 1)
        year, month = divmod(months, 12)
        return dt.date(year, month + 1, min(day.day, calendar.monthrange(year, month + 1)[1]))


def parse_interval(text: str) -> Interval:
    """Read an interval.

    >>> str(parse_interval("12 Months"))
    '12 months'

    Raises
    ------
    RegistryError
        ``recall``: not a whole number of days, weeks, months or years, or more than 50 years
    """
    match = _TEXT.match(text)
    interval = None if match is None else Interval(count=int(match["count"]), unit=match["unit"].lower())
    if interval is None or interval.count > _MOST[interval.unit]:
        raise RegistryError(
            "the recall interval cannot be used",
            where="--recall",
            got=text,
            expected='a whole number of days, weeks, months or years up to 50 years, such as "12 months"',
            next_step="nothing was changed; write the interval again",
            rule="recall",
        )
    return interval
