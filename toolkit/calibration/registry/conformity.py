"""Load-time gate: every line about a record must be one that could have been written.

Days, names and order follow from the lines themselves (`life`). The gates of an approval are judged again:
from the record's stored data, and from the records that were approved before that line. What an approval was
shown and the registry does not keep (readings of ``--polarity``, a machine definition from elsewhere) is
taken from the line's evidence. A record that is void on every day makes no number, and nothing is asked of
its approval: to withdraw it mends what cannot stand.

Before that a record is read as its files and its entry in the ledger have it, whatever was decided about it
since.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.agreement import check_agrees, check_inputs, check_transcribed
from toolkit.calibration.registry.gates import unverifiable
from toolkit.calibration.registry.history import NO_HISTORY, History, history_of
from toolkit.calibration.registry.judgement import evidence_of, judge, machine_of
from toolkit.calibration.registry.ledger import LEDGER, Entry, Ledger
from toolkit.calibration.registry.life import objections
from toolkit.calibration.registry.refit import check_reproduces
from toolkit.calibration.registry.status import status_of
from toolkit.calibration.registry.stored import bad_record as _bad
from toolkit.calibration.registry.stored import parse_loads, stored_check, stored_loads
from toolkit.errors import RecordError, RegistryError, ToolkitError
from toolkit.files import sha256_bytes
from toolkit.inputs import read_regular


def load_reproduced(folder: Path, record_id: str, ledger: Ledger) -> CalibrationRecord:
    """Read one record and hold it against its entry and its data, in the order of `Registry.load`."""
    path = folder / f"{record_id}.json"
    entered = ledger.entered().get(record_id)
    try:
        data = read_regular(path)
    except OSError as error:
        raise RecordError(
            f"record {record_id} is missing" if entered else f"the registry has no record {record_id}",
            where=path,
            got=error.strerror if entered else record_id,
            expected="the record's file" if entered else ", ".join(ledger.entered()) or "a record",
            next_step="restore it from a backup" if entered else "see 'toolkit calibration list'",
            rule="missing",
        ) from error
    record = from_bytes(data, where=path)
    check_entered(record, data, ledger, path)
    contents = {part.role: _data_file(record_id, folder / part.file, part.sha256) for part in record.data}
    try:
        if record.kind == "legacy":
            check_transcribed(record, contents["source"])
            return record
        table = parse_loads(record, contents["loads"], folder)
        check_agrees(record, contents["session"], table, contents.get("dcc"))
    except KeyError as error:
        raise _bad(record_id, path, f"no data file {error}", "its reference-load data", "data") from error
    check_reproduces(record, table)
    check_inputs(record)
    return record


def check_entered(record: CalibrationRecord, data: bytes, ledger: Ledger, path: Path) -> None:
    """Refuse a record whose bytes, read from a path, are not those of its entry.

    Raises
    ------
    RecordError
        ``ledger``, ``hash``
    """
    if ledger.damage is not None:
        raise _bad(path.stem, path, ledger.damage, "a ledger without damage", "ledger")
    entered = ledger.entered().get(path.stem)
    if entered is None or record.id != path.stem or record.instrument != path.parent.name:
        raise _bad(path.stem, path, "no entry of this record in the ledger", "an 'entered' line", "ledger")
    if entered.record != record.sha256:
        raise _bad(path.stem, path, f"sha256 {record.sha256}", f"{entered.record} as entered", "ledger")
    if entered.signatures and (entered.action == "import") != (record.kind == "legacy"):
        raise _bad(
            path.stem, path, f"a {record.kind} record", f"what its entry says: {entered.action}", "ledger"
        )
    if entered.file != sha256_bytes(data):
        raise _bad(path.stem, path, "a file whose bytes were changed", "the file as entered", "hash")


def _data_file(record_id: str, path: Path, expected: str) -> bytes:
    try:
        data = read_regular(path)
    except OSError as error:
        raise _bad(
            record_id, path, f"{path.name}: {error.strerror}", "the data that belong to the record", "data"
        ) from error
    if (digest := sha256_bytes(data)) != expected:
        raise _bad(record_id, path, f"{path.name} with sha256 {digest}", f"{expected} as entered", "data")
    return data


_MOST = 4096  # approvals whose gates a process remembers
_PLACES = 4  # of failed gates that are named
_judged: dict[tuple[str, str, bool, bool], RegistryError | None] = {}


def check_conforms(folder: Path, record: CalibrationRecord, ledger: Ledger) -> None:
    """Refuse a record about which the ledger has a line that could not have been written.

    Raises
    ------
    RecordError
        the rule that the line breaks: ``names approval withdrawal discard time recall ledger``
    """
    breach = _breach(folder, record, ledger)
    if breach is not None and ledger.void:
        # What a revoked key signed decides nothing now, and decided when the lines after it were written.
        breach = _breach(folder, record, replace(ledger, void=frozenset()))
    if breach is None:
        return
    entry, objection = breach
    raise RecordError(
        f"record {record.id} may not be used: no command writes its line {entry.seq} ({entry.event})",
        where=folder / LEDGER,
        got=f"{objection.what}: {objection.got}",
        expected=objection.expected,
        next_step="restore the ledger from a backup, or withdraw the record: an earlier one is then in force",
        rule=objection.rule,
    ) from objection


def _breach(folder: Path, record: CalibrationRecord, ledger: Ledger) -> tuple[Entry, RegistryError] | None:
    """Return the first line about a record that breaks a rule, and the rule."""
    entries = ledger.of(record.id)
    for at, entry in enumerate(entries):
        for objection in objections(entry, entries[:at], record=record):
            return entry, objection
    if status_of(record.id, entries, dt.date.max).void_always:
        return None
    for at, entry in enumerate(entries):
        if entry.event == "approved":
            failure = _gates_of(folder, record, ledger, entry, entries[:at])
            if failure is not None:
                return entry, failure
    return None


def _gates_of(
    folder: Path, record: CalibrationRecord, ledger: Ledger, entry: Entry, before: Sequence[Entry]
) -> RegistryError | None:
    """Return the gates of an approval that the record fails; None where none.

    A line's hash stands for every line before it, and they for the files of the records: what was judged once
    need not be judged again.
    """
    history = _history(folder, record, ledger, entry)
    key = (str(folder), entry.sha256, history is None, bool(ledger.void))
    if key not in _judged:
        if len(_judged) >= _MOST:
            _judged.clear()
        _judged[key] = _failed(folder, record, entry, before, history)
    return _judged[key]


def _failed(
    folder: Path, record: CalibrationRecord, entry: Entry, before: Sequence[Entry], history: History | None
) -> RegistryError | None:
    machine = machine_of(record.instrument)
    evidence = evidence_of(entry.evidence, record)
    if evidence.machine is not None and (
        machine is None or evidence.machine != (machine.name, str(machine.version))
    ):
        machine = None  # the definition that it was held against is not here
    loads, check = stored_loads(folder.parent, record), stored_check(folder.parent, record)
    judged = judge(
        record,
        history=history or NO_HISTORY,
        machine=machine,
        loads=loads,
        check=check,
        reason=entry.reason,
        confirmed_before=history is None or any(line.event == "approved" for line in before),
        evidence=evidence,
    )
    # Versions that did not state the clock asked for nothing: what blocks a record blocked it then, too.
    failed = [result for result in judged.failed if entry.clock is not None or result.effect == "blocks"]
    if failed:
        problem = "the record fails gates that an approval passes"
        places = [f"{result.rule} ({result.where}: {result.message})" for result in failed]
        further = f" and {len(places) - _PLACES} more" if len(places) > _PLACES else ""
        return _unapprovable(
            record, problem, f"{'; '.join(places[:_PLACES])}{further}", "a record that passes"
        )
    missing = [term for term in unverifiable(record, check, loads) if term not in entry.unverifiable]
    if missing:
        problem = "the approval does not name what no check load verifies"
        return _unapprovable(record, problem, f"nothing of {', '.join(missing)}", "each of these terms")
    return None


def _unapprovable(record: CalibrationRecord, problem: str, got: str, expected: str) -> RegistryError:
    return RegistryError(problem, where=record.id, got=got, expected=expected, rule="approval")


def _history(folder: Path, record: CalibrationRecord, ledger: Ledger, entry: Entry) -> History | None:
    """Return what a record was compared with when it was approved; None where that was lost since.

    The lost record has its own row in `verify`; that one cannot be compared with it makes no other one bad.
    """
    try:
        return history_of(_Stored(folder), record, ledger, but=record.id, before=entry.seq)
    except (ToolkitError, OSError):
        return None


@dataclass(frozen=True, slots=True)
class _Stored:
    """The records of an instrument as their entries have them: each is refitted where it is loaded itself."""

    place: Path

    @property
    def folder(self) -> Path:
        """The registry's folder."""
        return self.place.parent

    def load_by(self, ledger: Ledger, record_id: str) -> CalibrationRecord:
        """Return a record whose bytes are those that were entered."""
        path = self.place / f"{record_id}.json"
        data = read_regular(path)
        record = from_bytes(data, where=path)
        check_entered(record, data, ledger, path)
        return record
