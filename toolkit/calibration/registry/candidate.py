"""How a record enters the registry: as a candidate from a fitted session, or from before the toolkit.

Of the latter a source names the coefficients, without the data behind them. Its file is kept beside the
record and the record is compared with it on every load. It stays *unverified*: nothing shows that the
coefficients follow from any data.
"""

from __future__ import annotations

import dataclasses
import functools
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.adequacy import check_levels
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.readings import SessionReadings, readings_of
from toolkit.calibration.fit.readings_findings import readings_findings
from toolkit.calibration.fit.session_fit import (
    LoadResult,
    SessionFit,
    fit_session,
    load_errors,
    load_uncertainty,
)
from toolkit.calibration.issued import issued_value
from toolkit.calibration.records.golden import (
    golden_inputs,
    predict_exactly,
    solve_exactly,
    solve_gls_precisely,
    solve_odr_precisely,
)
from toolkit.calibration.records.record import (
    CalibrationRecord,
    DataFile,
    Golden,
    Indication,
    LoadFit,
    from_bytes,
    sealed,
    to_bytes,
)
from toolkit.calibration.registry.agreement import check_agrees, check_inputs, check_transcribed
from toolkit.calibration.registry.clock import check_begun, now
from toolkit.calibration.registry.history import history_of, read_before
from toolkit.calibration.registry.judgement import judge, machine_of
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.legacy import check_possible, read_legacy
from toolkit.calibration.registry.plausible import coarse
from toolkit.calibration.registry.refit import check_reproduces, polarity, reference_u
from toolkit.calibration.registry.registry import ID, Registry, load_checked
from toolkit.calibration.registry.status import discarded_before, is_discarded
from toolkit.calibration.registry.store import Change
from toolkit.calibration.session.read import LoadSetting, Session, read_session
from toolkit.calibration.terms import term_matrix
from toolkit.errors import ToolkitError
from toolkit.files import sha256_bytes
from toolkit.findings import Finding
from toolkit.inputs import SETTINGS_FILE, read_input, read_regular
from toolkit.recording.sniff import sniff

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from fractions import Fraction

    from toolkit.calibration.dcc.standard import Standards


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """What `calibrate` made, or found: ``existing`` where the session was already recorded."""

    record: CalibrationRecord
    path: Path
    existing: bool
    fit: SessionFit
    readings: SessionReadings
    findings: tuple[Finding, ...]


def calibrate(
    session_file: Path,
    registry: Registry,
    *,
    machine: str | None = None,
    again: bool = False,
    standards: Standards | None = None,
) -> Candidate:
    """Fit a session and enter its record as a candidate.

    ``machine`` names or is the file of the machine definition whose polarity is held against the record;
    default: the packaged one of the instrument's name. The findings never change the fit. A session whose
    data and settings are already recorded returns that record and writes nothing. One whose record was
    discarded is refused with the discard's reason, unless it is to be entered ``again``, under a new id.
    ``standards``: whose digital certificates of reference standards count.

    Raises
    ------
    ConfigError, SessionError, UnitError
        the session cannot be used, or does not tell terms of its model; nothing is written
    RegistryError
        the ledger is damaged, the session lies in the future, or ``discarded``; nothing is written
    """
    session = read_session(session_file, standards=standards)
    check_begun(session.date, "the session's date", f"{session_file}: date")
    definition = machine_of(session.instrument, machine)
    folder = registry.folder / session.instrument
    fit = fit_session(session)
    before = partial(
        recorded, folder, inputs=session.inputs_sha256, what="the session", where=session.path, again=again
    )
    existing = before(ledger=registry.ledger(session.instrument))
    findings = session_findings(fit)
    if existing is not None:
        readings = readings_of(existing, session.table)
        findings += readings_findings(readings, session.path.name)
        findings += _uncertain(existing, session)
        path = folder / f"{existing.id}.json"
        return Candidate(
            record=existing, path=path, existing=True, fit=fit, readings=readings, findings=findings
        )
    check_levels(session)
    records: list[CalibrationRecord] = []
    unnumbered = _record(fit)
    # Before anything is written: what cannot be evaluated must not leave a record behind.
    readings = readings_of(unnumbered, session.table)
    findings += readings_findings(readings, session.path.name)
    findings += _uncertain(unnumbered, session)

    def build(ledger: Ledger) -> Change | None:
        # Under the lock: another writer may have recorded this very session meanwhile.
        twin = before(ledger=ledger)
        if twin is not None:
            records.append(twin)
            return None
        record = _numbered(unnumbered, next_id(folder, session.instrument, ledger), session)
        check_agrees(record, session.session_bytes, session.table, session.dcc_bytes)
        check_reproduces(record, session.table)
        check_inputs(record)
        records.append(record)
        return entering(record, _contents(session, record), by=session.operator)

    # Before the write: a last approved record that fails its gates must stop this, not follow it.
    ledger = registry.ledger(session.instrument)
    history = history_of(registry, unnumbered, ledger)
    read_again = read_before(registry, unnumbered, session.table, ledger)
    record_id = registry.commit(folder.name, build)
    record = records[0]
    if record_id:
        judged = judge(
            unnumbered, history=history, machine=definition, loads=session.table, check=session.check
        )
        # What a gate says takes the place of the same in the session's own words: its level is the gate's.
        by_gates = {
            (result.rule, result.where): result.finding() for result in (*judged.results, *read_again)
        }
        findings = tuple(by_gates.pop((entry.rule, entry.where), entry) for entry in findings)
        findings += tuple(by_gates.values())
    return Candidate(
        record=record,
        path=folder / f"{record.id}.json",
        existing=not record_id,
        fit=fit,
        readings=readings,
        findings=findings,
    )


