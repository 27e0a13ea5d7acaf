"""What `calibrate` and `calibration report` say of a session: its record, its fit, the next step, figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, NotRequired, TypedDict

from toolkit.declared.answers import entry_of
from toolkit.errors import SessionError, ToolkitError
from toolkit.estimate import round_uncertainty
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import counted, finding_lines
from toolkit.listing import table

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.fit.report import FitReport as LoadReport
    from toolkit.calibration.fit.session_fit import SessionFit
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.candidate import Candidate
    from toolkit.calibration.registry.registry import Registry


class RefittedRecord(TypedDict):
    """A record by its content."""

    id: str
    sha256: str


class RecordReportAnswer(TypedDict):
    """A record's stored data, fitted again."""

    record: RefittedRecord
    loads: Annotated[Mapping[str, Mapping[str, Any]], "the report of each load, as calibrate --full has it"]
    findings: list[FindingEntry]
    balance: NotRequired[Annotated[Mapping[str, Any] | None, "the form of AIAA R-091, of a balance"]]
    figures: NotRequired[Annotated[list[str], "files that were written"]]


class EnteredRecord(TypedDict):
    """The record of a session."""

    id: str
    sha256: str
    status: str
    existing: Annotated[bool, "whether it was recorded before, and nothing was written"]
    path: str


class SessionLoad(TypedDict):
    """The fit of one load, in the units of the session."""

    unit: str
    indication_units: Mapping[str, str]
    coefficients: Mapping[str, float]
    issued: Mapping[str, float]
    standard_errors: Mapping[str, float]
    covariance_model: str | None
    scatter: Mapping[str, Any] | None
    residual_sd: float
    dof: float
    condition_number: Annotated[float, "of the indications, centred and scaled"]
    condition_number_terms: float
    vif: Annotated[Mapping[str, float], "variance inflation by indication"]
    llf: Annotated[float, "lower limit factor, 2.4 residual_sd"]
    check_max_percent_fs: float | None
    press: Annotated[float | None, "root mean square of the rows predicted without themselves"]
    reversibility: float | None
    outlier_rows: list[int]
    report: NotRequired[Annotated[Mapping[str, Any], "with --full"]]


class FittedSession(TypedDict):
    """A session, fitted, and its record."""

    record: EnteredRecord
    signature: Annotated[str, "who signed the record's decisions, or unsigned"]
    findings: list[FindingEntry]
    readings: Annotated[Mapping[str, Any], "zero, creep and shunt readings, evaluated"]
    residual_correlation: Mapping[str, Mapping[str, float]]
    loads: Mapping[str, SessionLoad]


class CalibrateAnswer(FittedSession):
    """A session, fitted and entered as a candidate."""

    dry_run: Annotated[bool, "whether nothing was entered"]
    standards: Annotated[list[Mapping[str, Any]], "evaluations by ASTM E74 and ISO 376"]
    balance: NotRequired[Annotated[Mapping[str, Any] | None, "the form of AIAA R-091, of a balance"]]
    figures: NotRequired[Annotated[list[str], "files that were written"]]


NOT_ENTERED = "not entered"


@dataclass(frozen=True, slots=True, kw_only=True)
class FitReport:
    """The report as JSON by load, what stands beside the loads, and as text."""

    loads: dict[str, Any]
    payload: dict[str, Any]
    text: str


