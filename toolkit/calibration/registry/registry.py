"""The registry: which record applies to a test, and whether it may be used.

``calibrations/<instrument>/`` holds ``<record-id>.json``, the data files that belong to each record,
``ledger.jsonl`` and ``head.json``. Records are only read here; `store` writes.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry import settled
from toolkit.calibration.registry.clock import day_of, now, today
from toolkit.calibration.registry.conformity import check_conforms, load_reproduced
from toolkit.calibration.registry.ledger import HEAD, LEDGER, Ledger, decisions
from toolkit.calibration.registry.life import check_line, misplaced
from toolkit.calibration.registry.people_log import FOLDER, PeopleLog, instruments_of, read_people
from toolkit.calibration.registry.signatures import revoked, signature_line, unproved
from toolkit.calibration.registry.status import RecordStatus, status_of
from toolkit.calibration.registry.store import Change, commit
from toolkit.calibration.registry.stored import reason_of
from toolkit.calibration.registry.witnessed import contradicted
from toolkit.errors import RegistryError, ToolkitError
from toolkit.files import sha256_bytes
from toolkit.spelling import nearest
from toolkit.trust.keys import Signer
from toolkit.trust.signing import HERE, Signing, Travel

ID = re.compile(r"(?P<instrument>[A-Za-z0-9][A-Za-z0-9_.-]*)-r(?P<number>[1-9][0-9]*)\Z")
_LONGEST_NAME = 255  # bytes, of a folder: what every usual file system holds


@dataclass(frozen=True, slots=True, kw_only=True)
class RefusedRecord:
    """A record that may not be used, and why."""

    id: str
    rule: str
    reason: str


def instrument_of(record_id: str) -> str:
    """Return the instrument of a record id.

    >>> instrument_of("m15-virtual-r12")
    'm15-virtual'
    """
    match = ID.match(record_id)
    if match is None:
        raise RegistryError(
            f"not a record id: {record_id!r}",
            where="record id",
            got=record_id,
            expected="<instrument>-r<N>, such as rig-r2",
            next_step="see 'toolkit calibration list'",
            rule="record-id",
        )
    return match["instrument"]


class Registry:
    """The records of every instrument below one folder.

    ``lock_file``: writers keep each other out by a file, for a file system without locks. ``signers``: the
    keys that sign what is decided through this object; a laboratory without people needs none. ``travel``:
    the request to write, or the answers that came back, where keys are elsewhere.
    """

    def __init__(
        self, folder: Path, *, lock_file: bool = False, signers: Sequence[Signer] = (), travel: Travel = HERE
    ) -> None:
        self.folder = folder
        self.lock_file = lock_file
        self.signers = tuple(signers)
        self.travel = travel
        self._proved: dict[tuple[str, str, str], tuple[str | None, frozenset[int]]] = {}

    def travelling(self, travel: Travel) -> Registry:
        """Return the same registry with another way to the keys elsewhere."""
        return Registry(self.folder, lock_file=self.lock_file, signers=self.signers, travel=travel)

    def now(self) -> str:
        """Return the time of what is decided: of its request, where answers came back."""
        return self.travel.answers[0].time if self.travel.answers else now()

    def today(self) -> date:
        """Return the day of what is decided by this computer's own time zone."""
        return day_of(self.now())

    def instruments(self) -> tuple[str, ...]:
        """Return the instruments, sorted."""
        return instruments_of(self.folder)

    def no_instrument(self, name: str) -> RegistryError:
        """Return the error of a name that no instrument has: ``missing``."""
        meant = nearest(name, self.instruments())
        return RegistryError(
            "there is no such instrument", where=self.folder, got=name,
            expected=", ".join(self.instruments()) or "an instrument with records: there is none yet",
            next_step=("" if meant is None else f"did you mean {meant!r}? Else ")
            + "see 'toolkit calibration list'; nothing was changed",
            rule="missing",
        )  # fmt: skip

    def ids(self, instrument: str) -> tuple[str, ...]:
        """Return the ids of an instrument, on disk or in its ledger, oldest first."""
        return record_ids(self.folder / instrument, self.ledger(instrument))

    def ledger(self, instrument: str) -> Ledger:
        """Return an instrument's ledger; a write that was cut off is none of it.

        Where people are enrolled, a line that they did not sign as their policy demands is damage.

        Raises
        ------
        TrustError
            ``people-log``
        """
        if not _is_folder_name(instrument):
            return Ledger(entries=(), damage=None)
        return self._judged(instrument, settled.read(self.folder / instrument), self.people())

    def people(self) -> PeopleLog:
        """Return the people of the laboratory; nobody where none is enrolled.

        Raises
        ------
        TrustError
            ``people-log``
        """
        return read_people(self.folder)

    def commit(self, instrument: str, build: Callable[[Ledger], Change | None]) -> bool:
        """Make one change to an instrument's folder, signed where people are enrolled (`store.commit`).

        Raises
        ------
        RegistryError, OutputError, TrustError
            nothing is changed, or the message says what state it is in
        """
        people = self.people()

        def of_these_people(ledger: Ledger) -> Change | None:
            # Under the ledger's lock: nobody enrols anybody until the line is there.
            if self.people().heads != people.heads:
                raise RegistryError(
                    "the people of the laboratory changed meanwhile", where=self.folder / instrument,
                    got=f"{len(self.people().heads)} versions of them", expected=f"{len(people.heads)}",
                    next_step="repeat the command; nothing was changed", rule="ledger-moved",
                )  # fmt: skip
            change = build(ledger)
            if change is not None:
                # Nothing is written that no reader would believe.
                check_line(change.event, ledger)
            return change

        return commit(
            self.folder / instrument,
            of_these_people,
            lock_file=self.lock_file,
            signing=Signing(history=people.history, signers=self.signers, travel=self.travel),
            judged=lambda ledger: self._judged(instrument, ledger, people),
        )

    def _judged(self, instrument: str, ledger: Ledger, people: PeopleLog) -> Ledger:
        if ledger.damage is not None:
            return ledger
        version = people.history.now
        key = (instrument, ledger.head, "" if version is None else version.sha256)
        if key not in self._proved:
            self._proved[key] = (
                misplaced(ledger, instrument)
                or unproved(ledger, people.history, people.places(instrument))
                or contradicted(self.folder, instrument, ledger.texts),
                revoked(ledger, people.history),
            )
        damage, void = self._proved[key]
        return replace(ledger, damage=damage, void=void) if damage or void else ledger

    def head(self, instrument: str) -> str:
        """Return the hash of the ledger's last line, to be printed on what leaves the laboratory."""
        return self.ledger(instrument).head

    def signature(self, record_id: str) -> str:
        """Return who signed the decisions that a record rests on, ``unsigned`` where somebody did not.

        Raises
        ------
        RegistryError
            the ledger is damaged
        """
        return self.signatures(instrument_of(record_id), record_id)[record_id]

    def signatures(self, instrument: str, *records: str) -> dict[str, str]:
        """Return the signatures of some records, default all, by id: the ledger read once."""
        ledger, history = self._sound(instrument), self.people().history
        return {
            record_id: signature_line(ledger, history, record_id) for record_id in records or ledger.entered()
        }

    def digest(self, instrument: str) -> str:
        """Return a hash of everything that decides about this instrument's records: files, decisions, people.

        Of the ledger it takes what was decided: that a document was issued changes no record.
        """
        people = self.people().history.now
        parts = [] if people is None else [f"{FOLDER} {people.sha256}"]
        folder = self.folder / instrument
        for name, data in settled.settled_files(folder) if _is_folder_name(instrument) else ():
            if name != HEAD:
                parts.append(f"{name} {sha256_bytes(decisions(data) if name == LEDGER else data)}")
        return sha256_bytes("\n".join(parts).encode())

    def load(self, record_id: str) -> CalibrationRecord:
        """Return a record that passes every load-time gate.

        Raises
        ------
        RecordError
            with rule ``missing unreadable hash ledger data refit golden``; that of a line that no command
            writes: ``names approval withdrawal discard time recall``
        RegistryError
            the text is no record id
        """
        instrument = instrument_of(record_id)
        return load_checked(self.folder / instrument, record_id, self.ledger(instrument))

    def load_by(self, ledger: Ledger, record_id: str) -> CalibrationRecord:
        """Return a record as `load` does, by a ledger that was read before."""
        return load_checked(self.folder / instrument_of(record_id), record_id, ledger)

    def usable(self, instrument: str) -> tuple[tuple[CalibrationRecord, ...], tuple[RefusedRecord, ...]]:
        """Return the records that pass every gate, and those that do not with the reason."""
        good: list[CalibrationRecord] = []
        bad: list[RefusedRecord] = []
        ledger = self.ledger(instrument)
        folder = self.folder / instrument
        ids = record_ids(folder, ledger)
        for record_id, loaded in load_many(folder, ids, ledger).items():
            if isinstance(loaded, CalibrationRecord):
                good.append(loaded)
                continue
            bad.append(
                RefusedRecord(id=record_id, rule=loaded.rule or "unreadable", reason=reason_of(loaded))
            )
        return tuple(good), tuple(bad)

    def status(self, record_id: str, *, known_at: date | None = None) -> RecordStatus:
        """Return what the ledger tells of a record, as known on a day (default: today).

        Raises
        ------
        RegistryError
            the ledger is damaged, or does not know the record
        """
        instrument = instrument_of(record_id)
        ledger = self._sound(instrument)
        if record_id not in ledger.entered():
            raise self._unknown(record_id, instrument)
        return status_of(record_id, ledger.of(record_id), ledger.known_on(known_at))

    def statuses(self, instrument: str, *, known_at: date | None = None) -> dict[str, RecordStatus]:
        """Return what the ledger tells of every record, by id: `status` of each, the ledger read once.

        Raises
        ------
        RegistryError
            the ledger is damaged
        """
        ledger = self._sound(instrument)
        known_on = ledger.known_on(known_at)
        return {
            record_id: status_of(record_id, ledger.of(record_id), known_on) for record_id in ledger.entered()
        }

    def in_force(
        self, instrument: str, *, on: date, known_at: date | None = None, drafts: bool = False
    ) -> CalibrationRecord:
        """Return the record in force on a test's day, as known on another day (default: today).

        The newest ``in_force_from`` not after ``on`` wins, among equals the one approved last. A record
        that is void on ``on``, by a withdrawal known at ``known_at``, does not count. An approval that was
        entered after ``known_at`` serves only where no earlier one does: a report of that time could not
        know it, but a ledger may begin later than the calibrations that it tells of. ``drafts``: who asks can
        make a draft of another record, and the error says so.

        Raises
        ------
        RegistryError
            no record applies (the message lists the candidates), or the ledger is damaged
        RecordError
            the record that applies fails a gate
        """
        ledger = self._sound(instrument)
        known_on = ledger.known_on(known_at)
        best = _best(ledger, on, known_on)
        if best is None:
            standings = [
                _status_text(status_of(record_id, ledger.of(record_id), known_on))
                for record_id in ledger.entered()
            ]
            others = [name for name in self.instruments() if name != instrument]
            meant = nearest(instrument, others)
            raise RegistryError(
                f"no calibration of {instrument} is in force on {on.isoformat()}",
                where=self.folder / instrument,
                got="; ".join(standings) or f"no record of {instrument}",
                expected=(
                    "" if standings or not others else f"an instrument with records: {', '.join(others)}; "
                )
                + f"an approved record in force on {on.isoformat()}, as known on {known_on.isoformat()}",
                next_step=("" if standings or meant is None else f"did you mean {meant!r}? Else ")
                + "approve one with 'toolkit calibration approve ID --in-force-from DATE'"
                + ", or make a draft with --calibration ID --draft" * drafts,
                rule="no-record-in-force",
            )
        return load_checked(self.folder / instrument, best, ledger)

    def id_in_force(self, instrument: str, *, on: date, known_at: date | None = None) -> str | None:
        """Return the id of the record that `in_force` returns, without reading it; None where none applies.

        Raises
        ------
        RegistryError
            the ledger is damaged
        """
        ledger = self._sound(instrument)
        return _best(ledger, on, ledger.known_on(known_at))

    def _sound(self, instrument: str) -> Ledger:
        ledger = self.ledger(instrument)
        if ledger.damage is not None:
            raise settled.damaged(self.folder / instrument, ledger.damage)
        return ledger

    def _unknown(self, record_id: str, instrument: str) -> RegistryError:
        return RegistryError(
            f"the registry has no record {record_id}",
            where=self.folder / instrument,
            got=record_id,
            expected=", ".join(self.ids(instrument)) or "a record",
            next_step="see 'toolkit calibration list'",
            rule="missing",
        )


