"""What waits for a person today: candidates, overdue checks, drifting charts, tests, audits.

Each question is one function, because each takes another time: a ledger is read in milliseconds, a chart
reads every session. What `calibration list`, `due` and `chart` answer is asked of them, and only picked from.
"""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError, ToolkitError

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.desk.holdings import Holdings
    from toolkit.lab.records.registry_answer import RecordRow, RefusedRow

SOON_DAYS = 30
"""A check that is due in so many days stands on the agenda."""


def instruments_answer(registry: Registry, today: dt.date) -> list[dict[str, Any]]:
    """Return each instrument with its ledger and its witnesses, from the ledgers alone: no record is read."""
    return [_instrument(registry, name, today) for name in registry.instruments()]


def _instrument(registry: Registry, name: str, today: dt.date) -> dict[str, Any]:
    ledger = registry.ledger(name)
    row: dict[str, Any] = {
        "instrument": name, "count": len(ledger.entries), "sha256": ledger.head, "damage": ledger.damage,
        "in_force": None, "states": {}, "witnesses": _witnesses(registry, name),
    }  # fmt: skip
    if ledger.damage is not None:
        return row
    for status in registry.statuses(name).values():
        row["states"][status.state] = row["states"].get(status.state, 0) + 1
    row["in_force"] = registry.id_in_force(name, on=today)
    return row


def _witnesses(registry: Registry, instrument: str) -> list[dict[str, Any]]:
    """Return what each witness has countersigned of a ledger: how many entries, and whether they stand."""
    from toolkit.lab.signatures.people import check_against
    from toolkit.trust.checkpoint import SUFFIX, remembered

    rows: list[dict[str, Any]] = []
    for path in sorted((registry.folder.parent / "trust" / "witnessed").glob(f"{instrument}-*{SUFFIX}")):
        name = path.name.removeprefix(f"{instrument}-").removesuffix(SUFFIX)
        try:
            checkpoint = remembered(path)
            if checkpoint is None or checkpoint.origin != f"toolkit/{instrument}":
                continue  # of an instrument whose name begins with this one's
            _, comparison = check_against(registry, instrument, path)
        except ToolkitError as error:
            rows.append({"name": name, "size": None, "state": "unreadable", "why": str(error.got)})
            continue
        rows.append(
            {"name": name, "size": checkpoint.size, "state": comparison.continuity, "why": comparison.why}
        )
    return rows


def candidates_answer(registry: Registry) -> list[RecordRow | RefusedRow]:
    """Return the candidates as `calibration list` has them; one that fails its gates says so."""
    from toolkit.lab.records.registry_answer import record_row

    rows: list[RecordRow | RefusedRow] = []
    for name in registry.instruments():
        if registry.ledger(name).damage is not None:
            continue
        for record_id, status in registry.statuses(name).items():
            if status.state != "candidate":
                continue
            try:
                rows.append(record_row(registry.load(record_id), status, registry.signature(record_id)))
            except ToolkitError as error:
                rows.append(
                    {"id": record_id, "status": "refused", "rule": error.rule, "reason": str(error.got)}
                )
    return rows


def due_soon(registry: Registry, today: dt.date) -> dict[str, Any]:
    """Return `calibration due` of all instruments; ``soon`` holds those that are overdue or nearly due."""
    from toolkit.lab.records.control_answer import due_answer

    payload, _, _ = due_answer(registry, None, today)
    soon = [row for row in payload["instruments"] if row.days_left is not None and row.days_left <= SOON_DAYS]
    return {**payload, "soon": soon}


def drifting(registry: Registry) -> list[dict[str, Any]]:
    """Return the findings of `calibration chart` of every instrument that has one."""
    from toolkit.lab.records.control_answer import chart_answer

    rows: list[dict[str, Any]] = []
    for name in registry.instruments():
        try:
            payload, _, _ = chart_answer(registry, name, load=None, baseline=None, out=None)
        except ConfigError:  # too few sessions for a chart: nothing can drift
            continue
        except ToolkitError as error:
            rows.append({"instrument": name, "rule": error.rule, "where": name, "message": str(error.what)})
            continue
        rows += [{"instrument": name, **finding} for finding in payload["findings"]]
    return rows


@dataclass(frozen=True, slots=True)
class Work:
    """What lies in a home beside its registry.

    ``tests`` and ``audits`` count them; the tuples name those that wait, by their path in the home.
    """

    tests: int
    audits: int
    without_report: tuple[str, ...]
    unfinished: tuple[str, ...]


def work_of(home: Path) -> Work:
    """Look through a home for tests that no report rests on, and audits that were interrupted.

    A test has a report where some manifest of the home names its ``test.toml`` by its content, or, of a
    report of a reduced test, all its recordings: a test whose statements or recordings changed since has
    none. An audit is unfinished while its results are newer than its answer.
    """
    from toolkit.lab.desk.holdings import holdings_of, reported_inputs

    holdings = holdings_of(home)
    reported = reported_inputs(holdings)
    tests = holdings.places["test"].values()
    return Work(
        tests=len(tests),
        audits=len(holdings.places["audit"]),
        without_report=tuple(
            place for place in tests if not reported.rests_on(home / place, _sha256(home / place))
        ),
        unfinished=unfinished_audits(holdings),
    )


def unfinished_audits(holdings: Holdings) -> tuple[str, ...]:
    """Return the places of the audits whose results are newer than their answer."""
    from toolkit.audit.resume import RESULTS
    from toolkit.lab.archives.audit import LINES

    return tuple(
        place
        for place in holdings.places["audit"].values()
        if not _is_finished(holdings.home / place / RESULTS, holdings.home / place / LINES)
    )


def _sha256(test: Path) -> str | None:
    from toolkit.files import sha256_bytes
    from toolkit.inputs import SETTINGS_FILE, read_regular
    from toolkit.recording.folder import TEST_FILE

    try:
        return sha256_bytes(read_regular(test / TEST_FILE, SETTINGS_FILE))
    except OSError:
        return None


def _is_finished(results: Path, lines: Path) -> bool:
    if not results.is_file():  # only the answer was kept
        return True
    try:
        return lines.stat().st_mtime_ns >= results.stat().st_mtime_ns
    except OSError:
        return False
