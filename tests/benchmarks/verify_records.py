"""`verify` of 1 000 records; the peer reads and hashes the same files.

Each record is a session of its own: three cells, two loads, 60 rows, a check file. They are fitted one by
one, as `calibrate` does, and entered into one ledger without its lock and its disk flushes.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from tests.benchmarks.timing import pairs, row

RECORDS = 1000
# mV/V at the largest FY, MZ and MX (a load that the sessions vary and do not fit): a plausible hub.
_SENSITIVITY = np.array([[1.0, 0.3, 0.2], [1.2, -0.3, 0.3], [0.5, 0.1, -0.6]])
_LARGEST = (5000.0, 250.0)
SESSION = """\
schema = 1
instrument = "bench"
date = 2026-01-05
operator = "operator {number}"
temperature = {{ value = 20.{number}, unit = "degC" }}
indications = ["D51", "D52", "E5"]
loads = ["FY", "MZ"]
data = "loads.csv"

[check]
file = "check.csv"
tolerance = {{ FY = {{ value = 5.0, unit = "N" }}, MZ = {{ value = 1.0, unit = "N*m" }} }}

[reference]
standard = "deadweights"
certificate = "C-{number}"
due = 2027-01-05

[reference.uncertainty]
FY = {{ U = 1.0, k = 2.0, unit = "N" }}
MZ = {{ U = 0.2, k = 2.0, unit = "N*m" }}

[cells.D51]
serial = "51-{number}"
resolution = 1e-5

[cells.D52]
serial = "52-{number}"
resolution = 1e-5

[cells.E5]
serial = "E5-{number}"
resolution = 1e-5
"""


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time `verify` and the bare reading and hashing of every file, imports excluded."""
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.verify import verify_registry

    registry = Registry(folder / "calibrations")
    if not registry.folder.exists():
        enter_sessions(registry.folder, RECORDS)
    files = sorted(path for path in registry.folder.rglob("*") if path.is_file())

    def ours() -> None:
        rows = verify_registry(registry)
        if len(rows) != RECORDS or not all(one.ok for one in rows):
            raise RuntimeError("verify did not pass every record")

    def peer() -> object:
        return [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]

    times = pairs(ours, peer, count)
    return [row(f"verify of {RECORDS} records", times[0], "read and hash their files", times[1], "3")]


def enter_sessions(folder: Path, count: int) -> None:
    """Fit ``count`` sessions of seeded data and write their records and ledger to ``folder``."""
    from toolkit.calibration.fit.session_fit import fit_session
    from toolkit.calibration.registry import candidate
    from toolkit.calibration.registry.ledger import HEAD, LEDGER, START, head_bytes, next_line
    from toolkit.calibration.session.read import read_session

    home, work = folder / "bench", folder.parent / "session"
    home.mkdir(parents=True)
    work.mkdir()
    lines, head = [], START
    for number in range(1, count + 1):
        rng = np.random.default_rng(number)
        for name, rows, runs in (("loads", 60, True), ("check", 9, False)):
            (work / f"{name}.csv").write_text(data_table(rng, rows, runs))
        (work / "SESSION.toml").write_text(SESSION.format(number=number))
        session = read_session(work / "SESSION.toml")
        record = candidate._numbered(candidate._record(fit_session(session)), f"bench-r{number}", session)
        change = candidate.entering(record, candidate._contents(session, record), by=session.operator)
        for file, data in change.files.items():
            (home / file).write_bytes(data)
        line, head = next_line(number, head, change.event)
        lines.append(line)
    (home / LEDGER).write_bytes(b"".join(lines))
    (home / HEAD).write_bytes(head_bytes(count, head))


def data_table(rng: np.random.Generator, rows: int, runs: bool) -> str:
    shares = rng.uniform(-1, 1, (rows, 3))
    cells = shares @ _SENSITIVITY.T + rng.normal(0, 2e-5, (rows, 3))
    text = [
        ",".join(["D51 [mV/V],D52 [mV/V],E5 [mV/V],FY [N],MZ [N*m]", *(["run,direction"] if runs else [])])
    ]
    for at, values in enumerate(np.column_stack([cells, shares[:, :2] * _LARGEST]).round(6).tolist()):
        tail = [str(at // 20 + 1), "up" if at % 20 < 10 else "down"] if runs else []
        text.append(",".join([*map(repr, values), *tail]))
    return "\n".join(text) + "\n"
