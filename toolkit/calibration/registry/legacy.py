"""A calibration of before the toolkit: coefficients that a source names, without the data behind them.

    schema = 1
    instrument = "m15"
    date = 2021-12-31            # of the source
    entered_by = "legacy import"
    zero = "included"
    indications = [{ name = "D51", unit = "lbf" }, { name = "E5", unit = "lbf" }]
    [source]
    title = "..."
    place = "section, page, table"
    text = "the equations as printed, or how they were found"
    [[loads]]
    load = "FY"
    unit = "lbf"
    coefficients = { D51 = 0.99719, E5 = 1.0228, intercept = 0.6473 }

The file is kept beside the record and the record is compared with it on every load. It stays *unverified*:
nothing shows that the coefficients follow from any data.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

from toolkit.calibration.records.record import CalibrationRecord, DataFile, sealed
from toolkit.calibration.registry.agreement import check_transcribed
from toolkit.calibration.registry.candidate import entering, next_id
from toolkit.calibration.registry.clock import check_begun
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.legacy_file import check_possible, read_legacy
from toolkit.calibration.registry.registry import Registry, load_checked
from toolkit.calibration.registry.status import discarded_before, is_discarded
from toolkit.calibration.registry.store import Change, commit
from toolkit.errors import ToolkitError
from toolkit.files import read_bytes, sha256_bytes


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

    source = read_bytes(path)
    unnumbered = read_legacy(source, where=path)
    check_possible(unnumbered, where=path)
    check_begun(dt.date.fromisoformat(unnumbered.date), "the source's date", f"{path}: date")
    unnumbered = dataclasses.replace(unnumbered, software=(("toolkit", __version__),))
    folder = registry.folder / unnumbered.instrument
    records: list[CalibrationRecord] = []

    def build(ledger: Ledger) -> Change | None:
        ended: list[str] = []
        for record_id in ledger.entered():
            try:
                twin = load_checked(folder, record_id, ledger)
            except ToolkitError:
                continue
            if twin.inputs_sha256 != unnumbered.inputs_sha256:
                continue
            if not is_discarded(ledger, record_id):
                records.append(twin)
                return None
            ended.append(record_id)
        if ended and not again:
            raise discarded_before(ledger, ended[-1], "the file", path)
        record = _numbered(unnumbered, next_id(folder, unnumbered.instrument, ledger), source)
        check_transcribed(record, source)
        records.append(record)
        return entering(record, {record.data[0].file: source}, by=record.entered_by)

    written = commit(folder, build)
    return records[0], not written


def _numbered(record: CalibrationRecord, record_id: str, source: bytes) -> CalibrationRecord:
    data = (DataFile(role="source", file=f"{record_id}.source.toml", sha256=sha256_bytes(source)),)
    return sealed(dataclasses.replace(record, id=record_id, data=data))
