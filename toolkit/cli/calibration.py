"""`toolkit calibration ...`: the registry."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli import calibration_results as results
from toolkit.cli.calibrate import Figures
from toolkit.cli.console import (
    Answers,
    Calibrations,
    Home,
    Id,
    Json,
    LockFile,
    Machine,
    NewCalibrations,
    Quiet,
    RequestFile,
    Sign,
    answer,
    answers,
    exit_code,
    open_signers,
    open_travel,
)

if TYPE_CHECKING:
    from toolkit.calibration.registry.registry import Registry
    from toolkit.trust.signing import Travel

app = typer.Typer(help="Calibration records: what is in force, and why.", no_args_is_help=True)

IN_FORCE = (
    "First day in force (YYYY-MM-DD). Before the session's date it needs --reason; "
    "before the decision it is noted in the ledger."
)
KnownAt = Annotated[str | None, typer.Option("--known-at", help="What was known on this day (YYYY-MM-DD).")]


@app.command("list")
@answers("toolkit.lab.registry_answer:ListAnswer")
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

    Example: toolkit calibration list rig --known-at 2026-03-02
    """
    from toolkit.lab.registry_answer import listed

    payload, text, sound = listed(
        _registry(calibrations, home), instrument, known_at=_day(known_at, "--known-at"),
        everything=everything,
    )  # fmt: skip
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 0 if sound else 1


