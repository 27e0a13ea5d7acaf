"""`verify`: every record on disk or in a ledger, and every file that belongs to none.

Many records are shared out among processes; the rows are the same and in the same order.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.ledger import HEAD, LEDGER, Ledger
from toolkit.calibration.registry.people_log import FOLDER
from toolkit.calibration.registry.registry import ID, Registry, load_many
from toolkit.calibration.registry.settled import is_passing
from toolkit.calibration.registry.witnessed import attested
from toolkit.declared import Entry
from toolkit.errors import ToolkitError
from toolkit.inputs import read_regular
from toolkit.system import can_fork, processors
from toolkit.trust.people import FILE

_FOLDER_KEEPERS = (".gitkeep", ".gitignore")
# Starting the processes takes as long as some hundred records.
_SHARED_FROM = 200
_CHUNK = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifiedRecord:
    """What came of refitting a record from its stored data; ``id`` is the name of a file of no record."""

    id: str
    ok: Annotated[bool, Entry("whether it reproduces and every file is as it was entered")]
    verified: Annotated[bool, Entry("false of a legacy import, which has no data")]
    reason: Annotated[str | None, Entry("why it is not ok")]


_Judged = tuple[VerifiedRecord, tuple[str, ...]]


def verify_registry(registry: Registry, head: str | None = None) -> tuple[VerifiedRecord, ...]:
    """Return one row for every record and for every stray file; damage never raises.

    ``head`` is a ledger hash that was printed earlier: where no instrument's chain holds it, an end was
    cut off, and no record can be trusted.
    """
    rows: list[VerifiedRecord] = []
    if registry.folder.is_dir():
        rows += [
            _stray(path.name)
            for path in sorted(registry.folder.iterdir())
            if not path.is_dir() and path.name not in _FOLDER_KEEPERS
        ]
    rows += _people(registry)
    ledgers: dict[str, Ledger] = {}
    for instrument in registry.instruments():
        try:
            ledgers[instrument] = registry.ledger(instrument)
        except ToolkitError as error:
            ledgers[instrument] = Ledger(entries=(), damage=f"{error.what}: {error.got}")
    if head is not None and not any(e.sha256 == head for ledger in ledgers.values() for e in ledger.entries):
        damage = f"no line has the given head {head}: the end of a ledger was cut off"
        ledgers = {
            name: Ledger(entries=ledger.entries, damage=ledger.damage or damage)
            for name, ledger in ledgers.items()
        }
        if not ledgers:
            rows.append(VerifiedRecord(id=HEAD, ok=False, verified=False, reason=f"ledger: {damage}"))
    for instrument, ledger in ledgers.items():
        rows += _instrument(registry.folder / instrument, ledger)
        if ledger.damage is None and ledger.doubt is not None:
            reason = f"time: of the ledger of {instrument} {ledger.doubt}"
            rows.append(VerifiedRecord(id=LEDGER, ok=False, verified=False, reason=reason))
    for instrument in sorted(_attested(registry) - {*ledgers, FOLDER}):
        reason = "missing: people or witnesses have signed entries of its ledger"
        rows.append(VerifiedRecord(id=instrument, ok=False, verified=False, reason=reason))
    return tuple(rows)


def _attested(registry: Registry) -> set[str]:
    """Return the instruments of whose ledgers something was signed."""
    names = set(attested(registry.folder))
    with contextlib.suppress(ToolkitError):  # `_people` says what is wrong with them
        for heads in registry.people().heads:
            names |= {name for name, row in (heads or {}).items() if row.get("count")}
    return names


def _people(registry: Registry) -> list[VerifiedRecord]:
    """Return a row where the people's file of the home is not what the log of people says."""
    try:
        version = registry.people().history.now
        text = version and read_regular(registry.folder.parent / FILE).decode()
    except (ToolkitError, OSError, UnicodeDecodeError) as error:
        reason = f"people: {getattr(error, 'got', None) or error}"
    else:
        if version is None or text == version.text:
            return []
        reason = (
            "people: it is not the newest version of the log of people; what is typed into it decides nothing"
        )
    return [VerifiedRecord(id=FILE, ok=False, verified=False, reason=reason)]


