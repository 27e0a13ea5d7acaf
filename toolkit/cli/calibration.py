"""`toolkit calibration ...`: the registry."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli import (
    calibration_budget,
    calibration_certificate,
    calibration_chart,
    calibration_diff,
    calibration_discard,
    calibration_due,
    calibration_report,
    calibration_standard,
)
from toolkit.cli.console import (
    Calibrations,
    Home,
    Json,
    Machine,
    Quiet,
    answer,
    exit_code,
    finding_lines,
    table,
)
from toolkit.cli.home import calibrations_folder, registry_to_write
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.status import RecordStatus

app = typer.Typer(help="Calibration records: what is in force, and why.", no_args_is_help=True)

IN_FORCE = (
    "First day in force (YYYY-MM-DD). Before the session's date it needs --reason; "
    "before the decision it is noted in the ledger."
)
Id = Annotated[str, typer.Argument(help="Record id, such as m15-r2.")]
KnownAt = Annotated[str | None, typer.Option("--known-at", help="What was known on this day (YYYY-MM-DD).")]


@app.command("list")
def list_records(
    instrument: Annotated[str | None, typer.Argument(help="One instrument; default: all.")] = None,
    everything: Annotated[bool, typer.Option("--all", help="Discarded candidates too.")] = False,
    known_at: KnownAt = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """List the records with their state, and the head of each ledger; --all has discarded candidates too.

    Example: toolkit calibration list m15 --known-at 2026-03-02
    """
    registry = _registry(calibrations, home)
    known = _day(known_at, "--known-at")
    rows, heads, bad, hidden = [], {}, 0, 0
    for name in [instrument] if instrument else registry.instruments():
        ledger = registry.ledger(name)
        heads[name] = {"count": len(ledger.entries), "sha256": ledger.head, "damage": ledger.damage}
        good, refused = registry.usable(name)
        bad += len(refused) + (ledger.damage is not None)
        every = [_row(record, registry.status(record.id, known_at=known)) for record in good]
        shown = [row for row in every if everything or row["status"] != "discarded"]
        hidden += len(every) - len(shown)
        rows += shown
        rows += [
            {"id": one.id, "status": "refused", "rule": one.rule, "reason": one.reason} for one in refused
        ]
    lines = table(
        ["id", "state", "in force from", "void from", "verified", "sha256", "note"],
        [
            [r["id"], r["status"], r.get("in_force_from") or "", r.get("void_from") or "",
             "yes" if r.get("verified") else "no", r.get("sha256", "")[:12], r.get("reason") or ""]
            for r in rows
        ],
        align="<" * 7,
    )  # fmt: skip
    more = [f"discarded and not shown: {hidden} (--all)"] if hidden else []
    heads_text = [f"head of {n}: {h['sha256']}" for n, h in heads.items()]
    text = "\n".join([lines or "no records", *more, "", *heads_text])
    answer({"records": rows, "heads": heads, "hidden": hidden}, text, as_json=as_json, quiet=quiet)
    return 1 if bad else 0


@app.command()
def show(
    record_id: Id,
    known_at: KnownAt = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Show one record: its state, cells, ranges, coefficients, issued digits, check loads and files.

    Example: toolkit calibration show m15-r2
    """
    from toolkit.cli.calibration_show import described

    registry = _registry(calibrations, home)
    record = registry.load(record_id)
    row = _row(record, registry.status(record_id, known_at=_day(known_at, "--known-at")))
    lines = [f"{key:<14}{_plainly(value)}" for key, value in row.items() if value not in (None, "", [])]
    told, more = described(record, registry.folder)
    head = registry.head(record.instrument)
    lines += [f"{'ledger head':<14}{head}", *more]
    payload = {"record": row, "head": head, **told}
    answer(payload, "\n".join(lines), as_json=as_json, quiet=quiet)
    return 0


