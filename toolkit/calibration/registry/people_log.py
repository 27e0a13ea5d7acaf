"""The log of people: each version of ``people.toml`` is an entry, signed as the version before demands.

It lies beside the calibrations, ``people/`` in the laboratory's home. ``people.toml`` in the home is what
people read: the newest version. What is typed into it is no decision, and `verify` says so.

An entry names count and last hash of every ledger at that time. What was decided before a version and what
after it is thereby a matter of places: a stolen key cannot write a line that states a time before its end,
nor can a ledger lose a line that a version has seen.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from toolkit.calibration.registry import settled
from toolkit.calibration.registry.clock import now
from toolkit.calibration.registry.ledger import START, Ledger
from toolkit.calibration.registry.life import disorder
from toolkit.calibration.registry.lock import writing
from toolkit.calibration.registry.signatures import Place, unproved
from toolkit.calibration.registry.store import Change, commit
from toolkit.calibration.registry.witnessed import contradicted
from toolkit.errors import ToolkitError, TrustError
from toolkit.files import sha256_bytes, write_atomic
from toolkit.inputs import read_regular
from toolkit.trust.keys import Signer
from toolkit.trust.people import FILE, ROOT_HEADS, History, People, parse_people, version_of
from toolkit.trust.signing import HERE, Signing, Travel
from toolkit.trust.ssh import PublicKey

FOLDER = "people"
_NO_LINES = {"count": 0, "sha256": START}


@dataclass(frozen=True, slots=True, kw_only=True)
class PeopleLog:
    """The people of a laboratory over time.

    ``heads``: of each version, count and last hash of each ledger when it was entered.
    """

    history: History
    heads: tuple[Mapping[str, Mapping[str, Any]] | None, ...]

    def places(self, instrument: str) -> tuple[Place | None, ...]:
        """Return of each version how many lines an instrument had, and their last hash; None: not known."""
        return tuple(
            None if heads is None or not (row := heads.get(instrument, _NO_LINES))
            else (int(row["count"]), str(row["sha256"]))
            for heads in self.heads
        )  # fmt: skip


def place_of(calibrations: Path) -> Path:
    """Return the folder of the log of people for a registry's folder."""
    return calibrations.parent / FOLDER


def read_people(calibrations: Path) -> PeopleLog:
    """Return the people of the laboratory of a registry; nobody where none is enrolled.

    Raises
    ------
    TrustError
        ``people-log``: the log is damaged, or one of its entries is no decision of the people before it
    """
    folder = place_of(calibrations)
    # Of an instrument that is called so the witnesses signed under its name.
    shared = (calibrations / FOLDER).is_dir()
    if not folder.is_dir():
        lost = None if shared else contradicted(calibrations, FOLDER, list)
        if lost is not None:
            raise _damaged(folder, lost)
        return PeopleLog(history=History(), heads=())
    ledger = settled.read(folder)
    damage = ledger.damage or disorder(ledger)
    if damage is None and not shared:
        damage = contradicted(calibrations, FOLDER, ledger.texts)
    if damage is not None:
        raise _damaged(folder, damage)
    history = _history(folder, ledger)
    if history.now is None:
        return PeopleLog(history=History(), heads=())
    damage = unproved(ledger, history, of_people=True) or _unfounded(ledger, history)
    if damage is not None:
        raise _damaged(folder, damage)
    return PeopleLog(history=history, heads=tuple(entry.heads for entry in ledger.entries))


def instruments_of(calibrations: Path) -> tuple[str, ...]:
    """Return the instruments of a registry's folder, sorted."""
    if not calibrations.is_dir():
        return ()
    folders = (path for path in calibrations.iterdir() if path.is_dir() and not path.name.startswith("."))
    return tuple(sorted(path.name for path in folders if not settled.is_empty(path)))


def _heads(calibrations: Path, log: PeopleLog) -> dict[str, dict[str, Any]]:
    """Return where each ledger ends, under the locks of all; nothing of one that is damaged."""
    heads: dict[str, dict[str, Any]] = {}
    for name in instruments_of(calibrations):
        ledger = settled.state_of(calibrations / name).ledger
        sound = log.history.now is None or not (
            ledger.damage or unproved(ledger, log.history, log.places(name))
        )
        # Whoever revokes a thief's key does not confirm what the thief wrote.
        heads[name] = {"count": len(ledger.entries), "sha256": ledger.head} if sound else {}
    return heads


