"""A record's session, read again from the files that lie beside it."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.calibration.session.read import Session, read_session
from toolkit.calibration.session.settings import parse_session
from toolkit.errors import RecordError

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord


def stored_session(registry: Path, record: CalibrationRecord) -> Session:
    """Return the session that a record was fitted from, by the reader that read it then.

    ``registry`` is the registry's folder; the record has been checked (`Registry.load`), and with it the
    hashes of its files.

    Raises
    ------
    RecordError
        ``data``: a legacy import, which has no session
    """
    folder = registry / record.instrument
    files = {one.role: (folder / one.file).read_bytes() for one in record.data}
    if "session" not in files or "loads" not in files:
        raise RecordError(
            f"record {record.id} has no reference loads to report on",
            where=folder,
            got="a legacy import",
            expected="a record that was fitted from a session",
            next_step="see 'toolkit calibration show' for its coefficients and their source",
            rule="data",
        )
    raw = parse_session(files["session"], where=folder / f"{record.id}.session.toml")
    entry = raw.get("check")
    check = (
        entry if isinstance(entry, str) else (entry or {}).get("file", (entry or {}).get("data", "check.csv"))
    )
    with tempfile.TemporaryDirectory() as place:
        # The session names its files as they were called when it was recorded.
        for name, role in ((raw["data"], "loads"), (check, "check")):
            if role in files:
                target = Path(place, str(name)).resolve()
                if not target.is_relative_to(Path(place).resolve()):
                    continue  # the reader refuses such a name, and says so
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(files[role])
        path = Path(place) / "SESSION.toml"
        path.write_bytes(files["session"])
        return read_session(path, entered=True)
