"""`toolkit calibration ...`: the registry."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli import calibration_results as results
from toolkit.cli.calibrate import Figures
from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import DecisionOptions, EntryOptions, Id, Machine, Output, RegistryOptions

app = typer.Typer(help="Calibration records: what is in force, and why.", no_args_is_help=True)

IN_FORCE = (
    "First day in force (YYYY-MM-DD). Before the session's date it needs --reason; "
    "before the decision it is noted in the ledger."
)
KnownAt = Annotated[str | None, "What was known on this day (YYYY-MM-DD)."]


@app.command("list")
@answers("toolkit.lab.records.registry_answer:ListAnswer")
def list_records(
    instrument: Annotated[str | None, "One instrument; default: all.", ARGUMENT] = None,
    everything: Annotated[bool, "Discarded candidates too.", Mark(names=("--all",))] = False,
    known_at: KnownAt = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """List the records with their state, and the head of each ledger; --all has discarded candidates too.

    Example: toolkit calibration list rig --known-at 2026-03-02
    """
    from toolkit.lab.records.registry_answer import listed

    payload, text, sound = listed(
        place.registry(), instrument, known_at=_day_or_none(known_at, "--known-at"),
        everything=everything,
    )  # fmt: skip
    output.answer(payload, text)
    return 0 if sound else 1


@app.command()
@answers("toolkit.lab.records.registry_answer:ShowAnswer")
def show(
    record_id: Id,
    known_at: KnownAt = None,
    full: Annotated[bool, "Also what an approval meets: gates, responses in SI, as found."] = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Show one record: its state, cells, ranges, coefficients, issued digits, check loads and files.

    Example: toolkit calibration show rig-r2
    """
    from toolkit.lab.records.gates_answer import full_record
    from toolkit.lab.records.registry_answer import shown

    registry = place.registry()
    payload, text = shown(registry, record_id, known_at=_day_or_none(known_at, "--known-at"))
    if full:
        more, lines = full_record(registry, record_id)
        payload, text = {**payload, **more}, f"{text}\n\n{lines}"
    output.answer(payload, text)
    return 0


