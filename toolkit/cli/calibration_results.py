"""`toolkit calibration budget, certificate, standard, chart, due`: what records amount to."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import (
    DAY,
    INTO_FILE,
    INTO_FOLDER,
    Draft,
    Id,
    IssueOptions,
    KnownAt,
    Output,
    RegistryOptions,
    day,
)

CERTIFICATE = "certificate"


@answers("toolkit.lab.records.budget:BudgetAnswer")
def budget(
    record_id: Id,
    load: Annotated[str | None, "One load; default: all of them."] = None,
    at: Annotated[str | None, "Load value, with a unit or in the record's; default: full scale."] = None,
    indications: Annotated[str | None, "Predict from D51=..,D52=.. in the record's units."] = None,
    temperature_range: Annotated[
        float | None, "Largest departure from the session's temperature in use [K]."
    ] = None,
    temperature_coefficient: Annotated[
        float | None, "Relative change per kelvin; default: what the session states."
    ] = None,
    trials: Annotated[
        int | None, "Check by this many trials; 0: until settled.", Mark(names=("--monte-carlo",))
    ] = None,
    seed: Annotated[int, "Seed of the trials."] = 0,
    digits: Annotated[int, "Significant digits of u.", Mark(min=1, max=2)] = 2,
    figure: Annotated[Path | None, "Draw shares and U over the range: .png, .svg or .pdf.", INTO_FILE] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Tell the uncertainty of a record's loads: components with shares, U with k, U over the range.

    Example: toolkit calibration budget rig-r2 --load FY --at 4000N
    """
    from toolkit.lab.records.budget import BudgetOrder, budget_answer, temperature_of

    order = BudgetOrder(
        load=load, at=at, indications=indications, trials=trials, seed=seed, digits=digits, figure=figure,
        temperature=temperature_of(temperature_range, temperature_coefficient),
    )  # fmt: skip
    payload, text, findings = budget_answer(place.registry(), record_id, order)
    output.answer(payload, text)
    return exit_code(findings)