@app.command()
def verify(
    head: Annotated[str | None, typer.Option("--head", help="A ledger hash printed earlier.")] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Refit every record from its stored data, and name every file that is not as it was entered.

    Example: toolkit calibration verify --head HASH
    """
    from toolkit.calibration.registry.verify import verify_registry

    rows = verify_registry(_registry(calibrations, home), head)
    payload = [{"id": r.id, "ok": r.ok, "verified": r.verified, "reason": r.reason} for r in rows]
    text = table(
        ["id", "result", "verified", "reason"],
        [[r.id, "ok" if r.ok else "NOT OK", "yes" if r.verified else "no", r.reason or ""] for r in rows],
        align="<<<<",
    )
    answer({"records": payload}, text or "no records", as_json=as_json, quiet=quiet)
    return 0 if all(row.ok for row in rows) else 1


@app.command()
def history(
    name: Annotated[str, typer.Argument(help="An instrument, or a record id.")],
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tell what happened to an instrument's records, from its ledger.

    Example: toolkit calibration history m15
    """
    registry = _registry(calibrations, home)
    instrument = name if name in registry.instruments() else _instrument_of(name)
    ledger = registry.ledger(instrument)
    entries = [entry for entry in ledger.entries if name in (instrument, entry.id)]
    events = [
        {
            "seq": e.seq, "id": e.id, "event": e.event, "time": e.time, "by": e.by,
            "approved_by": e.approved_by,
            "known_on": e.known_on and e.known_on.isoformat(), "since": e.since and e.since.isoformat(),
            "reason": e.reason, "note": e.note, "recall": e.recall,
            "unverifiable": list(e.unverifiable), "evidence": list(e.evidence), "sha256": e.sha256,
        }
        for e in entries
    ]  # fmt: skip
    lines = [
        f"{e['seq']:>3}  {e['time']}  {e['id']}  {e['event']:<10}by {e['by']}"
        + (f", since {e['since']}" if e["since"] else "")
        + (f", known on {e['known_on']}" if e["known_on"] else "")
        + (f", {e['note']}" if e["note"] else "")
        + (f", recall after {e['recall']}" if e["recall"] else "")
        + (f"\n     {e['reason']}" if e["reason"] else "")
        + "".join(f"\n     {text}" for text in entry.evidence)
        for e, entry in zip(events, entries, strict=True)
    ]
    lines += [f"head {ledger.head}", *([f"DAMAGED: {ledger.damage}"] if ledger.damage else [])]
    payload = {"events": events, "head": ledger.head, "damage": ledger.damage}
    answer(payload, "\n".join(lines), as_json=as_json, quiet=quiet)
    return 1 if ledger.damage else 0


@app.command("import")
def import_record(
    file: Annotated[Path, typer.Argument(help="TOML with the coefficients and the source that names them.")],
    again: Annotated[
        bool, typer.Option("--again", help="Enter a file anew whose record was discarded.")
    ] = False,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Enter a legacy record: coefficients without their data, marked unverified for ever.

    Example: toolkit calibration import coefficients-2004.toml
    """
    from toolkit.calibration.registry.legacy import import_legacy
    from toolkit.calibration.registry.registry import Registry

    registry = Registry(registry_to_write(calibrations, home))
    record, existing = import_legacy(file, registry, again=again)
    path = registry.folder / record.instrument / f"{record.id}.json"
    payload = {**_row(record, registry.status(record.id)), "existing": existing, "path": str(path)}
    text = (
        f"{record.id}  unverified legacy import" + ("  (already entered)" if existing else "") + f"\n"
        f"sha256 {record.sha256}\nnext: toolkit calibration approve {record.id} --in-force-from DATE "
        "--checked-by NAME --reason TEXT"
    )
    answer({"ok": True, "verified": False, "record": payload}, text, as_json=as_json, quiet=quiet)
    return 0


@app.command()
def approve(
    record_id: Id,
    in_force_from: Annotated[str, typer.Option("--in-force-from", help=IN_FORCE)],
    checked_by: Annotated[str, typer.Option("--checked-by", help="Who checked; not who entered.")],
    approved_by: Annotated[str | None, typer.Option("--approved-by", help="Who approved.")] = None,
    reason: Annotated[
        str | None,
        typer.Option(
            "--reason",
            help="Why; asked for where a date lies in the past, or a cell was replaced.",
        ),
    ] = None,
    on: Annotated[
        str | None,
        typer.Option("--on", help="Day of the decision; default: today. In the past it needs --reason."),
    ] = None,
    polarity: Annotated[
        Path | None,
        typer.Option("--polarity", help="TOML with [[polarity]]: readings of one load of known direction."),
    ] = None,
    machine: Machine = None,
    recall: Annotated[
        str | None, typer.Option("--recall", help='Recall interval after the session, such as "12 months".')
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Put a record in force; a failed gate (sign, span, polarity, range, check load) blocks it.

    Example: toolkit calibration approve m15-r2 --in-force-from 2026-03-02 --checked-by "second person"
    """
    from toolkit.calibration.registry.approval import approve as decide

    registry = _registry(calibrations, home)
    since = _day(in_force_from, "--in-force-from")
    decision = decide(
        registry, record_id, in_force_from=since or dt.date.max, checked_by=checked_by,
        approved_by=approved_by, reason=reason, known_on=_day(on, "--on"), recall=recall,
        polarity=polarity, machine=machine,
    )  # fmt: skip
    lines = [f"{record_id}  " + (f"approved, in force from {since}" if decision.done else "NOT approved")]
    lines += ["failed gates:", *finding_lines(decision.findings)] if decision.findings else []
    lines += [f"note: {decision.note}"] if decision.note else []
    lines += ["evidence:", *(f"  {text}" for text in decision.evidence)] if decision.evidence else []
    if decision.unverifiable:
        lines += ["terms that the check loads cannot verify:", *(f"  {t}" for t in decision.unverifiable)]
    payload = {
        "id": record_id,
        "approved": decision.done,
        "in_force_from": since and since.isoformat(),
        "findings": [finding.as_dict() for finding in decision.findings],
        "unverifiable": list(decision.unverifiable),
        "note": decision.note,
        "evidence": list(decision.evidence),
        "recall": registry.status(record_id).recall,
        "head": registry.head(_instrument_of(record_id)),
    }
    answer(payload, "\n".join(lines), as_json=as_json, quiet=quiet)
    return exit_code(decision.findings)


@app.command()
def withdraw(
    record_id: Id,
    on: Annotated[str, typer.Option("--on", help="Day on which the fault became known (YYYY-MM-DD).")],
    reason: Annotated[str, typer.Option("--reason", help="Why; printed wherever the record is named.")],
    void_from: Annotated[
        str | None, typer.Option("--from", help="First void day; default: the record's in-force date.")
    ] = None,
    by: Annotated[str, typer.Option("--by", help="Who withdraws.")] = "not stated",
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Withdraw a record; the ledger keeps it and says why.

    Example: toolkit calibration withdraw m15-r2 --on 2026-04-01 --reason "reference out of tolerance"
    """
    from toolkit.calibration.registry.approval import withdraw as decide

    registry = _registry(calibrations, home)
    known = _day(on, "--on") or dt.date.max
    status = decide(registry, record_id, on=known, void_from=_day(void_from, "--from"), reason=reason, by=by)
    void = _void(status)
    text = f"{record_id}  withdrawn, void " + ("on every day" if status.void_always else f"from {void}")
    payload = {"id": record_id, "status": status.state, "void_from": void, "void_always": status.void_always}
    payload["head"] = registry.head(_instrument_of(record_id))
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 0


app.command(calibration_certificate.NAME)(calibration_certificate.command)
app.command("budget")(calibration_budget.command)
app.command("diff")(calibration_diff.command)
app.command("discard")(calibration_discard.command)
app.command("report")(calibration_report.command)
app.command("standard")(calibration_standard.command)
app.command("chart")(calibration_chart.command)
app.command("due")(calibration_due.command)


def _registry(calibrations: Path | None, home: Path | None) -> Registry:
    from toolkit.calibration.registry.registry import Registry

    return Registry(calibrations_folder(calibrations, home))


def _instrument_of(record_id: str) -> str:
    from toolkit.calibration.registry.registry import instrument_of

    return instrument_of(record_id)


def _day(text: str | None, option: str) -> dt.date | None:
    try:
        return None if text is None else dt.date.fromisoformat(text)
    except ValueError as error:
        raise ConfigError(
            f"{option} is no date", where=option, got=text, expected="YYYY-MM-DD",
            next_step="write it as in 2026-03-31", rule="usage",
        ) from error  # fmt: skip


def _plainly(value: object) -> object:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "; ".join(map(str, value)) if isinstance(value, list) else value


def _void(status: RecordStatus) -> str | None:
    # A record that was never in force is void from the beginning of time: no date to print.
    if status.void_from is None or status.void_from == dt.date.min:
        return None
    return status.void_from.isoformat()


def _row(record: CalibrationRecord, status: RecordStatus) -> dict[str, Any]:
    return {
        "id": record.id,
        "instrument": record.instrument,
        "sha256": record.sha256,
        "status": status.state,
        "verified": record.verified,
        "date": record.date,
        "in_force_from": status.in_force_from and status.in_force_from.isoformat(),
        "void_from": _void(status),
        "void_always": status.void_always,
        "entered_by": status.entered_by,
        "checked_by": status.checked_by,
        "approved_by": status.approved_by,
        "reason": status.reason,
        "unverifiable": list(status.unverifiable),
        "recall": status.recall,
    }