@app.command()
@answers("toolkit.lab.registry_answer:ShowAnswer")
def show(
    record_id: Id,
    known_at: KnownAt = None,
    full: Annotated[
        bool, typer.Option("--full", help="Also what an approval meets: gates, responses in SI, as found.")
    ] = False,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Show one record: its state, cells, ranges, coefficients, issued digits, check loads and files.

    Example: toolkit calibration show rig-r2
    """
    from toolkit.lab.gates_answer import full_record
    from toolkit.lab.registry_answer import shown

    registry = _registry(calibrations, home)
    payload, text = shown(registry, record_id, known_at=_day(known_at, "--known-at"))
    if full:
        more, lines = full_record(registry, record_id)
        payload, text = {**payload, **more}, f"{text}\n\n{lines}"
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 0


@app.command()
@answers("toolkit.lab.decisions:VerifyRegistryAnswer")
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
    from toolkit.lab.answers import table

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
@answers("toolkit.lab.registry_answer:HistoryAnswer")
def history(
    name: Annotated[str, typer.Argument(help="An instrument, or a record id.")],
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tell what happened to an instrument's records, from its ledger.

    Example: toolkit calibration history rig
    """
    from toolkit.lab.registry_answer import history as told

    registry = _registry(calibrations, home)
    instrument = name if name in registry.instruments() else _instrument_of(name)
    ledger = registry.ledger(instrument)
    payload, text = told(ledger, instrument, name)
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 1 if ledger.damage else 0


@app.command("import")
@answers("toolkit.lab.decisions:ImportAnswer")
def import_record(
    file: Annotated[Path, typer.Argument(help="TOML with the coefficients and the source that names them.")],
    again: Annotated[
        bool, typer.Option("--again", help="Enter a file anew whose record was discarded.")
    ] = False,
    calibrations: NewCalibrations = None,
    lock_file: LockFile = False,
    sign: Sign = None,
    request: RequestFile = None,
    answers: Answers = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Enter a legacy record: coefficients without their data, marked unverified for ever.

    Example: toolkit calibration import coefficients-2004.toml
    """
    from toolkit.calibration.registry.candidate import import_legacy
    from toolkit.calibration.registry.registry import Registry
    from toolkit.lab.home import registry_to_write
    from toolkit.lab.registry_answer import record_row

    registry = Registry(
        registry_to_write(calibrations, home), lock_file=lock_file, signers=open_signers(sign),
        travel=open_travel(request, answers),
    )  # fmt: skip
    record, existing = import_legacy(file, registry, again=again)
    path = registry.folder / record.instrument / f"{record.id}.json"
    payload = {
        **record_row(record, registry.status(record.id), registry.signature(record.id)),
        "existing": existing,
        "path": str(path),
    }
    entered = "  (already entered)" if existing else ""
    text = (
        f"{record.id}  unverified legacy import{entered}\nsha256 {record.sha256}\n"
        f"signature: {payload['signature']}\n"
        f"next: toolkit calibration approve {record.id} --in-force-from DATE --checked-by NAME --reason TEXT"
    )
    answer({"ok": True, "verified": False, "record": payload}, text, as_json=as_json, quiet=quiet)
    return 0


@app.command()
@answers("toolkit.lab.decisions:ApproveAnswer")
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
    lock_file: LockFile = False,
    sign: Sign = None,
    request: RequestFile = None,
    answers: Answers = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Put a record in force; a failed gate (sign, span, polarity, range, check load) blocks it.

    Example: toolkit calibration approve rig-r2 --in-force-from 2026-03-02 --checked-by "second person"
    """
    from toolkit.calibration.registry.approval import approve as decide
    from toolkit.lab.answers import finding_lines

    registry = _registry(
        calibrations, home, lock_file=lock_file, sign=sign, travel=open_travel(request, answers)
    )
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
    signature = registry.signature(record_id)
    lines.append(f"signature: {signature}")
    payload = {
        "id": record_id,
        "approved": decision.done,
        "in_force_from": since and since.isoformat(),
        "findings": [finding.as_dict() for finding in decision.findings],
        "unverifiable": list(decision.unverifiable),
        "note": decision.note,
        "evidence": list(decision.evidence),
        "recall": registry.status(record_id).recall,
        "signature": signature,
        "head": registry.head(_instrument_of(record_id)),
    }
    answer(payload, "\n".join(lines), as_json=as_json, quiet=quiet)
    return exit_code(decision.findings)


@app.command()
@answers("toolkit.lab.decisions:WithdrawAnswer")
def withdraw(
    record_id: Id,
    on: Annotated[str, typer.Option("--on", help="Day on which the fault became known (YYYY-MM-DD).")],
    reason: Annotated[str, typer.Option("--reason", help="Why; printed wherever the record is named.")],
    by: Annotated[str, typer.Option("--by", help="Who withdraws.")],
    void_from: Annotated[
        str | None, typer.Option("--from", help="First void day; default: the record's in-force date.")
    ] = None,
    calibrations: Calibrations = None,
    lock_file: LockFile = False,
    sign: Sign = None,
    request: RequestFile = None,
    answers: Answers = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Withdraw a record; the ledger keeps it and says why.

    Example: toolkit calibration withdraw rig-r2 --on 2026-04-01 --by "first person" --reason "dropped"
    """
    from toolkit.calibration.registry.approval import withdraw as decide
    from toolkit.lab.registry_answer import void_day

    registry = _registry(
        calibrations, home, lock_file=lock_file, sign=sign, travel=open_travel(request, answers)
    )
    known_on = _day(on, "--on") or dt.date.max
    status = decide(
        registry, record_id, on=known_on, void_from=_day(void_from, "--from"), reason=reason, by=by
    )
    void = void_day(status)
    text = f"{record_id}  withdrawn, void " + ("on every day" if status.void_always else f"from {void}")
    payload = {"id": record_id, "status": status.state, "void_from": void, "void_always": status.void_always}
    payload["head"] = registry.head(_instrument_of(record_id))
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 0


@answers("toolkit.lab.registry_answer:DifferenceAnswer")
def diff(
    one: Id,
    other: Id,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Compare two records term by term; exit code 1 where they differ.

    Example: toolkit calibration diff rig-r1 rig-r2
    """
    from toolkit.lab.registry_answer import difference

    payload, text, differs = difference(_registry(calibrations, home), one, other)
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 1 if differs else 0


@answers("toolkit.lab.decisions:DiscardAnswer")
def discard(
    record_id: Annotated[str, typer.Argument(metavar="ID", help="Record id, such as rig-r2.")],
    reason: Annotated[str, typer.Option("--reason", help="Why; the ledger keeps it.")],
    by: Annotated[str, typer.Option("--by", help="Who discards.")],
    calibrations: Calibrations = None,
    lock_file: LockFile = False,
    sign: Sign = None,
    request: RequestFile = None,
    answers: Answers = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Discard a candidate that was never approved: it can never be, and 'list' hides it.

    The record stays and is verified for ever. The same session entered again is refused with this reason,
    unless with 'toolkit calibrate SESSION.toml --again', which makes a record with a new id.

    Example: toolkit calibration discard rig-r3 --reason "cable of D52 was loose" --by "first person"
    """
    from toolkit.calibration.registry.approval import discard as decide

    registry = _registry(
        calibrations, home, lock_file=lock_file, sign=sign, travel=open_travel(request, answers)
    )
    status = decide(registry, record_id, reason=reason, by=by)
    head = registry.head(_instrument_of(record_id))
    payload = {"id": record_id, "status": status.state, "reason": status.reason, "head": head}
    answer(payload, f"{record_id}  discarded: {status.reason}", as_json=as_json, quiet=quiet)
    return 0


@answers("toolkit.lab.session_answer:RecordReportAnswer")
def report(
    record_id: Id,
    figures: Figures = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fit a record's stored data again and print the whole report; exit code 1 where it has findings.

    Example: toolkit calibration report rig-r2 --figures fit
    """
    from toolkit.calibration.fit.findings import session_findings
    from toolkit.calibration.fit.session_fit import fit_session
    from toolkit.calibration.registry.stored import stored_session
    from toolkit.lab.answers import finding_lines, refuse_unwritable
    from toolkit.lab.session_answer import fit_report

    registry = _registry(calibrations, home)
    record = registry.load(record_id)
    fit = fit_session(stored_session(registry.folder, record))
    refuse_unwritable(figures)
    findings = session_findings(fit)
    stored = fit_report(fit, title=record.id, full=True, figures=figures)
    lines = [f"{record.id}  {record.instrument}, session of {record.date}", f"sha256 {record.sha256}"]
    text = "\n".join(lines) + stored.text
    if findings:
        text += "\n\nfindings:\n" + "\n".join(finding_lines(findings))
    payload = {
        "record": {"id": record.id, "sha256": record.sha256},
        "loads": stored.loads,
        "findings": [finding.as_dict() for finding in findings],
        **stored.payload,
    }
    answer(payload, text, as_json=as_json, quiet=quiet)
    return exit_code(findings)


app.command(results.CERTIFICATE)(results.certificate)
app.command("apply")(results.apply)
app.command("budget")(results.budget)
app.command("diff")(diff)
app.command("discard")(discard)
app.command("report")(report)
app.command("standard")(results.standard)
app.command("chart")(results.chart)
app.command("due")(results.due)


def _registry(
    calibrations: Path | None, home: Path | None, *, lock_file: bool = False,
    sign: list[Path] | None = None, travel: Travel | None = None,
) -> Registry:  # fmt: skip
    from toolkit.lab.home import open_registry

    return open_registry(calibrations, home, lock_file=lock_file, signers=open_signers(sign), travel=travel)


def _instrument_of(record_id: str) -> str:
    from toolkit.calibration.registry.registry import instrument_of

    return instrument_of(record_id)


def _day(text: str | None, option: str) -> dt.date | None:
    try:
        return None if text is None else dt.date.fromisoformat(text)
    except ValueError as error:
        from toolkit.errors import ConfigError

        raise ConfigError(
            f"{option} is no date", where=option, got=text, expected="YYYY-MM-DD",
            next_step="write it as in 2026-03-31", rule="usage",
        ) from error  # fmt: skip
