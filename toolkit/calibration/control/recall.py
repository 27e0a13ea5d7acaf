"""When an instrument is due again, and which interval its own drift would recommend.

The due date is the session's date plus the recall interval that the approval wrote into the ledger. The
recommendation is a drift method: each as-found result is an error that grew since the session of the record
that made it; the fastest of these growths, as a share of the tolerance a day, reaches 80 % of the tolerance
after the recommended time. It is kept between half and one and a half of the interval in use, so that one
result does not overturn it, and it never changes the ledger.

References: ILAC-G24 / OIML D 10, Guidelines for the determination of recalibration intervals, method 2
(control chart: drift against time; its method 1 names the 80 % of the permissible error); NCSLI RP-1.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from typing import Annotated

from toolkit.calibration.control.as_found import AsFound, as_found_history
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import due_date
from toolkit.declared import Entry, derived
from toolkit.findings import Finding

SHARE = 0.8
LEAST_RESULTS = 2
STEP = (0.5, 1.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecommendedInterval:
    """What the history recommends."""

    days: Annotated[
        int | None, Entry("until the fastest drift reaches 80 % of the tolerance; null of too few results")
    ]
    drift_per_year: Annotated[float | None, Entry("as a share of the tolerance")]
    results: Annotated[int, Entry("as found")]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DueInstrument:
    """When an instrument is due."""

    instrument: str
    on: Annotated[dt.date, Entry(output=False)]
    record: str
    session_date: dt.date
    recall: Annotated[str | None, Entry("interval, as its approval states it")]
    due: Annotated[dt.date | None, Entry("null where no interval was set")]
    days_left: Annotated[int | None, Entry("negative when overdue")]
    recommended: RecommendedInterval

    @property
    @derived(after="days_left")
    def overdue(self) -> bool:
        """Whether the due date has passed."""
        return self.days_left is not None and self.days_left < 0


def due_of(registry: Registry, instrument: str, on: dt.date) -> DueInstrument:
    """Return when an instrument is due, as its record in force on a day says.

    Raises
    ------
    RegistryError, RecordError
        no record is in force on that day, the ledger is damaged, or a record fails a gate
    """
    record = registry.in_force(instrument, on=on)
    status = registry.status(record.id)
    day = dt.date.fromisoformat(record.date)
    due = due_date(record, status)
    history = [as_found for as_found in as_found_history(registry, instrument) if as_found.date <= on]
    return DueInstrument(
        instrument=instrument,
        on=on,
        record=record.id,
        session_date=day,
        recall=status.recall,
        due=due,
        days_left=None if due is None else (due - on).days,
        recommended=recommend(history, present_days=None if due is None else (due - day).days),
    )


def recommend(history: list[AsFound], *, present_days: int | None) -> RecommendedInterval:
    """Recommend an interval from as-found results; ``present_days`` is the interval in use."""
    rates = [
        as_found.worst_share / (as_found.date - as_found.since).days
        for as_found in history
        if as_found.worst_share is not None and as_found.since is not None and as_found.date > as_found.since
    ]
    if len(rates) < LEAST_RESULTS:
        reason = (
            f"{len(rates)} as-found results with a record before them, at least {LEAST_RESULTS} are needed"
        )
        return RecommendedInterval(days=None, drift_per_year=None, results=len(rates), reason=reason)
    worst = max(rates)
    if worst == 0:
        reason = "no drift was seen: nothing speaks for another interval"
        return RecommendedInterval(days=present_days, drift_per_year=0.0, results=len(rates), reason=reason)
    free = SHARE / worst
    reason = f"the fastest drift reaches {100 * SHARE:g} % of the tolerance after {free:.0f} days"
    days = free
    if present_days is not None:
        days = min(max(free, STEP[0] * present_days), STEP[1] * present_days)
        if days != free:
            reason += f"; a step from the present {present_days} days is kept between -50 and +50 %"
    return RecommendedInterval(
        days=max(1, int(days)), drift_per_year=worst * 365.25, results=len(rates), reason=reason
    )


def due_findings(due: DueInstrument) -> tuple[Finding, ...]:
    """Return ``overdue``, or a note where no interval was set."""
    if due.recall is None or due.due is None:
        message = "no recall interval was set: nobody can say when it is due"
        return (Finding(rule="recall-unknown", where=due.record, message=message, level="note"),)
    if not due.overdue:
        return ()
    days = -(due.days_left or 0)
    message = (
        f"{due.instrument} was due on {due.due.isoformat()}, {days} day{'' if days == 1 else 's'} ago "
        f"({due.recall} after the session of {due.session_date.isoformat()})"
    )
    return (Finding(rule="overdue", where=due.record, message=message),)