def _uncertain(record: CalibrationRecord, session: Session) -> tuple[Finding, ...]:
    return tuple(result.finding() for result in coarse(record, session.table, session.check))


def entering(record: CalibrationRecord, contents: Mapping[str, bytes], *, by: str) -> Change:
    """Return the transaction that enters a sealed record with its data files (by file name)."""
    data = to_bytes(record)
    return Change(
        files={**contents, f"{record.id}.json": data},
        event={
            "event": "entered",
            "id": record.id,
            "time": now(),
            "by": by,
            "record": record.sha256,
            "file": sha256_bytes(data),
            "inputs": record.inputs_sha256,
        },
    )


def next_id(folder: Path, instrument: str, ledger: Ledger) -> str:
    """Return the next free id: after every number in the ledger and in the names of the folder's files."""
    names = {entry.id for entry in ledger.entries}
    names |= {path.name.split(".json")[0] for path in folder.glob(f"{instrument}-r*.json")}
    numbers = [int(m["number"]) for m in map(ID.match, names) if m and m["instrument"] == instrument]
    return f"{instrument}-r{max(numbers, default=0) + 1}"


def recorded(
    folder: Path, ledger: Ledger, inputs: str, *, what: str, where: Path, again: bool = False
) -> CalibrationRecord | None:
    """Return the record of the same data and settings (``inputs``, their hash); None where there is none.

    Raises
    ------
    RegistryError
        ``discarded``: there was one, and it is not to be entered ``again``; ``what`` and ``where`` name it
    """
    ended: list[str] = []
    for record_id, entry in ledger.entered().items():
        # What the line tells is only where to look: the record found passes its gates, its inputs too.
        if entry.inputs not in (None, inputs):
            continue
        path = folder / f"{record_id}.json"
        try:
            # The gates cost a refit: only the record that claims these inputs goes through them.
            if from_bytes(read_regular(path), where=path).inputs_sha256 == inputs:
                if is_discarded(ledger, record_id):
                    ended.append(record_id)
                    continue
                return load_checked(folder, record_id, ledger)
        except (ToolkitError, OSError):
            continue
    if ended and not again:
        raise discarded_before(ledger, ended[-1], what, where)
    return None


def _contents(session: Session, record: CalibrationRecord) -> dict[str, bytes]:
    by_role = {"loads": session.data_bytes, "check": session.check_bytes, "session": session.session_bytes,
               "dcc": session.dcc_bytes}  # fmt: skip
    return {part.file: by_role[part.role] or b"" for part in record.data}


def _record(fit: SessionFit) -> CalibrationRecord:
    session = fit.session
    columns = session.table.columns(session.indications)
    ranges = [(float(columns[n].min()), float(columns[n].max())) for n in session.indications]
    return CalibrationRecord(
        id="",
        instrument=session.instrument,
        kind="fit",
        date=session.date.isoformat(),
        entered_by=session.operator,
        zero=session.zero,
        cells=tuple(
            Indication(
                name=c.name,
                unit=c.unit,
                minimum=low,
                maximum=high,
                serial=c.serial,
                column_unit=c.column_unit,
                step=c.step,
            )
            for c, (low, high) in zip(session.cells, ranges, strict=True)
        ),
        loads=tuple(_load_fit(session, load) for load in fit.loads),
        golden=_golden(session, ranges),
        data=(),
        settings=session.settings,
        inputs_sha256=session.inputs_sha256,
        software=_software(),
    )


