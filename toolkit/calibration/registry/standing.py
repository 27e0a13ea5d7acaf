"""Whether a record may make a number: one rule for every command.

A record may, where it belongs to the test's machine, was approved, is in force on the test's day as known on
the day of the report, and is not expired then. Everything else is at most a draft. A `CalibrationUse` carries
the answer with every result, and each mark on a page, figure or file follows from it alone.

*Expired*: the laboratory stated a recall interval when it approved the record, and the test's day lies after
the session's day plus that interval. The record is not void by that: audits still find it in force.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from typing import TYPE_CHECKING

from toolkit.calibration.records.use import UNSIGNED, CalibrationUse
from toolkit.calibration.registry.clock import in_future, today
from toolkit.calibration.registry.gates import GateResult
from toolkit.calibration.registry.judgement import judge_stored, machine_of
from toolkit.calibration.registry.status import RecordStatus, parse_interval
from toolkit.errors import RecordError, ToolkitError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.registry import Registry
    from toolkit.machine.definition import Machine

_PLACES = 4  # of a failed gate that are named


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """One reason why a record may make no number that is issued, and what to do about it."""

    text: str
    next_step: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """A record, and why it may not make a number of a test; without ``reasons`` it may.

    A ``discarded`` one makes no draft either: a laboratory has said that nothing shall rest on it.
    """

    record: CalibrationRecord
    instrument: str
    on: date | None
    known_at: date
    reasons: tuple[Reason, ...]
    since: tuple[str, ...] = ()
    discarded: bool = False
    signature: str = UNSIGNED

    def use(self, *, draft: bool, where: object = None) -> CalibrationUse:
        """Return what goes with every result of the record; ``where`` names the test in an error.

        Raises
        ------
        RecordError
            ``not-in-force``: there are reasons against it, and no draft was asked for
        """
        if self.reasons and (self.discarded or not draft):
            when = "on the test's day" if self.on is None else f"on {self.on.isoformat()}"
            raise not_in_force(
                self.record.id,
                self.reasons,
                where=self.record.id if where is None else f"{where}, record {self.record.id}",
                expected=f"a record of {self.instrument} that is approved and in force {when}, as known on "
                f"{self.known_at.isoformat()}",
                draft=not self.discarded,
            )
        return CalibrationUse(
            id=self.record.id,
            sha256=self.record.sha256,
            unverified=not self.record.verified,
            draft_reasons=tuple(reason.text for reason in self.reasons),
            since=self.since,
            signature=self.signature,
        )


def not_in_force(
    record_id: str,
    reasons: tuple[Reason, ...],
    *,
    where: object,
    expected: str,
    rule: str = "not-in-force",
    draft: bool = True,
) -> RecordError:
    """Return the error of a record that may not make a number, with its reasons and the next steps.

    ``draft`` tells whether a draft may be made of it.
    """
    steps = list(dict.fromkeys(reason.next_step for reason in reasons))
    if draft:
        steps.append("or add --draft: every page then says that it is a draft")
    return RecordError(
        f"{record_id} may not be used: it is not approved and in force",
        where=where,
        got="; ".join(reason.text for reason in reasons),
        expected=expected,
        next_step="; ".join(steps),
        rule=rule,
    )


def standing(
    registry: Registry,
    instrument: str,
    *,
    on: date | None,
    known_at: date | None = None,
    named: str | None = None,
) -> Standing:
    """Return the record for a test of an instrument, and how it stands.

    Parameters
    ----------
    on : the test's day, None where it is not known
    known_at : day of knowledge, default today
    named : id of the record; default the one in force on the test's day, and then ``on`` is needed

    Raises
    ------
    RegistryError, RecordError
        no record is in force on that day; the named record or the ledger cannot be used
    """
    ledger = registry.ledger(instrument)
    known_on = ledger.known_on(known_at)
    if named is None:
        if on is None:
            raise TypeError("a record is chosen by its name or by the test's day")
        record = registry.in_force(instrument, on=on, known_at=known_on, drafts=True)
    else:
        record = registry.load(named)
    reasons = _reasons(registry, record, instrument, on, known_on)
    texts = {reason.text for reason in reasons}
    later = () if known_on >= today() else _reasons(registry, record, instrument, on, today())
    status = registry.status(record.id, known_at=known_on)
    approved = () if status.approved_later is None else (approved_after(status.approved_later, known_on),)
    doubts = () if ledger.doubt is None else (f"{_OF_THE_LEDGER}{ledger.doubt}",)
    return Standing(
        record=record,
        instrument=instrument,
        on=on,
        known_at=known_on,
        reasons=reasons,
        since=(*doubts, *approved, *(reason.text for reason in later if reason.text not in texts)),
        discarded=status.state == "discarded",
        signature=registry.signature(record.id),
    )


def approved_after(day: date, known_on: date) -> str:
    """Return that an approval was not known on the day of knowledge, and serves all the same."""
    return (
        f"approved on {day.isoformat()}, after {known_on.isoformat()}: no earlier approval serves, and a "
        "ledger may begin later than the calibrations that it tells of"
    )


def unapproved(registry: Registry, record: CalibrationRecord, status: RecordStatus) -> tuple[Reason, ...]:
    """Return why a record is not approved: its gates that fail, or that nobody has approved it yet."""
    if status.in_force_from is not None:
        return ()
    state = _UNAPPROVED if status.state == "candidate" else status.state
    try:
        failed = failed_gates(registry, record)
    except ToolkitError as error:
        return (Reason(text=f"{state}; its gates cannot be run: {error.what}", next_step=_VERIFY),)
    if not failed:
        step = f"approve it: 'toolkit calibration approve {record.id} --in-force-from DATE'"
        return (Reason(text=f"{state}; no gate fails", next_step=step),)
    step = "correct the session and calibrate again: 'approve' refuses this record"
    return (Reason(text=f"{state}; failed {gate_words(failed)}", next_step=step),)


def withdrawal(status: RecordStatus, on: date | None = None) -> tuple[Reason, ...]:
    """Return that a record is void on a day by its withdrawal; without a day any void day counts."""
    if status.void_from is None or (on is not None and on < status.void_from):
        return ()
    when = f" on {status.known_on.isoformat()}" if status.known_on else ""
    void = "" if status.void_always else f", void from {status.void_from.isoformat()}"
    text = f"{status.state}{when}{void}: {status.reason or 'no reason stated'}"
    return (Reason(text=text, next_step="see 'toolkit calibration list'"),)


def failed_gates(
    registry: Registry, record: CalibrationRecord, *, machine: Machine | None = None
) -> tuple[GateResult, ...]:
    """Return the gates of an approval that a record fails; ``machine``: default that of its instrument."""
    machine = machine or machine_of(record.instrument)
    return judge_stored(registry, record, registry.ledger(record.instrument), machine=machine).failed


_UNAPPROVED = "a candidate that nobody has approved"
_OF_THE_LEDGER = "of the ledger "
_VERIFY = "see 'toolkit calibration verify'"


def _reasons(
    registry: Registry, record: CalibrationRecord, instrument: str, on: date | None, known_on: date
) -> tuple[Reason, ...]:
    status = registry.status(record.id, known_at=known_on)
    reasons: list[Reason] = []
    if record.instrument != instrument:
        text = f"it is a record of {record.instrument}, the test is of {instrument}"
        reasons.append(Reason(text=text, next_step=f"name a record of {instrument}"))
    void = withdrawal(status, on)
    if void:
        reasons += (replace(reason, next_step=_other(registry, instrument, on, known_on)) for reason in void)
    else:
        reasons += unapproved(registry, record, status)
    if on is None:
        text = "the test has no date: which record was in force cannot be told"
        reasons.append(Reason(text=text, next_step="write 'date = YYYY-MM-DD' into test.toml"))
    elif on > today():
        reasons.append(Reason(text=in_future(on), next_step="correct the date in test.toml"))
    elif not void and status.in_force_from is not None:
        reasons += _by_day(registry, record, status, on, known_on)
    return tuple(reasons)


def _by_day(
    registry: Registry, record: CalibrationRecord, status: RecordStatus, on: date, known_on: date
) -> list[Reason]:
    """Return what the test's day says against an approved record."""
    reasons: list[Reason] = []
    text = _passed_over(registry, record.instrument, status, on, known_on)
    if text is not None:
        reasons.append(Reason(text=text, next_step=_other(registry, record.instrument, on, known_on)))
    due = due_date(record, status)
    if due is not None and on > due:
        text = f"expired: its recall interval of {status.recall} ended on {due.isoformat()}"
        step = "calibrate the instrument, or approve the record again with a longer --recall and the reason"
        reasons.append(Reason(text=text, next_step=step))
    return reasons