def _is_folder_name(instrument: str) -> bool:
    """Tell whether a name stays in the registry: whoever names an instrument may write ``../x`` or ``/x``."""
    named = instrument not in ("", ".", "..") and Path(instrument).name == instrument
    return named and len(os.fsencode(instrument)) <= _LONGEST_NAME


def record_ids(folder: Path, ledger: Ledger) -> tuple[str, ...]:
    """Return the ids of records on disk or in the ledger, oldest first."""
    ids = {entry.id for entry in ledger.entries}
    if folder.is_dir():
        ids |= {path.stem for path in folder.glob("*.json") if path.name not in (HEAD, *ledger.hidden)}
    return tuple(sorted((text for text in ids if ID.match(text)), key=_number))


def load_checked(folder: Path, record_id: str, ledger: Ledger) -> CalibrationRecord:
    """Read one record and run every load-time gate, in the order of the rules in `Registry.load`."""
    record = load_reproduced(folder, record_id, ledger)
    check_conforms(folder, record, ledger)
    return record


def load_many(
    folder: Path, ids: Sequence[str], ledger: Ledger
) -> dict[str, CalibrationRecord | ToolkitError]:
    """Return records by id as `load_checked` does, or its error."""
    loaded: dict[str, CalibrationRecord | ToolkitError] = {}
    for record_id in ids:
        try:
            loaded[record_id] = load_checked(folder, record_id, ledger)
        except ToolkitError as error:
            loaded[record_id] = error
    return loaded


def _best(ledger: Ledger, on: date, known_on: date) -> str | None:
    """Return the id of the record in force; see `Registry.in_force` for the order."""
    best: tuple[bool, date, int, str] | None = None
    for record_id in ledger.entered():
        entries = ledger.of(record_id)
        void_from = status_of(record_id, entries, known_on).void_from
        for entry in entries:
            if entry.event != "approved" or entry.since is None or entry.since > on:
                continue
            if void_from is not None and on >= void_from:
                continue
            was_known = entry.known_on is not None and entry.known_on <= known_on
            rank = (was_known, entry.since, entry.seq, record_id)
            best = rank if best is None else max(best, rank)
    return None if best is None else best[3]


def _status_text(status: RecordStatus) -> str:
    if status.in_force_from is None:
        return f"{status.id} ({status.state})"
    void = "" if status.void_from is None else f", void from {status.void_from.isoformat()}"
    return f"{status.id} (in force from {status.in_force_from.isoformat()}{void})"


def _number(record_id: str) -> tuple[str, int]:
    match = ID.match(record_id)
    return ("", 0) if match is None else (match["instrument"], int(match["number"]))


__all__ = ["ID", "LEDGER", "RefusedRecord", "Registry", "instrument_of", "load_checked", "today"]