@app.command()
@answers("toolkit.lab.records.decisions:VerifyRegistryAnswer")
def verify(
    head: Annotated[str | None, "A ledger hash printed earlier."] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Refit every record from its stored data, and name every file that is not as it was entered.

    Example: toolkit calibration verify --head HASH
    """
    from toolkit.lab.records.decisions import verified_answer

    payload, text = verified_answer(place.registry(), head)
    output.answer(payload, text)
    return 0 if all(record.ok for record in payload["records"]) else 1


@app.command()
@answers("toolkit.lab.records.registry_answer:HistoryAnswer")
def history(
    name: Annotated[str, "An instrument, or a record id.", ARGUMENT],
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Tell what happened to an instrument's records, from its ledger.

    Example: toolkit calibration history rig
    """
    from toolkit.lab.records.registry_answer import history as told

    registry = place.registry()
    instrument = name if name in registry.instruments() else _instrument_of(name)
    ledger = registry.ledger(instrument)
    payload, text = told(ledger, instrument, name)
    output.answer(payload, text)
    return 1 if ledger.damage else 0


@app.command("import")
@answers("toolkit.lab.records.decisions:ImportAnswer")
def import_record(
    file: Annotated[Path, "TOML with the coefficients and the source that names them.", ARGUMENT],
    again: Annotated[bool, "Enter a file anew whose record was discarded."] = False,
    *,
    entering: EntryOptions,
    output: Output,
) -> int:
    """Enter a legacy record: coefficients without their data, marked unverified for ever.

    Example: toolkit calibration import coefficients-2004.toml
    """
    from toolkit.lab.records.decisions import import_answer

    output.answer(*import_answer(entering.registry(), file, again=again))
    return 0


@app.command()
@answers("toolkit.lab.records.decisions:ApproveAnswer")
def approve(
    record_id: Id,
    in_force_from: Annotated[str, IN_FORCE],
    checked_by: Annotated[str, "Who checked; not who entered."],
    approved_by: Annotated[str | None, "Who approved."] = None,
    reason: Annotated[
        str | None, "Why; asked for where a date lies in the past, or a cell was replaced."
    ] = None,
    on: Annotated[str | None, "Day of the decision; default: today. In the past it needs --reason."] = None,
    polarity: Annotated[
        Path | None, "TOML with [[polarity]]: readings of one load of known direction."
    ] = None,
    machine: Machine = None,
    recall: Annotated[str | None, 'Recall interval after the session, such as "12 months".'] = None,
    *,
    entering: DecisionOptions,
    output: Output,
) -> int:
    """Put a record in force; a failed gate (sign, span, polarity, range, check load) blocks it.

    Example: toolkit calibration approve rig-r2 --in-force-from 2026-03-02 --checked-by "second person"
    """
    from toolkit.calibration.registry.approval import approve as put_in_force
    from toolkit.lab.records.decisions import approval_answer

    registry, since = entering.registry(), _day(in_force_from, "--in-force-from")
    decision = put_in_force(
        registry, record_id, in_force_from=since, checked_by=checked_by, approved_by=approved_by,
        reason=reason, known_on=_day_or_none(on, "--on"), recall=recall, polarity=polarity, machine=machine,
    )  # fmt: skip
    output.answer(*approval_answer(registry, decision, since))
    return exit_code(decision.findings)


@app.command()
@answers("toolkit.lab.records.decisions:WithdrawAnswer")
def withdraw(
    record_id: Id,
    on: Annotated[str, "Day on which the fault became known (YYYY-MM-DD)."],
    reason: Annotated[str, "Why; printed wherever the record is named."],
    by: Annotated[str, "Who withdraws."],
    void_from: Annotated[
        str | None, "First void day; default: the record's in-force date.", Mark(names=("--from",))
    ] = None,
    *,
    entering: DecisionOptions,
    output: Output,
) -> int:
    """Withdraw a record; the ledger keeps it and says why.

    Example: toolkit calibration withdraw rig-r2 --on 2026-04-01 --by "first person" --reason "dropped"
    """
    from toolkit.calibration.registry.approval import withdraw as void
    from toolkit.lab.records.decisions import withdrawal_answer

    registry = entering.registry()
    status = void(
        registry, record_id, on=_day(on, "--on"), void_from=_day_or_none(void_from, "--from"),
        reason=reason, by=by,
    )  # fmt: skip
    output.answer(*withdrawal_answer(registry, record_id, status))
    return 0


@answers("toolkit.lab.records.registry_answer:DifferenceAnswer")
def diff(
    one: Id,
    other: Id,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Compare two records term by term; exit code 1 where they differ.

    Example: toolkit calibration diff rig-r1 rig-r2
    """
    from toolkit.lab.records.registry_answer import difference

    payload, text, differs = difference(place.registry(), one, other)
    output.answer(payload, text)
    return 1 if differs else 0


@answers("toolkit.lab.records.decisions:DiscardAnswer")
def discard(
    record_id: Annotated[str, "Record id, such as rig-r2.", ARGUMENT, Mark(metavar="ID")],
    reason: Annotated[str, "Why; the ledger keeps it."],
    by: Annotated[str, "Who discards."],
    *,
    entering: DecisionOptions,
    output: Output,
) -> int:
    """Discard a candidate that was never approved: it can never be, and 'list' hides it.

    The record stays and is verified for ever. The same session entered again is refused with this reason,
    unless with 'toolkit calibrate SESSION.toml --again', which makes a record with a new id.

    Example: toolkit calibration discard rig-r3 --reason "cable of D52 was loose" --by "first person"
    """
    from toolkit.calibration.registry.approval import discard as put_aside
    from toolkit.lab.records.decisions import discarded_answer

    registry = entering.registry()
    status = put_aside(registry, record_id, reason=reason, by=by)
    output.answer(*discarded_answer(registry, record_id, status))
    return 0


@answers("toolkit.lab.records.session_answer:RecordReportAnswer")
def report(
    record_id: Id,
    figures: Figures = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Fit a record's stored data again and print the whole report; exit code 1 where it has findings.

    Example: toolkit calibration report rig-r2 --figures fit
    """
    from toolkit.lab.records.session_answer import record_report

    payload, text, findings = record_report(place.registry(), record_id, figures)
    output.answer(payload, text)
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


def _instrument_of(record_id: str) -> str:
    from toolkit.calibration.registry.registry import instrument_of

    return instrument_of(record_id)


def _day_or_none(text: str | None, option: str) -> dt.date | None:
    return None if text is None else _day(text, option)


def _day(text: str, option: str) -> dt.date:
    from toolkit.days import parse_day

    try:
        return parse_day(text)
    except ValueError as error:
        from toolkit.errors import ConfigError

        raise ConfigError(
            f"{option} is no date", where=option, got=text, expected="YYYY-MM-DD",
            next_step="write it as in 2026-03-31", rule="usage",
        ) from error  # fmt: skip
