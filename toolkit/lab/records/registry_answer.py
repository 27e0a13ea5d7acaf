"""What `calibration list, show, history, diff` say of records: keys of the JSON, lines of the text."""

from __future__ import annotations

import dataclasses
import datetime as dt
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

from toolkit.calibration.records.use import UNSIGNED
from toolkit.calibration.registry.standing import approved_after
from toolkit.calibration.uncertainty.common_errors import standard_errors
from toolkit.declared.answers import entry_of
from toolkit.estimate import round_uncertainty
from toolkit.lab.records.gates_answer import Found, Judged, Responses
from toolkit.listing import or_dash, table

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.registry.ledger import Entry as LedgerEntry
    from toolkit.calibration.registry.ledger import Ledger
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.status import RecordStatus


class DifferenceAnswer(TypedDict):
    """Two records, term by term."""

    records: Annotated[list[str], "first and second"]
    terms: Annotated[
        list[Mapping[str, Any]],
        "load, term, unit; under each record's id its coefficient, or null; change, change_percent; effect, "
        "the largest load that the change moves [unit]; effect_percent_fs; differs; note",
    ]


class RecordRow(TypedDict):
    """A record and what its ledger tells of it."""

    id: str
    instrument: str
    sha256: str
    status: Annotated[str, "candidate, approved, superseded, withdrawn, discarded or refused"]
    verified: Annotated[bool, "false of a legacy import"]
    date: Annotated[str, "of the session"]
    in_force_from: str | None
    void_from: str | None
    void_always: bool
    entered_by: str | None
    checked_by: str | None
    approved_by: str | None
    reason: str | None
    unverifiable: Annotated[list[str], "terms that no check load verifies"]
    recall: str | None
    approved_later: Annotated[
        str | None,
        "day of its approval, where that lies after --known-at: it serves where no earlier one does",
    ]
    signature: str


class RefusedRow(TypedDict):
    """A record that is refused: nothing that it says holds."""

    id: str
    status: str
    rule: str | None
    reason: str


class Head(TypedDict):
    """The end of an instrument's ledger."""

    count: Annotated[int, "entries"]
    sha256: str
    damage: Annotated[str | None, "what is wrong with the ledger"]


class ListAnswer(TypedDict):
    """The records of a registry."""

    records: Sequence[RecordRow | RefusedRow]
    heads: Annotated[Mapping[str, Head], "by instrument"]
    hidden: Annotated[int, "discarded records that are not listed"]


class CellEntry(TypedDict):
    """An indication of a record."""

    name: str
    unit: str
    serial: str | None
    minimum: float | None
    maximum: float | None


class RecordLoad(TypedDict):
    """The equation of one load."""

    unit: str
    coefficients: Annotated[Mapping[str, float], "in full, by term"]
    issued: Annotated[Mapping[str, float], "in the digits of the certificate"]
    standard_errors: Annotated[Mapping[str, float | None] | None, "null of a legacy import"]
    covariance_model: str | None
    scatter: Annotated[Mapping[str, Any] | None, "parts of the scatter, where runs differ"]
    residual_sd: float | None
    dof: float | None
    n: int | None
    method: str | None
    minimum: float | None
    maximum: float | None
    check_tolerance: float | None
    check_max: Annotated[float | None, "largest error of a check load"]


class StoredFile(TypedDict):
    """A file that lies beside a record."""

    role: str
    file: str
    sha256: str


class RecordContent(TypedDict):
    """What a record holds."""

    zero: str
    indication_units: Mapping[str, str]
    indications: list[CellEntry]
    loads: Annotated[Mapping[str, RecordLoad], "by load"]
    data: list[StoredFile]


class ShowAnswer(RecordContent):
    """One record; with --full what an approval meets."""

    record: RecordRow
    head: Annotated[str, "of the ledger"]
    judged: NotRequired[Judged]
    responses: NotRequired[Responses]
    as_found: NotRequired[Annotated[Found | None, "null where no session stands behind the record"]]


class Event(TypedDict):
    """An entry of the ledger."""

    seq: int
    id: str
    event: str
    time: str
    by: str | None
    approved_by: str | None
    known_on: str | None
    since: str | None
    reason: str | None
    note: str | None
    recall: str | None
    unverifiable: list[str]
    evidence: list[str]
    sha256: str
    clock: NotRequired[Annotated[str, "state of the computer's clock"]]
    signed_by: NotRequired[list[str]]


class HistoryAnswer(TypedDict):
    """What happened to an instrument's records."""

    events: list[Event]
    head: str
    damage: str | None