def fit_report(fit: SessionFit, record: CalibrationRecord, *, full: bool, figures: Path | None) -> FitReport:
    """Return a fit's report, and write its figures where a folder is named; ``record`` is that of the fit.

    Raises
    ------
    OutputError
        a figure cannot be written; the record stands
    """
    from toolkit.calibration.fit.balance_report import report_balance
    from toolkit.calibration.fit.report import report_session
    from toolkit.calibration.uncertainty.common_errors import record_covariance
    from toolkit.report.calibration.text import balance_dict, balance_text, report_dict, report_text

    reports = report_session(fit, record_covariance(record))
    blocks = [report_text(report) for report in reports] if full else []
    payload: dict[str, Any] = {}
    if fit.session.model == "balance":
        try:
            balance = report_balance(fit)
        except SessionError as error:
            # The finding says why; the record's own form is not touched by it.
            payload["balance"] = None
            blocks += [f"no balance form: {error.what}; got {error.got}"] if full else []
        else:
            payload["balance"] = balance_dict(balance)
            blocks += [balance_text(balance)] if full else []
    if figures is not None:
        payload["figures"] = _write(reports, record.id, figures)
        blocks.append(f"{counted(len(payload['figures']), 'figure')} in {figures}")
    return FitReport(
        loads={report.load: report_dict(report, rows=full) for report in reports},
        payload=payload,
        text="".join(f"\n\n{block}" for block in blocks),
    )


def _write(reports: Sequence[LoadReport], title: str, folder: Path) -> list[str]:
    from toolkit.publication import publication
    from toolkit.report.calibration.figures import report_figures

    pictures: dict[str, bytes] = {}
    for report in reports:
        pictures |= report_figures(report, title=title)
    with publication(folder) as stage:
        for name, data in pictures.items():
            (stage / name).write_bytes(data)
    return sorted(pictures)


def record_report(
    registry: Registry, record_id: str, figures: Path | None
) -> tuple[RecordReportAnswer, str, Sequence[Finding]]:
    """Return a record's stored data, fitted again, as JSON and as text, with the findings.

    Raises
    ------
    OutputError
        the folder of the figures cannot be written
    """
    from toolkit.calibration.fit.findings import session_findings
    from toolkit.calibration.fit.session_fit import fit_session
    from toolkit.calibration.registry.stored import stored_session

    record = registry.load(record_id)
    fit = fit_session(stored_session(registry.folder, record))
    findings = session_findings(fit)
    report = fit_report(fit, record, full=True, figures=figures)
    text = f"{record.id}  {record.instrument}, session of {record.date}\nsha256 {record.sha256}{report.text}"
    if findings:
        text += "\n\nfindings:\n" + "\n".join(finding_lines(findings))
    payload = entry_of(
        RecordReportAnswer, report,
        record=entry_of(RefittedRecord, record), findings=[finding.as_dict() for finding in findings],
        **report.payload,
    )  # fmt: skip
    return payload, text, findings


def candidate_payload(candidate: Candidate, status: str, signature: str) -> FittedSession:
    """Return a session's record and fit as the JSON answer; ``signature`` says who signed its decisions."""
    from toolkit.calibration.fit.readings import readings_json
    from toolkit.calibration.fit.session_fit import residual_correlation
    from toolkit.calibration.uncertainty.common_errors import standard_errors

    record = candidate.record
    names = [load.setting.name for load in candidate.fit.loads]

    def by_load(values: list[Any]) -> dict[str, Any]:
        return dict(zip(names, values, strict=True))

    loads: dict[str, SessionLoad] = {}
    for load in candidate.fit.loads:
        # Of a session that is recorded already the record's own figures hold, whatever a fit gives today.
        fit, diagnostics, stored = load.fit, load.diagnostics, record.load(load.setting.name)
        loads[load.setting.name] = {
            "unit": load.setting.unit,
            "indication_units": record.units,
            "coefficients": dict(zip(fit.terms, fit.coefficients, strict=True)),
            "issued": dict(zip(fit.terms, stored.issued, strict=True)),
            "standard_errors": dict(zip(fit.terms, standard_errors(record, stored.load), strict=True)),
            "covariance_model": stored.covariance_model,
            "scatter": None if stored.scatter is None else asdict(stored.scatter),
            "residual_sd": fit.residual_sd,
            "dof": fit.dof,
            "condition_number": candidate.fit.adequacy.condition_number,
            "condition_number_terms": candidate.fit.adequacy.condition_number_terms,
            "vif": dict(zip(record.indications, candidate.fit.adequacy.vif, strict=True)),
            "llf": load.llf,
            "check_max_percent_fs": load.check_max_percent_fs,
            "press": diagnostics.press,
            "reversibility": diagnostics.reversibility,
            "outlier_rows": list(diagnostics.outliers),
        }
    return {
        "record": {
            "id": record.id,
            "sha256": record.sha256,
            "status": status,
            "existing": candidate.existing,
            "path": str(candidate.path),
        },
        "signature": signature,
        "findings": [finding.as_dict() for finding in candidate.findings],
        "readings": readings_json(candidate.readings),
        "residual_correlation": by_load(
            [by_load(row) for row in residual_correlation(candidate.fit).tolist()]
        ),
        "loads": loads,
    }