def _passed_over(
    registry: Registry, instrument: str, status: RecordStatus, on: date, known_on: date
) -> str | None:
    """Return why another record, or none yet, is in force on a day; None where this one is."""
    winner = registry.id_in_force(instrument, on=on, known_at=known_on)
    if status.in_force_from is not None and on < status.in_force_from:
        return f"not in force until {status.in_force_from.isoformat()}"
    if winner in (None, status.id):
        return None
    begin = registry.status(str(winner), known_at=known_on).in_force_from
    if begin is not None and status.in_force_from is not None and begin < status.in_force_from:
        return f"approved only after {known_on.isoformat()}: {winner} was in force then"
    return f"superseded by {winner}" + (f", in force from {begin.isoformat()}" if begin else "")


def overtaken(used: Collection[str], in_force: Collection[str]) -> bool:
    """Tell whether a document rests on other records than those in force on the days of its tests.

    >>> overtaken(["m15-r1"], ["m15-r2"]), overtaken(["m15-r2"], ["m15-r2"])
    (True, False)
    """
    return {*used} != {*in_force}


def out_of_force(registry: Registry, instrument: str, record_id: str, *, on: date) -> str | None:
    """Return why a record is not the one in force on a test's day, as known today; None where it is.

    A recall interval voids nothing: what it says is asked before a number is made (`standing`).

    Raises
    ------
    RegistryError
        the ledger is damaged, or does not know the record
    """
    known_on = registry.ledger(instrument).known_on()
    winner = registry.id_in_force(instrument, on=on, known_at=known_on)
    if not overtaken((record_id,), () if winner is None else (winner,)):
        return None
    status = registry.status(record_id, known_at=known_on)
    void = withdrawal(status, on)
    if void:
        return void[0].text
    if status.in_force_from is None:
        return _UNAPPROVED
    return _passed_over(registry, instrument, status, on, known_on) or "no record is in force then"


def due_date(record: CalibrationRecord, status: RecordStatus) -> date | None:
    """Return the day by which a record's instrument is due again; None where no interval was stated."""
    if status.recall is None:
        return None
    return parse_interval(status.recall).after(date.fromisoformat(record.date))


def _other(registry: Registry, instrument: str, on: date | None, known_on: date) -> str:
    winner = None if on is None else registry.id_in_force(instrument, on=on, known_at=known_on)
    if winner is None:
        return "see 'toolkit calibration list' for the records and the days from which they are in force"
    return f"use {winner}, the record in force: leave --calibration away, or process the recordings again"


def gate_words(failed: Sequence[GateResult]) -> str:
    """Return failed gates in words: each rule with the first of its places."""
    phrases = []
    for rule in dict.fromkeys(result.rule for result in failed):
        places = [result.where for result in failed if result.rule == rule]
        remainder = f" and {len(places) - _PLACES} more" if len(places) > _PLACES else ""
        phrases.append(f"{rule} ({'; '.join(places[:_PLACES])}{remainder})")
    return f"gate{'' if len(phrases) == 1 else 's'} {', '.join(phrases)}"