def listed(
    registry: Registry, instrument: str | None, *, known_at: dt.date | None, everything: bool
) -> tuple[ListAnswer, str, bool]:
    """Return the records with their state as JSON and as text, and whether all of them are sound.

    ``everything`` lists discarded candidates too.

    Raises
    ------
    RegistryError
        ``missing``: there is no such instrument, and nothing says that there was one
    """
    unknown = instrument is not None and instrument not in registry.instruments()
    if instrument is not None and unknown and registry.ledger(instrument).damage is None:
        raise registry.no_instrument(instrument)
    rows: list[RecordRow | RefusedRow] = []
    heads: dict[str, Head] = {}
    known: dict[str, RecordStatus] = {}
    bad = hidden = 0
    for name in [instrument] if instrument else registry.instruments():
        ledger = registry.ledger(name)
        heads[name] = {"count": len(ledger.entries), "sha256": ledger.head, "damage": ledger.damage}
        good, refused = registry.usable(name)
        bad += len(refused) + (ledger.damage is not None)
        statuses = registry.statuses(name, known_at=known_at) if good else {}
        known |= {record.id: statuses[record.id] for record in good}
        signatures = registry.signatures(name) if good else {}
        all_rows = [record_row(record, statuses[record.id], signatures[record.id]) for record in good]
        shown = [row for row in all_rows if everything or row["status"] != "discarded"]
        hidden += len(all_rows) - len(shown)
        rows += shown
        rows += [
            {"id": record.id, "status": "refused", "rule": record.rule, "reason": record.reason}
            for record in refused
        ]
    lines = table(
        ["id", "state", "in force from", "void from", "verified", "signed", "sha256", "note"],
        [
            [str(cell) for cell in _line(row)]
            for row in rows
        ],
        align="<" * 8,
    )  # fmt: skip
    hidden_line = [f"discarded and not shown: {hidden} (--all)"] if hidden else []
    later = [
        f"{record_id}: {approved_after(status.approved_later, known_at)}"
        for record_id, status in known.items()
        if status.approved_later is not None and known_at is not None
    ]
    heads_text = [f"head of {n}: {h['sha256']}" for n, h in heads.items()]
    text = "\n".join([lines or "no records", *later, *hidden_line, "", *heads_text])
    return {"records": rows, "heads": heads, "hidden": hidden}, text, not bad


def _line(row: RecordRow | RefusedRow) -> tuple[str | None, ...]:
    if "rule" in row:
        return (row["id"], row["status"], "", "", "no", UNSIGNED, "", row["reason"])
    signed = UNSIGNED if row["signature"] == UNSIGNED else "yes"
    return (
        row["id"], row["status"], row["in_force_from"] or "", row["void_from"] or "",
        "yes" if row["verified"] else "no", signed, row["sha256"][:12], row["reason"] or "",
    )  # fmt: skip


def shown(registry: Registry, record_id: str, *, known_at: dt.date | None) -> tuple[ShowAnswer, str]:
    """Return a record with its state, cells, loads and files, as JSON and as text."""
    record = registry.load(record_id)
    row = record_row(record, registry.status(record_id, known_at=known_at), registry.signature(record_id))
    lines = [f"{key:<14}{_plainly(value)}" for key, value in row.items() if value not in (None, "", [])]
    content, content_lines = _described(record, registry.folder)
    head = registry.head(record.instrument)
    lines += [f"{'ledger head':<14}{head}", *content_lines]
    answer: ShowAnswer = {"record": row, "head": head, **content}  # type: ignore[typeddict-item]
    return answer, "\n".join(lines)


def history(ledger: Ledger, instrument: str, name: str) -> tuple[HistoryAnswer, str]:
    """Return what happened to an instrument's records, or to the one record named, as JSON and as text."""
    entries = [entry for entry in ledger.entries if name in (instrument, entry.id)]
    events = [_event(entry) for entry in entries]
    lines = [
        f"{e['seq']:>3}  {e['time']}  {e['id']}  {e['event']:<10}by {e['by']}"
        + (f", since {e['since']}" if e["since"] else "")
        + (f", known on {e['known_on']}" if e["known_on"] else "")
        + (f", {e['note']}" if e["note"] else "")
        + (f", recall after {e['recall']}" if e["recall"] else "")
        + (f", signed by {' and '.join(row['by'] for row in entry.signatures)}" if entry.signatures else "")
        + (f", clock {entry.clock}" if entry.clock not in (None, "synchronised") else "")
        + (f"\n     {e['reason']}" if e["reason"] else "")
        + "".join(f"\n     {text}" for text in entry.evidence)
        for e, entry in zip(events, entries, strict=True)
    ]
    lines += [f"head {ledger.head}", *([f"DAMAGED: {ledger.damage}"] if ledger.damage else [])]
    return {"events": events, "head": ledger.head, "damage": ledger.damage}, "\n".join(lines)


def _event(entry: LedgerEntry) -> Event:
    event = entry_of(Event, entry)
    if not entry.clock:
        del event["clock"]
    if entry.signatures:
        event["signed_by"] = [row["by"] for row in entry.signatures]
    return event