def _numbered(record: CalibrationRecord, record_id: str, session: Session) -> CalibrationRecord:
    files = [
        ("loads", session.data_bytes),
        ("check", session.check_bytes),
        ("session", session.session_bytes),
        ("dcc", session.dcc_bytes),
    ]
    data = tuple(
        DataFile(role=role, file=f"{record_id}.{role}.{_suffix(role, data)}", sha256=sha256_bytes(data))
        for role, data in files
        if data is not None
    )
    return sealed(dataclasses.replace(record, id=record_id, data=data))


def _suffix(role: str, data: bytes) -> str:
    # By its content, as the reader goes: the name in the session may be any.
    return {"session": "toml", "dcc": "xml"}.get(role) or ("xlsx" if sniff(data).id == "zip" else "csv")


def _load_fit(session: Session, load: LoadResult) -> LoadFit:
    values = session.table.column(load.setting.name)
    largest = float(np.abs(values).max())
    terms = term_matrix(session.terms, session.table.columns(session.indications))
    extent = np.abs(terms).max(axis=0).tolist()
    c = load.fit.coefficients
    return LoadFit(
        load=load.setting.name,
        unit=load.setting.unit,
        terms=load.fit.terms,
        coefficients=c,
        issued=tuple(issued_value(value, e, largest) for value, e in zip(c, extent, strict=True)),
        polarity=polarity(c),
        covariance=tuple(tuple(row) for row in load.fit.covariance.tolist()),
        method=session.method,
        n=len(values),
        dof=load.fit.dof,
        residual_sd=load.fit.residual_sd,
        minimum=float(values.min()),
        maximum=float(values.max()),
        tolerance=load.setting.tolerance,
        scatter=load.scatter,
        rounding=load.rounding,
        reference_u=reference_u(session.table, load.setting.name, load.setting.unit, session.method),
    )


def _golden(session: Session, ranges: list[tuple[float, float]]) -> Golden:
    columns = {n: values.tolist() for n, values in session.table.columns(session.indications).items()}
    inputs = golden_inputs(ranges)
    outputs = []
    for setting in session.loads:
        exact = _precise(session, setting, columns)
        outputs.append(
            tuple(
                predict_exactly(
                    terms=session.terms, coefficients=exact, names=session.indications, point=point
                )
                for point in inputs
            )
        )
    return Golden(inputs=inputs, outputs=tuple(outputs))


def _precise(
    session: Session, setting: LoadSetting, columns: Mapping[str, Sequence[float]]
) -> tuple[Fraction, ...]:
    """Return a load's coefficients, computed apart from the fit."""
    load = session.table.column(setting.name).tolist()
    if session.method in ("ols", "wls"):
        u = load_uncertainty(session, setting)
        weights = None if u is None else (1.0 / u**2).tolist()
        return solve_exactly(terms=session.terms, columns=columns, load=load, weights=weights)
    errors = load_errors(session, setting)
    deviations = None if errors.u is None else errors.u.tolist()
    if session.method == "gls":
        return solve_gls_precisely(
            terms=session.terms, columns=columns, load=load, u=deviations, group=errors.group.tolist(),
            u_shared=errors.u_shared, proportional=errors.proportional,
        )  # fmt: skip
    return solve_odr_precisely(
        terms=session.terms, columns=columns, load=load, u=deviations or [], u_cells=errors.u_cells.tolist()
    )


@functools.cache
def _software() -> tuple[tuple[str, str], ...]:
    import platform
    from importlib.metadata import version

    from toolkit.version import __version__

    packages = tuple((name, version(name)) for name in ("numpy", "scipy", "statsmodels"))
    return tuple(sorted((*packages, ("python", platform.python_version()), ("toolkit", __version__))))


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
        record = _numbered_source(unnumbered, next_id(folder, unnumbered.instrument, ledger), source)
        check_transcribed(record, source)
        records.append(record)
        change = entering(record, {record.data[0].file: source}, by=record.entered_by)
        return dataclasses.replace(change, action="import")

    written = registry.commit(folder.name, build)
    return records[0], not written


def _numbered_source(record: CalibrationRecord, record_id: str, source: bytes) -> CalibrationRecord:
    data = (DataFile(role="source", file=f"{record_id}.source.toml", sha256=sha256_bytes(source)),)
    return sealed(dataclasses.replace(record, id=record_id, data=data))
