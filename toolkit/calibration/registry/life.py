"""The life of a record: which line of a ledger may follow which.

Whoever decides asks `objections` before a line is written, and whoever reads a ledger asks the same of each
line that is there. A chain of hashes shows a slip and not a forger: a line that no command could have written
is believed by none.

    entered -> approved (again: with a reason, no later) -> withdrawn
            -> discarded
    issued: at any time after the entry
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, date, datetime, timedelta
from typing import Any

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.clock import begun, check_begun, moment, untimely
from toolkit.calibration.registry.ledger import ENDING, Entry, Ledger
from toolkit.calibration.registry.status import parse_interval, status_of
from toolkit.errors import RegistryError
from toolkit.trust.people import name_key

_LATEST_ZONE = timedelta(hours=12)  # UTC-12, Baker Island: where a day ends last
_SECONDS = len("2026-11-22T10:11:12Z")


def entry_of_event(event: Mapping[str, Any]) -> Entry:
    """Return an event that is to be written as the entry that will be read."""
    body = dict(event)
    for key in ("known_on", "since"):
        if body.get(key) is not None:
            body[key] = date.fromisoformat(body[key])
    return Entry(**{"seq": 0, "prev": "", "sha256": "", **body})


def check_line(
    event: Mapping[str, Any],
    ledger: Ledger,
    record: CalibrationRecord | None = None,
    *,
    today: Callable[[], date] | None = None,
) -> None:
    """Refuse an event that may not follow the lines of a ledger; ``record`` and ``today`` as of `objections`.

    Raises
    ------
    RegistryError
        ``names approval withdrawal discard time missing recall ledger``: the rule that it breaks
    """
    entry = entry_of_event(event)
    for objection in objections(entry, ledger.of(entry.id), record=record, today=today):
        if objection.rule == "missing":
            objection.expected = ", ".join(ledger.entered()) or None
        raise objection


def objections(
    entry: Entry,
    before: Sequence[Entry],
    *,
    record: CalibrationRecord | None = None,
    today: Callable[[], date] | None = None,
) -> Iterator[RegistryError]:
    """Yield what speaks against a line about a record; nothing where it may stand.

    Parameters
    ----------
    entry : the line
    before : the lines about the same record before it, oldest first
    record : the record itself; None where it cannot be read, which its withdrawal survives
    today : the day by the writer's own zone; None of a line that was written, by whom nobody knows where
    """
    if entry.event == "entered":
        yield from _entered(entry, before, record)
    elif not any(line.event == "entered" for line in before):
        yield refusal(entry.id, "no such record", entry.id, "a record that was entered before", "missing")
    elif entry.event == "issued":
        if entry.document is None:
            yield refusal(entry.id, "an issue names its document", "nothing", "a document", "ledger")
    elif entry.event in _DECISIONS:
        if entry.known_on is None:
            yield refusal(entry.id, "a decision needs its day", "nothing", "the day of the decision", "time")
            return
        yield from _DECISIONS[entry.event](entry, before, record, today)
    else:
        yield refusal(
            entry.id, "an instrument's ledger has no such event", entry.event,
            ", ".join(("entered", "issued", *_DECISIONS)), "ledger",
        )  # fmt: skip


def misplaced(ledger: Ledger, instrument: str) -> str | None:
    """Say which line stands where none could have been written; None where none does.

    It belongs to no record of the instrument, is of an earlier form than the lines before it, or goes back in
    time.
    """
    entered: set[str] = set()
    clock: Entry | None = None
    prefix = f"{instrument}-r"
    for entry in ledger.entries:
        if entry.clock is not None:
            clock = entry
        elif clock is not None:
            return (
                f"line {entry.seq} does not state the clock, and line {clock.seq} before it does: no "
                "version of the toolkit wrote both"
            )
        if entry.event == "entered":
            entered.add(entry.id)
            if not entry.id.startswith(prefix) or not entry.id[len(prefix) :].isdecimal():
                return f"line {entry.seq} enters {entry.id}, which is no record of {instrument}"
        elif entry.id not in entered:
            return (
                f"line {entry.seq} ({entry.event} {entry.id}): no record of that name was entered before it"
            )
    return disorder(ledger)


def disorder(ledger: Ledger) -> str | None:
    """Say which line's time lies before that of the one before it; None where none does.

    A line that ends a record may: it can always be entered, after a line of a clock that was fast too, and
    the lines after it follow its time. That a document was issued decides nothing, and its time bounds none.
    """
    last: Entry | None = None
    for entry in ledger.entries:
        if last is not None and entry.event not in ENDING and _earlier(entry.time, last.time):
            return (
                f"line {entry.seq} was entered at {entry.time}, before line {last.seq} at {last.time}: "
                "a clock was set back"
            )
        last = last if entry.event == "issued" else entry
    return None


def _earlier(time: str, last: str) -> bool:
    # Of one spelling texts compare as times do, and a million lines are read in a second.
    if len(time) == len(last) == _SECONDS and time[-1] == last[-1] == "Z":
        return time < last
    return moment(time) < moment(last)


def _entered(
    entry: Entry, before: Sequence[Entry], record: CalibrationRecord | None
) -> Iterator[RegistryError]:
    if before:
        yield refusal(entry.id, "a record is entered once", f"{entry.id} again", "a new id", "ledger")
    if record is None:
        return
    if entry.by != record.entered_by:
        yield refusal(
            entry.id, "a record is entered by its session's operator", entry.by, record.entered_by, "names"
        )
    if not begun(date.fromisoformat(record.date), moment(entry.time)):
        yield untimely(
            "a record is entered before its session", entry.id,
            f"its session of {record.date} lies after its entry at {entry.time}", "a session that was held",
        )  # fmt: skip


def _approved(
    entry: Entry, before: Sequence[Entry], record: CalibrationRecord | None, today: Callable[[], date] | None
) -> Iterator[RegistryError]:
    day, since = entry.known_on, entry.since
    if day is None or since is None:
        yield refusal(entry.id, "an approval needs an in-force date", "nothing", "a date", "approval")
        return
    yield from _same_names(entry, before)
    session = None if record is None else date.fromisoformat(record.date)
    reason = (entry.reason or "").strip()
    if session is not None and since < day and since < session and not reason:
        yield refusal(
            entry.id, "an in-force date before the session's own date needs a reason",
            f"in force from {since.isoformat()}, session of {session.isoformat()}",
            f"a date from {session.isoformat()} on, or --reason TEXT, which the ledger keeps", "approval",
        )  # fmt: skip
    yield from _untimely(entry, record, "the day of the decision", today)
    entered_on = _first_day(entry) if today is None else today()
    # Lines of before the clock was stated were written when no reason was asked for.
    asked = today is not None or entry.clock is not None
    if asked and day < entered_on and not reason:
        yield refusal(
            entry.id, "a decision that is dated back needs a reason",
            f"decided on {day.isoformat()}, entered on {entered_on.isoformat()}",
            "--reason TEXT, which says why it was not entered on its day; the ledger keeps both days", "time",
        )  # fmt: skip
    if entry.recall is not None:
        yield from _recall(entry.recall)
    status = status_of(entry.id, before, date.max)
    if status.ended:
        yield refusal(
            entry.id, f"a {status.state} record cannot be approved",
            f"{status.state}: {status.reason or 'no reason stated'}", "a new session", "approval",
        )  # fmt: skip
    if status.in_force_from is None:
        return
    if not reason or (status.in_force_from == since and entry.recall in (None, status.recall)):
        yield refusal(
            entry.id, "the record is approved already",
            f"in force from {status.in_force_from.isoformat()}",
            "another in-force date or recall interval, with --reason TEXT", "approval",
        )  # fmt: skip
    if since > status.in_force_from:
        # The first approval stands: the days between would stay in force, whatever was answered.
        yield refusal(
            entry.id, "an approved record cannot come into force later than it did", since.isoformat(),
            f"not after {status.in_force_from.isoformat()}; a withdrawal makes days void", "approval",
        )  # fmt: skip


def _withdrawn(
    entry: Entry, before: Sequence[Entry], record: CalibrationRecord | None, today: Callable[[], date] | None
) -> Iterator[RegistryError]:
    yield from _stated(entry, "a withdrawal", "withdrawal", "withdraws")
    yield from _untimely(entry, record, "the day on which the fault became known", today)
    status = status_of(entry.id, before, date.max)
    if status.ended:
        yield refusal(
            entry.id, f"the record is {status.state} already",
            f"{status.state}: {status.reason or 'no reason stated'}", "a record that stands", "withdrawal",
        )  # fmt: skip
    # An approval whose day had not begun when it was withdrawn is of a fast clock: no day follows it.
    written = moment(entry.time)
    days = [
        line.known_on
        for line in before
        if line.event == "approved" and line.known_on is not None and begun(line.known_on, written)
    ]
    if days and entry.known_on is not None and entry.known_on < min(days):
        yield untimely(
            "a withdrawal lies before the approval that it ends", entry.id,
            f"known on {entry.known_on.isoformat()}, approved on {min(days).isoformat()}",
            f"a day from {min(days).isoformat()} on; --from says from which day on the record is void",
        )  # fmt: skip


def _discarded(
    entry: Entry, before: Sequence[Entry], record: CalibrationRecord | None, today: Callable[[], date] | None
) -> Iterator[RegistryError]:
    yield from _stated(entry, "a discard", "discard", "discards")
    yield from _untimely(entry, record, "the day of the decision", today)
    status = status_of(entry.id, before, date.max)
    if status.state != "candidate":
        yield refusal(
            entry.id, f"the record is {status.state}, and only a candidate can be discarded",
            f"{status.state}: {status.reason}" if status.reason else status.state,
            "a candidate that was never approved; an approved record is withdrawn", "discard",
        )  # fmt: skip


_Rule = Callable[
    [Entry, Sequence[Entry], "CalibrationRecord | None", Callable[[], date] | None], Iterator[RegistryError]
]
_DECISIONS: Mapping[str, _Rule] = {"approved": _approved, "withdrawn": _withdrawn, "discarded": _discarded}


def _same_names(entry: Entry, before: Sequence[Entry]) -> Iterator[RegistryError]:
    """Yield the first two roles of an approval that one person, or nobody, has."""
    names = [("entered by", before[0].by), ("checked by", entry.by)]
    names += [("approved by", entry.approved_by)] if entry.approved_by is not None else []
    roles: dict[str, str] = {}
    for role, name in names:
        key = name_key(name)
        if not key or key in roles:
            yield RegistryError(
                "entered, checked and approved must be different names",
                where=entry.id,
                got=f"{role} {name!r}" + (f", also {roles[key]}" if key in roles else ""),
                expected=f"a name that is none of {', '.join(f'{n!r} ({r})' for r, n in names if r != role)}",
                next_step=f"nothing was changed; see 'toolkit calibration show {entry.id}'",
                rule="names",
            )
            return
        roles[key] = role


def _stated(entry: Entry, what: str, rule: str, does: str) -> Iterator[RegistryError]:
    if not (entry.reason or "").strip():
        yield refusal(entry.id, f"{what} needs a reason", "nothing", "--reason TEXT", rule)
    if not name_key(entry.by):
        yield refusal(entry.id, f"{what} needs a name", "nothing", f"--by NAME: who {does}", "names")


def _untimely(
    entry: Entry, record: CalibrationRecord | None, what: str, today: Callable[[], date] | None
) -> Iterator[RegistryError]:
    """Yield that a day had not begun, or lies before the session that is decided about."""
    day = entry.known_on
    if day is None:
        return
    if today is not None:
        try:
            check_begun(day, what, entry.id)
        except RegistryError as error:
            yield error
    elif not begun(day, moment(entry.time)):
        yield untimely(
            f"{what} lies in the future", entry.id,
            f"{entry.event} at {entry.time} by a decision of {day.isoformat()}", "a day that had begun",
        )  # fmt: skip
    # A legacy record has no session: its date is that of the source that names its coefficients.
    if record is None or record.kind != "fit":
        return
    session = date.fromisoformat(record.date)
    # A session whose day had not begun when its record was ended is of a fast clock: no day follows it.
    if day < session and (entry.event not in ENDING or begun(session, moment(entry.time))):
        yield untimely(
            "a decision lies before the session that it is about", entry.id,
            f"decided on {day.isoformat()}, session of {record.date}", f"a day from {record.date} on",
        )  # fmt: skip


def _first_day(entry: Entry) -> date:
    """Return the day of an entry where it was earliest: the writer's own zone is not in the ledger."""
    at = moment(entry.time)
    return (at - _LATEST_ZONE).date() if at - datetime.min.replace(tzinfo=UTC) > _LATEST_ZONE else date.min


def _recall(text: str) -> Iterator[RegistryError]:
    try:
        parse_interval(text)
    except RegistryError as error:
        yield error


def refusal(record_id: str, problem: str, actual: str, expected: str, rule: str) -> RegistryError:
    """Return the error of a decision that a record's life does not allow."""
    return RegistryError(
        problem, where=record_id, got=actual, expected=expected,
        next_step=f"nothing was changed; see 'toolkit calibration show {record_id}'", rule=rule,
    )  # fmt: skip