@answers("toolkit.lab.records.applied:ApplyAnswer")
def apply(
    record_id: Id,
    data: Annotated[
        Path, "Indications: CSV, .xlsx, TDMS, LVM, MDF 4, MAT or Parquet.", ARGUMENT, Mark(metavar="DATA")
    ],
    out: Annotated[Path, "A new file: .csv, .xlsx, .tdms, .mf4 or .parquet.", INTO_FILE],
    tare: Annotated[str | None, "Unloaded indications, A=..,B=.., in the units of the file."] = None,
    on: Annotated[datetime | None, "Day of the measurement; default: today.", DAY] = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Compute the loads of a file of indications by a record, each value with its expanded uncertainty.

    Headers state units, 'A [mV/V]'; other columns of numbers go through. It needs no tire and no machine.

    Example: toolkit calibration apply rig-r1 data.csv --out loads.csv
    """
    from toolkit.lab.records.applied import apply_answer
    from toolkit.lab.records.budget import values_of
    from toolkit.lab.records.record import Record

    registry = place.registry()
    record = Record(result=registry.load(record_id), registry=registry, on=day(on), known_at=day(known_at))
    zero = None if tare is None else values_of(tare, "--tare")
    with output.progress("loads") as step:
        payload, text, loads = apply_answer(record, data, out, tare=zero, draft=draft, step=step)
    output.answer(payload, text)
    return exit_code(loads.findings)


@answers("toolkit.lab.records.certificate:CertificateAnswer")
def certificate(
    record_id: Annotated[str, "Record id, such as rig-r2.", ARGUMENT, Mark(metavar="ID")],
    template: Annotated[Path | None, "Word template; default: report_templates/certificate.docx."] = None,
    out: Annotated[Path | None, "Output folder; default: certificate-<ID> here.", INTO_FOLDER] = None,
    dcc: Annotated[bool, "Also write the DCC 3.3.0 file (XML)."] = False,
    replaces: Annotated[str | None, "Id of the certificate that this one replaces."] = None,
    amendment_reason: Annotated[str | None, "Why it is replaced; printed."] = None,
    draft: Annotated[bool, "Allow a record that is not approved: every page says DRAFT."] = False,
    issue: Annotated[
        bool,
        "Enter it in the ledger, its PDF carries the proof; always where people are enrolled, or with "
        "--seal.",
    ] = False,
    known_at: KnownAt = None,
    keep: Annotated[bool, "Keep what was not verified in rejected/ of the folder."] = False,
    *,
    issuing: IssueOptions,
    output: Output,
) -> int:
    """Issue the calibration certificate of a record: Word, verified PDF, and with --dcc the XML.

    Where people are enrolled it is an entry of the ledger that they sign; a draft is none. A legacy import, a
    candidate and a withdrawn record have none. What nobody stated is a visible gap (exit 1). --known-at is
    the day of issue, and of what was known.

    Example: toolkit calibration certificate rig-r3 --out certificates --dcc
    """
    from toolkit.lab.home import home_template
    from toolkit.lab.records.certificate import certificate_payload, certificate_text, deliver_certificate
    from toolkit.report.word.package import read_template

    opened = read_template(template or home_template("certificate.docx", issuing.home))
    registry = issuing.registry()
    sealing = issuing.sealing(registry, draft=draft)
    with output.progress("certificate") as step:
        issued, delivered = deliver_certificate(
            registry, record_id, opened,
            out or Path.cwd() / f"certificate-{record_id}", issued=day(known_at), draft=draft,
            replaces=replaces, amendment=amendment_reason, dcc=dcc, sealing=sealing, asked=issue,
            named=issuing.issued_by or (), keep=keep, step=step,
        )  # fmt: skip
    payload = certificate_payload(issued, delivered, sealing, output.timing)
    output.answer(payload, certificate_text(issued, delivered, sealing))
    return 1 if delivered.warnings else exit_code(issued.findings)


@answers("toolkit.lab.records.control_answer:StandardAnswer")
def standard(
    record_id: Id,
    name: Annotated[str, "e74 or iso376.", Mark(names=("--standard",))],
    load: Annotated[str | None, "One load; needed where there are more."] = None,
    indication: Annotated[str | None, "One indication; needed where there are more."] = None,
    degree: Annotated[int | None, "Of the curve; E74: by its annex, ISO 376: 3."] = None,
    preloads: Annotated[
        int | None, "Preloads to the largest force (ISO 376); default: [standard] preloads of the session."
    ] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Evaluate one indication under one load by a standard: figures, class, reasons.

    Example: toolkit calibration standard cell-r1 --standard iso376 --preloads 3
    """
    from toolkit.errors import ConfigError
    from toolkit.lab.records.control_answer import evaluate_record, evaluation_text

    if name not in ("e74", "iso376"):
        raise ConfigError(
            "no such standard", where="--standard", got=name, expected="e74 or iso376",
            next_step="name one of them", rule="usage",
        )  # fmt: skip
    evaluations = evaluate_record(
        place.registry(), record_id,
        standard="e74" if name == "e74" else "iso376",
        load=load, indication=indication, degree=degree, preloads=preloads,
    )  # fmt: skip
    payload = {
        "id": record_id,
        "standard": name,
        "evaluations": [evaluation.as_dict() for evaluation in evaluations],
    }
    output.answer(payload, "\n\n".join(map(evaluation_text, evaluations)))
    return 0


@answers("toolkit.lab.records.control_answer:ChartAnswer")
def chart(
    instrument: Annotated[str, "The instrument.", ARGUMENT],
    out: Annotated[Path | None, "A picture: FILE.png or FILE.svg.", INTO_FILE] = None,
    load: Annotated[str | None, "One load only."] = None,
    baseline: Annotated[
        int | None, "First sessions that make the limits; default: all but the last.", Mark(min=4)
    ] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Chart the error of each check load over the sessions; exit code 1 where the newest breaks a rule.

    Example: toolkit calibration chart rig --out chart.png
    """
    from toolkit.lab.records.control_answer import chart_answer

    payload, text, findings = chart_answer(
        place.registry(), instrument, load=load, baseline=baseline, out=out
    )
    output.answer(payload, text)
    return exit_code(findings)


@answers("toolkit.lab.records.control_answer:DueAnswer")
def due(
    instrument: Annotated[str | None, "One instrument; default: all.", ARGUMENT] = None,
    on: Annotated[datetime | None, "The day to judge; default: today.", DAY] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Tell when each instrument is due, as the ledger says; exit code 1 where one is overdue.

    Example: toolkit calibration due --on 2026-12-01
    """
    from toolkit.calibration.registry.clock import today
    from toolkit.lab.records.control_answer import due_answer

    registry = place.registry()
    payload, text, findings = due_answer(registry, instrument, day(on) or today())
    output.answer(payload, text)
    return exit_code(findings)