def difference(registry: Registry, first: str, second: str) -> tuple[dict[str, Any], str, bool]:
    """Return two records term by term as JSON and as text, and whether they differ."""
    from toolkit.calibration.registry.response import differences

    terms = differences(registry.load(first), registry.load(second))
    rows: list[dict[str, Any]] = []
    for term in terms:
        row = dataclasses.asdict(term)
        rows.append(
            {**{k: v for k, v in row.items() if k not in ("one", "other")}, first: term.one,
             second: term.other}
        )  # fmt: skip
    text = table(
        ["load", "term", first, second, "change", "change %", "moves at most", "% of full scale"],
        [
            [
                t.load, t.term, or_dash(t.one, ".10g"), or_dash(t.other, ".10g"), or_dash(t.change, ".10g"),
                or_dash(t.change_percent, "+.3g"),
                "-" if t.effect is None else f"{t.effect:.4g} {t.unit}",
                or_dash(t.effect_percent_fs, ".3g"),
            ]
            for t in terms
        ],
        align="<<>>>>>>",
    )  # fmt: skip
    notes = [f"{t.load}, {t.term}: {t.note}" for t in terms if t.note]
    text += "".join(f"\n{note}" for note in ("", *notes)) if notes else ""
    if any("then in" in note for note in notes):
        text += f"\n\nwhere a unit changed, the change is in the units of {first}"
    if any(t.change and t.effect is None for t in terms):
        text += "\n\nno effect is given where neither record holds a range: a legacy import has none"
    return {"records": [first, second], "terms": rows}, text, any(t.differs for t in terms)


def _plainly(value: object) -> object:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "; ".join(map(str, value)) if isinstance(value, list) else value


def void_day(status: RecordStatus) -> str | None:
    """Return the first day on which a record is void; None without one."""
    # A record that was never in force is void from the beginning of time: no date to print.
    if status.void_from is None or status.void_from == dt.date.min:
        return None
    return status.void_from.isoformat()


def record_row(record: CalibrationRecord, status: RecordStatus, signature: str) -> RecordRow:
    """Return a record and what its ledger tells of it, as one row of the list."""
    return entry_of(
        RecordRow, status, record, status=status.state, void_from=void_day(status), signature=signature
    )


def _described(record: CalibrationRecord, registry: Path) -> tuple[RecordContent, list[str]]:
    """Return a record as JSON values, and as lines of text. ``registry`` is the registry's folder."""
    cells = [entry_of(CellEntry, cell) for cell in record.cells]
    rows = [
        [c.name, c.unit, c.serial or "not stated", _range(c.minimum, c.maximum, c.unit)] for c in record.cells
    ]
    lines = ["", table(["indication", "unit", "serial", "range"], rows, align="<<<<")]
    misses = _check_misses(record, registry)
    loads: dict[str, RecordLoad] = {}
    for load in record.loads:
        errors = standard_errors(record, load.load) or (None,) * len(load.terms)
        loads[load.load] = entry_of(
            RecordLoad, load,
            coefficients=dict(zip(load.terms, load.coefficients, strict=True)),
            issued=dict(zip(load.terms, load.issued, strict=True)),
            standard_errors=dict(zip(load.terms, errors, strict=True)) if load.covariance else None,
            scatter=None if load.scatter is None else dataclasses.asdict(load.scatter),
            check_tolerance=load.tolerance,
            check_max=misses.get(load.load),
        )  # fmt: skip
        terms = [
            [term, repr(c), i, "-" if u is None else round_uncertainty(u)]
            for term, c, i, u in zip(load.terms, load.coefficients, load.issued_texts, errors, strict=True)
        ]
        lines += [
            "",
            f"{load.load} [{load.unit}]",
            table(["term", "coefficient", "issued", "std error"], terms),
        ]
        lines += _figures(load, misses.get(load.load))
    data = [entry_of(StoredFile, file) for file in record.data]
    lines += ["", *(f"{d.role:<9}{d.file}  {d.sha256[:12]}" for d in record.data)]
    payload: RecordContent = {
        "zero": record.zero,
        "indication_units": record.units,
        "indications": cells,
        "loads": loads,
        "data": data,
    }
    return payload, lines


def _figures(fit: LoadFit, miss: float | None) -> list[str]:
    if fit.n is None or fit.residual_sd is None:
        return ["a legacy import: no data, no residuals, no range"]
    lines = [
        f"{fit.method}, {fit.n} rows, {fit.dof} degrees of freedom, "
        f"range {_range(fit.minimum, fit.maximum, fit.unit)}, residual sd {fit.residual_sd:.4g} {fit.unit}"
    ]
    lines.append(f"standard errors by: {fit.covariance_model}, and what the session states")
    if fit.scatter_words is not None:
        lines.append(fit.scatter_words)
    if fit.tolerance is not None:
        checked = "no check loads" if miss is None else f"check loads off by at most {miss:.4g} {fit.unit}"
        lines.append(f"{checked}, tolerance {fit.tolerance:.4g} {fit.unit}")
    return lines


def _check_misses(record: CalibrationRecord, registry: Path) -> dict[str, float]:
    from toolkit.calibration.registry.stored import stored_check

    check = stored_check(registry, record)
    if check is None:
        return {}
    columns = check.columns(record.indications)
    return {load.load: float(abs(load.at(columns) - check.column(load.load)).max()) for load in record.loads}


def _range(low: float | None, high: float | None, unit: str) -> str:
    return "not known" if low is None or high is None else f"{low:.6g} to {high:.6g} {unit}"