def candidate_text(candidate: Candidate, status: str, signature: str) -> str:
    """Return a session's record and fit for people."""
    from toolkit.calibration.uncertainty.common_errors import standard_errors

    record = candidate.record
    lines = [
        f"{record.id}  {status}"
        + ("  (already recorded; nothing was written)" if candidate.existing else ""),
        f"sha256 {record.sha256}",
        f"file   {candidate.path}" + ("  (not written: a dry run)" if status == NOT_ENTERED else ""),
        f"signature: {signature}",
    ]
    for load in candidate.fit.loads:
        stored = record.load(load.setting.name)
        units = record.units
        rows = [
            [term, f"{c:.10g}", i, round_uncertainty(u), _per(term, load.setting.unit, units)]
            for term, c, i, u in zip(
                load.fit.terms,
                load.fit.coefficients,
                stored.issued_texts,
                standard_errors(record, stored.load),
                strict=True,
            )
        ]
        check = "no check loads" if load.check_max_percent_fs is None else (
            f"check loads within {load.check_max_percent_fs:.3g} % of full scale"
        )  # fmt: skip
        lines += [
            "",
            f"{load.setting.name} [{load.setting.unit}]",
            table(["term", "coefficient", "issued", "std error", "unit"], rows, align="<>>><"),
            f"residual sd {load.fit.residual_sd:.3g} {load.setting.unit}, {load.fit.dof} degrees of freedom, "
            f"lower limit factor {load.llf:.3g} {load.setting.unit}; {check}",
            *([stored.scatter_words] if stored.scatter_words else []),
        ]
    lines += ["", f"condition number of the indications {candidate.fit.adequacy.condition_number:.3g}"]
    if candidate.findings:
        lines += ["findings:", *finding_lines(candidate.findings)]
    return "\n".join(lines)


def next_step(registry: Registry, record: CalibrationRecord, machine: str | None) -> str:
    """Return the approval, with what its gates ask for; where they block it, what comes before."""
    from toolkit.calibration.registry.judgement import machine_of
    from toolkit.calibration.registry.standing import failed_gates, gate_words

    try:
        failed = failed_gates(registry, record, machine=machine_of(record.instrument, machine))
    except ToolkitError as error:
        return f"what an approval would be refused for: {error.what} ({error.where}); {error.next_step}"
    blocks = [check for check in failed if check.effect == "blocks"]
    if blocks:
        return (
            f"settle what 'calibration approve' would refuse: {gate_words(blocks)} (toolkit explain RULE "
            f"tells more); where the session is wrong, correct it, calibrate again and discard {record.id}"
        )
    words = f"toolkit calibration approve {record.id} --in-force-from {record.date} --checked-by NAME"
    rules = {check.rule for check in failed}
    words += f" --machine {machine}" if machine else ""
    words += " --reason TEXT" if "replacement" in rules else ""
    words += " --polarity FILE" if "polarity-reading" in rules else ""
    return words


def _per(term: str, load_unit: str, units: dict[str, str]) -> str:
    if term == "intercept":
        return load_unit
    return f"{load_unit}/({units[term]})" if term in units else f"{load_unit} per unit of {term}"
