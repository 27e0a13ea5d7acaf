"""`verify`: every record on disk or in a ledger, and every file that belongs to none."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.calibration.records.record import from_bytes
from toolkit.calibration.registry.ledger import HEAD, LEDGER, Ledger
from toolkit.calibration.registry.registry import ID, load_checked
from toolkit.errors import ToolkitError

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry

_FOLDER_KEEPERS = (".gitkeep", ".gitignore")


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyRow:
    """One row of `verify`: a record, or a file that belongs to none (``id`` is its name)."""

    id: str
    ok: bool
    verified: bool
    reason: str | None


def verify_registry(registry: Registry, head: str | None = None) -> tuple[VerifyRow, ...]:
    """Return one row for every record and for every stray file; damage never raises.

    ``head`` is a ledger hash that was printed earlier: where no instrument's chain holds it, an end was
    cut off, and no record can be trusted.
    """
    rows: list[VerifyRow] = []
    if registry.folder.is_dir():
        rows += [
            _stray(path.name)
            for path in sorted(registry.folder.iterdir())
            if not path.is_dir() and path.name not in _FOLDER_KEEPERS
        ]
    ledgers: dict[str, Ledger] = {}
    for instrument in registry.instruments():
        try:
            ledgers[instrument] = registry.ledger(instrument)
        except ToolkitError as error:
            ledgers[instrument] = Ledger(entries=(), damage=f"{error.what}: {error.got}")
    if head is not None and not any(e.sha256 == head for one in ledgers.values() for e in one.entries):
        damage = f"no line has the given head {head}: the end of a ledger was cut off"
        ledgers = {
            name: Ledger(entries=one.entries, damage=one.damage or damage) for name, one in ledgers.items()
        }
        if not ledgers:
            rows.append(VerifyRow(id=HEAD, ok=False, verified=False, reason=f"ledger: {damage}"))
    for instrument, ledger in ledgers.items():
        rows += _instrument(registry.folder / instrument, ledger)
    return tuple(rows)


def _instrument(folder: Path, ledger: Ledger) -> list[VerifyRow]:
    rows: list[VerifyRow] = []
    entered = ledger.entered()
    on_disk = {path.stem for path in folder.glob("*.json") if path.name != HEAD and ID.match(path.stem)}
    owned = {HEAD, LEDGER}
    records = {record_id for record_id in {*on_disk, *entered} if ID.match(record_id)}
    for record_id in sorted(records, key=lambda one: (len(one), one)):
        path = folder / f"{record_id}.json"
        owned.add(path.name)
        try:
            checked = load_checked(folder, record_id, ledger)
            owned |= {one.file for one in checked.data}
            rows.append(VerifyRow(id=record_id, ok=True, verified=checked.verified, reason=None))
        except ToolkitError as error:
            owned |= _owned_by_bad(folder, record_id)
            reason = f"{error.rule or 'unreadable'}: {error.what}"
            reason += f" (got {error.got}, expected {error.expected})" if error.got else ""
            rows.append(VerifyRow(id=record_id, ok=False, verified=False, reason=reason))
    if ledger.damage is not None and not rows:
        rows.append(VerifyRow(id=LEDGER, ok=False, verified=False, reason=f"ledger: {ledger.damage}"))
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if (path.is_file() or path.is_symlink()) and name not in owned:
            rows.append(_stray(name))
    return rows


def _owned_by_bad(folder: Path, record_id: str) -> set[str]:
    path = folder / f"{record_id}.json"
    try:
        return {one.file for one in from_bytes(path.read_bytes(), where=path).data}
    except (ToolkitError, OSError):
        # What belongs to a record that cannot be read is told by the record's own row.
        return {one.name for one in folder.glob(f"{record_id}.*")}


def _stray(name: str) -> VerifyRow:
    return VerifyRow(id=name, ok=False, verified=False, reason="stray: a file that belongs to no record")