def enrol(
    calibrations: Path, people: People, signers: Sequence[Signer], *, by: str, reason: str,
    lock_file: bool = False, travel: Travel = HERE,
) -> PeopleLog:  # fmt: skip
    """Enter a version of the people's file, signed; the first one founds the laboratory's trust.

    Nobody writes to any ledger meanwhile: every later line is judged by this version.

    Raises
    ------
    TrustError
        ``not-signed``, ``not-allowed``, ``request``, ``people-log``; nothing is changed
    ConfigError
        two people of one name or key, or a decision that nobody could make; nothing is changed
    OutputError
        the home cannot be written to
    """
    folder = place_of(calibrations)
    data = people.text().encode()
    digest = sha256_bytes(data)
    time = travel.answers[0].time if travel.answers else now()
    parse_people(data, where=FILE)  # which no longer lets every text in that it lets be read
    version = version_of(data, time)  # what nobody could read again is never entered

    with contextlib.ExitStack() as locks:
        for name in instruments_of(calibrations):
            locks.enter_context(writing(calibrations / name, lock_file=lock_file))
        log = read_people(calibrations)
        heads, before = _heads(calibrations, log), log.history

        def build(ledger: Ledger) -> Change:
            number = len(ledger.entries) + 1
            event = {
                "event": "enrolled", "id": f"people-{number}", "time": time, "by": by,
                "reason": reason, "file": digest, "heads": heads,
            }  # fmt: skip
            return Change(files={f"people-{number}.toml": data}, event=event)

        if before.now is None:
            before = History((version,))
            if travel.request is None:
                answered = [public for answer in travel.answers for public in answer.keys(version)]
                _check_root(people, [*answered, *(signer.public for signer in signers)])
        signing = Signing(history=before, signers=tuple(signers), travel=travel)
        commit(folder, build, lock_file=lock_file, signing=signing)
        write_atomic(calibrations.parent / FILE, data)
    return read_people(calibrations)


def _check_root(people: People, publics: Sequence[PublicKey]) -> None:
    heads = {person.id for public in publics if (person := people.owner(public)) and "head" in person.roles}
    if len(heads) < ROOT_HEADS:
        raise TrustError(
            "the first enrolment takes two heads, or one and a recovery key", where=FILE,
            got=f"signed by {', '.join(sorted(heads)) or 'nobody'}",
            expected=f"{ROOT_HEADS} keys of different heads",
            next_step="sign with both, --sign KEY --sign KEY, or by one and a key kept apart, "
            "--recovery FILE: toolkit person key FILE makes one",
            rule="not-allowed",
        )  # fmt: skip


def _history(folder: Path, ledger: Ledger) -> History:
    versions = []
    for entry in ledger.entries:
        path = folder / f"{entry.id}.toml"
        try:
            data = read_regular(path)
            if entry.event != "enrolled" or sha256_bytes(data) != entry.file:
                raise _damaged(path, "it is not the file that was entered")
            versions.append(version_of(data, entry.time))
        except (OSError, ToolkitError) as error:
            raise _damaged(path, getattr(error, "got", None) or error) from error
    return History(tuple(versions))


def _unfounded(ledger: Ledger, history: History) -> str | None:
    first = history.versions[0].people
    heads = {
        row["by"] for row in ledger.entries[0].signatures
        if (person := first.of(row["by"])) is not None and "head" in person.roles
    }  # fmt: skip
    return None if len(heads) >= ROOT_HEADS else "the first enrolment is not signed by two heads"


def _damaged(where: Path, damage: object) -> TrustError:
    return TrustError(
        "the log of people is damaged", where=where, got=damage,
        expected="every version of the people's file, signed by those whom the one before allowed",
        next_step="restore the folder from a backup; see 'toolkit person list'", rule="people-log",
    )  # fmt: skip
