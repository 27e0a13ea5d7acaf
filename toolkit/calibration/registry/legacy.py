"""A calibration of before the toolkit: coefficients that a source names, without the data behind them.

The file is kept beside the record and the record is compared with it on every load. It stays *unverified*:
nothing shows that the coefficients follow from any data.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from toolkit.calibration.records.record import CalibrationRecord, DataFile, sealed
from toolkit.calibration.registry.agreement import check_transcribed
from toolkit.calibration.registry.candidate import entering, next_id, recorded
from toolkit.calibration.registry.clock import check_begun
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.legacy_file import check_possible, read_legacy
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.store import Change
from toolkit.files import sha256_bytes
from toolkit.inputs import SETTINGS_FILE, read_input


def import_legacy(path: Path, registry: Registry, *, again: bool = False) -> tuple[CalibrationRecord, bool]:
    """Enter a legacy record; return it, and whether it was there already.

    A file whose record was discarded is refused, unless it is to be entered ``again``, under a new id.

    Raises
    ------
    ConfigError, SessionError, UnitError
        the file: unknown key, missing value, unknown unit, a term that cannot be read, or what no
        calibration can have given (`check_possible`)
    RegistryError
        the ledger is damaged, the source is dated in the future, or ``discarded``
    """
    import datetime as dt

    from toolkit.version import __version__

    source = read_input(path, SETTINGS_FILE)
    unnumbered = read_legacy(source, where=path)
    check_possible(unnumbered, where=path)
    check_begun(dt.date.fromisoformat(unnumbered.date), "the source's date", f"{path}: date")
    unnumbered = dataclasses.replace(unnumbered, software=(("toolkit", __version__),))
    folder = registry.folder / unnumbered.instrument
    records: list[CalibrationRecord] = []

    def build(ledger: Ledger) -> Change | None:
        twin = recorded(folder, ledger, unnumbered.inputs_sha256, what="the file", where=path, again=again)
        if twin is not None:
            records.append(twin)
            return None
        record = _numbered(unnumbered, next_id(folder, unnumbered.instrument, ledger), source)
        check_transcribed(record, source)
        records.append(record)
        change = entering(record, {record.data[0].file: source}, by=record.entered_by)
        return dataclasses.replace(change, action="import")

    written = registry.commit(folder.name, build)
    return records[0], not written


def _numbered(record: CalibrationRecord, record_id: str, source: bytes) -> CalibrationRecord:
    data = (DataFile(role="source", file=f"{record_id}.source.toml", sha256=sha256_bytes(source)),)
    return sealed(dataclasses.replace(record, id=record_id, data=data))