def _instrument(folder: Path, ledger: Ledger) -> list[VerifiedRecord]:
    rows: list[VerifiedRecord] = []
    entered = ledger.entered()
    names = (path for path in folder.glob("*.json") if path.name not in (HEAD, *ledger.hidden))
    on_disk = {path.stem for path in names if ID.match(path.stem)}
    owned = {HEAD, LEDGER, *ledger.hidden}
    records = {record_id for record_id in {*on_disk, *entered} if ID.match(record_id)}
    ids = sorted(records, key=lambda record: (len(record), record))
    for row, files in _judged(folder, ids, ledger):
        rows.append(row)
        owned |= {f"{row.id}.json", *files}
    if ledger.damage is not None and not rows:
        rows.append(VerifiedRecord(id=LEDGER, ok=False, verified=False, reason=f"ledger: {ledger.damage}"))
    rows += [_stray(name) for name in _files(folder) if name not in owned and not is_passing(name)]
    return rows


def _judged(
    folder: Path, ids: Sequence[str], ledger: Ledger
) -> Iterator[tuple[VerifiedRecord, tuple[str, ...]]]:
    """Yield each record's row and the names of its files, in the order of ``ids``."""
    import functools
    import multiprocessing

    # A worker of somebody else's pool may not start processes of its own.
    alone = multiprocessing.current_process().daemon
    workers = 1 if alone or not can_fork() else min(processors(), 4)
    chunks = [ids[at : at + _CHUNK] for at in range(0, len(ids), _CHUNK)]
    if len(ids) < _SHARED_FROM or workers < 2:
        for chunk in chunks:
            yield from _judge(folder, chunk, ledger)
        return
    from concurrent.futures import ProcessPoolExecutor

    # A fork holds the parsed ledger already; nothing but ids and rows goes through the pipe.
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_share, initargs=(ledger,)) as pool:
        for judged in pool.map(functools.partial(_judge_shared, folder), chunks):
            yield from judged


_shared: list[Ledger] = []


def _share(ledger: Ledger) -> None:
    _shared[:] = [ledger]


def _judge_shared(folder: Path, ids: Sequence[str]) -> list[_Judged]:
    return _judge(folder, ids, _shared[0])


def _judge(folder: Path, ids: Sequence[str], ledger: Ledger) -> list[_Judged]:
    """Return the rows of some records and the names of their files."""
    loaded = load_many(folder, ids, ledger)
    return [_row(folder, record_id, result) for record_id, result in loaded.items()]


def _row(folder: Path, record_id: str, loaded: CalibrationRecord | ToolkitError) -> _Judged:
    if isinstance(loaded, ToolkitError):
        reason = f"{loaded.rule or 'unreadable'}: {loaded.what}"
        reason += f" (got {loaded.got}, expected {loaded.expected})" if loaded.got else ""
        row = VerifiedRecord(id=record_id, ok=False, verified=False, reason=reason)
        return row, tuple(_owned_by_bad(folder, record_id))
    row = VerifiedRecord(id=record_id, ok=True, verified=loaded.verified, reason=None)
    return row, tuple(part.file for part in loaded.data)


def _files(folder: Path) -> list[str]:
    """Return every file and link below a folder, as sorted names relative to it."""
    present: list[str] = []
    for top, folders, names in os.walk(folder):
        below = os.path.relpath(top, folder)
        links = [name for name in folders if os.path.islink(os.path.join(top, name))]  # noqa: PTH114, PTH118
        present += [name if below == "." else f"{below}/{name}" for name in (*names, *links)]
    return sorted(present)


def _owned_by_bad(folder: Path, record_id: str) -> set[str]:
    path = folder / f"{record_id}.json"
    try:
        return {part.file for part in from_bytes(read_regular(path), where=path).data}
    except (ToolkitError, OSError):
        # What belongs to a record that cannot be read is told by the record's own row.
        return {path.name for path in folder.glob(f"{record_id}.*")}


def _stray(name: str) -> VerifiedRecord:
    return VerifiedRecord(id=name, ok=False, verified=False, reason="stray: a file that belongs to no record")
