"""`toolkit report`: the filled Word report and its verified PDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.options import (
    INTO_FOLDER,
    AllowMissing,
    CalibrationId,
    Draft,
    IssueOptions,
    KnownAt,
    Output,
    ProtocolFile,
    Reader,
    ReportTemplate,
)

NAME = "report"


@answers("toolkit.lab.tire_tests.reports:ReportForms")
def command(
    tests: Annotated[
        list[Path],
        "Folders with test.toml and recordings, or reduced tests.",
        ARGUMENT,
        Mark(metavar="TEST..."),
    ],
    template: ReportTemplate = None,
    out: Annotated[
        Path | None,
        "Output folder; of several tests, each has its own in it. Default: report-<test name> here.",
        INTO_FOLDER,
    ] = None,
    details: Annotated[
        Path | None, "TOML file with customer, method, opinions ... in place of [report]."
    ] = None,
    xlsx: Annotated[bool, "Hand over test.xlsx: the whole test in one file."] = False,
    tydex: Annotated[bool, "Hand over test.tdx (TYDEX 1.3)."] = False,
    tir: Annotated[bool, "Hand over tire.tir: MF 6.1 over all loads, forward run."] = False,
    hand_over: Annotated[bool, "All of the three: test.xlsx, test.tdx, tire.tir."] = False,
    models: Annotated[
        list[str] | None,
        "Compare tire models in the report (tk:table.models): a name, may be repeated; 'all' is every one. "
        "Fits take seconds.",
    ] = None,
    units: Annotated[
        str | None,
        "SI or lbf: N and N*m, or lbf and lbf*ft, in tables, figures and text of the report. Default: the "
        "style file's. What is handed over beside it stays in SI, a diagnosis in the units of its case.",
    ] = None,
    diagnosis: Annotated[
        Path | None,
        "Tell the answer of 'toolkit diagnose' in a chapter of the report (tk:diagnosis.*).",
        Mark(metavar="DIR_OR_JSON"),
    ] = None,
    by: Annotated[str | None, "Who releases the diagnosis' opinion on the cause; else a draft."] = None,
    calibration: CalibrationId = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    issue: Annotated[
        bool, "Enter the report in the ledger; its PDF carries the proof. With --seal always."
    ] = False,
    protocol: ProtocolFile = None,
    reader: Reader = "calamine",
    allow_missing: AllowMissing = False,
    keep: Annotated[bool, "Keep a report that was not verified in rejected/ of the folder."] = False,
    *,
    issuing: IssueOptions,
    output: Output,
) -> int:
    """Fill the Word template and make the verified PDF.

    Delivers report.docx, report.pdf and manifest.json, or nothing where the PDF does not show every value
    and figure. Several tests are converted in one call of LibreOffice; one that is refused does not stop
    the others. With --issue it is an entry of the ledger, signed where people are enrolled.

    Example: toolkit report tests/2019-06-04 --template report_templates/org.docx --out reports/89
    """
    from functools import partial

    from toolkit.report.drawer import Drawer
    from toolkit.report.word.office import Office

    basis = issuing.basis(
        calibration=calibration, known_at=known_at, draft=draft, protocol=protocol, reader=reader
    )
    issued = None
    if issue or issuing.asked:
        from toolkit.lab.signatures.issuing import open_issuing

        registry = issuing.registry()
        issued = open_issuing(
            registry, issuing.sealing(registry, draft=draft), asked=issue, draft=draft,
            named=issuing.issued_by or (),
        )  # fmt: skip
    # LibreOffice and matplotlib take a second to start: beside all that is imported and read here.
    with Office() as office, Drawer() as drawer, output.progress("report") as step:
        from toolkit.lab.answers import unit_choice
        from toolkit.lab.home import home_template
        from toolkit.lab.tire_tests.fit_models import model_choice
        from toolkit.lab.tire_tests.handover import diagnosis_of
        from toolkit.lab.tire_tests.reports import (
            Options,
            attention,
            make_reports,
            report_text,
            reports_payload,
        )
        from toolkit.lab.tire_tests.resolve import resolve_test
        from toolkit.report.word.package import read_template

        compared = model_choice(models) if models else ()
        style = None if units is None else unit_choice(units)
        answer_and_file = diagnosis_of(diagnosis, by, tests)
        # The template is judged before anything is read: its error must not wait for a long reduction.
        opened = read_template(template or home_template("org.docx", issuing.home))
        options = Options(
            template=opened,
            resolve=partial(resolve_test, basis=basis, step=step),
            details=details,
            xlsx=xlsx or hand_over,
            tydex=tydex or hand_over,
            tir=tir or hand_over,
            models=compared,
            units=style,
            diagnosis=answer_and_file,
            allow_missing=allow_missing,
            keep=keep,
            issuing=issued,
        )
        delivered = make_reports(tests, options, out, office=office, drawer=drawer, step=step)
    payload = reports_payload(delivered, output.timing)
    output.answer(payload, "\n\n".join(report_text(report) for report in delivered))
    return max(
        2 if report.resolved is None or isinstance(report.outcome, Exception) else int(attention(report))
        for report in delivered
    )
