"""What people decide about a record: approval behind its gates, and withdrawal.

Both only add a line to the ledger.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry import gates
from toolkit.calibration.registry.clock import now, today
from toolkit.calibration.registry.judgement import judge_stored, machine_of, read_polarity_file
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.life import check_line, refusal
from toolkit.calibration.registry.registry import Registry, instrument_of
from toolkit.calibration.registry.status import RecordStatus, parse_interval
from toolkit.calibration.registry.store import Change
from toolkit.calibration.registry.stored import stored_check, stored_loads
from toolkit.errors import ToolkitError
from toolkit.findings import Finding
from toolkit.inputs import read_regular


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The outcome of an approval: ``done`` is False where a gate blocked, and then nothing was changed.

    ``note`` tells that the record is in force from a day before the decision, and ``evidence`` by what its
    signs are confirmed and what the gates said that did not stand in the way; both are in the ledger too.
    """

    id: str
    done: bool
    failed: tuple[gates.GateResult, ...]
    unverifiable: tuple[str, ...]
    findings: tuple[Finding, ...]
    note: str | None = None
    evidence: tuple[str, ...] = ()


def approve(
    registry: Registry,
    record_id: str,
    *,
    in_force_from: dt.date,
    checked_by: str,
    approved_by: str | None = None,
    reason: str | None = None,
    known_on: dt.date | None = None,
    recall: str | None = None,
    polarity: Path | None = None,
    machine: str | None = None,
) -> Decision:
    """Put a record in force, where its gates let it through (`judgement`).

    ``known_on`` is the day of the decision (default today); a day before today needs a reason, which says why
    the entry is dated back. ``polarity`` is a file of polarity readings, ``machine`` names the machine
    definition (default: the packaged one of the instrument's name). A second approval of a record moves its
    in-force date back or sets its recall interval anew, with a reason. ``recall`` is the interval after the
    session's date, such as "12 months"; it stands in the ledger and changes nothing about the record.

    A date before the session's own reaches back to tests that the session cannot speak of by itself: it
    needs a reason. From the session's date on none is asked for, however late the decision, but a date
    before the decision is written down: tests of the days between may have been judged by another record,
    and ledger and answer note by how many days (``Decision.note``).

    Raises
    ------
    RegistryError
        ``names``: entered, checked and approved by do not differ; ``approval``: a date before the
        session's without a reason, a record that is withdrawn or approved already, or a
        later date than before; ``recall``: no interval; ``time``: a decision in the future, before its
        session, or in the past without a reason
    ConfigError, UnitError
        the polarity readings or the machine definition cannot be used
    """
    folder = registry.folder / instrument_of(record_id)
    day = known_on or registry.today()
    record = registry.load(record_id)
    definition = machine_of(record.instrument, machine)
    readings = () if polarity is None else read_polarity_file(polarity, record)
    interval = None if recall is None else str(parse_interval(recall))
    early = (day - in_force_from).days
    note = f"in force from {_days(early)} before the decision" if early > 0 else None
    decided: list[Decision] = []

    def build(ledger: Ledger) -> Change | None:
        event: dict[str, Any] = {
            "event": "approved",
            "id": record_id,
            "time": now(),
            "by": checked_by,
            "known_on": day.isoformat(),
            "since": in_force_from.isoformat(),
        }
        stated = {"approved_by": approved_by, "reason": reason, "note": note, "recall": interval}
        event |= {key: value for key, value in stated.items() if value}
        if approved_by is not None:
            event["approved_by"] = approved_by
        check_line(event, ledger, record, today=registry.today)
        judged = judge_stored(registry, record, ledger, machine=definition, readings=readings, reason=reason)
        failed = judged.failed
        check, loads = stored_check(registry.folder, record), stored_loads(registry.folder, record)
        terms = gates.unverifiable(record, check, loads)
        # What a session only asks for refuses an approval as an error does.
        findings = tuple(replace(result, effect="blocks").finding() for result in failed)
        evidence = (
            *judged.evidence,
            *(f"{result.rule}: {result.where}: {result.message}" for result in judged.told),
        )
        decided.append(
            Decision(
                id=record_id,
                done=not failed,
                failed=failed,
                unverifiable=terms,
                findings=findings,
                note=None if failed else note,
                evidence=evidence,
            )
        )
        if failed:
            return None
        event |= {"unverifiable": list(terms)} | ({"evidence": list(evidence)} if evidence else {})
        return Change(files={}, event=event)

    registry.commit(folder.name, build)
    return decided[0]


def withdraw(
    registry: Registry, record_id: str, *, on: dt.date, void_from: dt.date | None = None, reason: str, by: str
) -> RecordStatus:
    """Withdraw a record: ``on`` is when the fault became known, ``void_from`` the first void day.

    ``by`` names who withdraws.

    Without ``void_from`` the record is void from its in-force date, hence on every day. Where ``on`` lies
    before today, the ledger notes by how many days the entry is dated back.

    Raises
    ------
    RegistryError
        no such record, no reason, or withdrawn already; ``names``: a name in which nothing can be seen;
        ``time``: a day in the future, or before the session
    """
    folder = registry.folder / instrument_of(record_id)

    def build(ledger: Ledger) -> Change:
        event: dict[str, Any] = {
            "event": "withdrawn",
            "id": record_id,
            "time": now(),
            "by": by,
            "known_on": on.isoformat(),
            "reason": reason,
        }
        late = (registry.today() - on).days
        details = {
            "since": void_from and void_from.isoformat(),
            "note": f"entered {_days(late)} after it became known" if late > 0 else None,
        }
        event |= {key: value for key, value in details.items() if value}
        check_line(event, ledger, _read(folder, record_id), today=registry.today)
        return Change(files={}, event=event)

    if not folder.is_dir():
        raise refusal(record_id, "no such record", record_id, ", ".join(registry.instruments()), "missing")
    registry.commit(folder.name, build)
    return registry.status(record_id, known_at=max(on, today()))


def _read(folder: Path, record_id: str) -> CalibrationRecord | None:
    """Return a record as its file stands; None where it cannot be read, which its withdrawal survives."""
    path = folder / f"{record_id}.json"
    try:
        return from_bytes(read_regular(path), where=path)
    except (ToolkitError, OSError):
        return None


def _days(count: int) -> str:
    return f"{count} day{'' if count == 1 else 's'}"


# The end of a candidate: a line in the ledger. The record stays, and is known for ever.


def discard(registry: Registry, record_id: str, *, reason: str, by: str) -> RecordStatus:
    """Discard a candidate: it can never be approved, and nothing is compared with it.

    The record is not read: a candidate that fails its gates may be discarded too.

    Raises
    ------
    RegistryError
        ``discard``: no reason, or the record was approved, withdrawn or discarded before; ``names``: a name
        in which nothing can be seen; ``time``: before its session; ``missing``; the ledger is damaged.
        Nothing is written
    """
    folder = registry.folder / instrument_of(record_id)

    def build(ledger: Ledger) -> Change:
        event = {
            "event": "discarded",
            "id": record_id,
            "time": now(),
            "by": by,
            "known_on": registry.today().isoformat(),
            "reason": reason.strip(),
        }
        check_line(event, ledger, _read(folder, record_id), today=registry.today)
        return Change(files={}, event=event)

    if not folder.is_dir():
        instruments = ", ".join(registry.instruments()) or "a record"
        raise refusal(record_id, "no such record", record_id, instruments, "missing")
    registry.commit(folder.name, build)
    return registry.status(record_id)
