"""What `calibrate` and `calibration report` say of a session: its record, its fit, the next step, figures."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from toolkit.errors import SessionError, ToolkitError
from toolkit.estimate import round_uncertainty
from toolkit.lab.answers import finding_lines, table

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.fit.session_fit import SessionFit
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.candidate import Candidate
    from toolkit.calibration.registry.registry import Registry

NOT_ENTERED = "not entered"


@dataclass(frozen=True, slots=True, kw_only=True)
class FitReport:
    """The report as JSON by load, what stands beside the loads, and as text."""

    loads: dict[str, Any]
    payload: dict[str, Any]
    text: str


def fit_report(fit: SessionFit, *, title: str, full: bool, figures: Path | None) -> FitReport:
    """Return a fit's report, and write its figures where a folder is named.

    Raises
    ------
    OutputError
        a figure cannot be written; the record stands
    """
    from toolkit.calibration.fit.balance_report import report_balance
    from toolkit.calibration.fit.report import report_session
    from toolkit.report.calibration.text import balance_dict, balance_text, report_dict, report_text

    reports = report_session(fit)
    blocks = [report_text(one) for one in reports] if full else []
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
        payload["figures"] = _write(fit, title, figures)
        blocks.append(f"{len(payload['figures'])} figures in {figures}")
    return FitReport(
        loads={one.load: report_dict(one, rows=full) for one in reports},
        payload=payload,
        text="".join(f"\n\n{block}" for block in blocks),
    )


def _write(fit: SessionFit, title: str, folder: Path) -> list[str]:
    from toolkit.calibration.fit.report import report_session
    from toolkit.files import write_atomic
    from toolkit.report.calibration.figures import report_figures

    made: dict[str, bytes] = {}
    for one in report_session(fit):
        made |= report_figures(one, title=title)
    for name, data in made.items():
        write_atomic(folder / name, data)
    return sorted(made)


def candidate_payload(made: Candidate, status: str) -> dict[str, Any]:
    """Return a session's record and fit as the JSON answer."""
    from toolkit.calibration.fit.readings import readings_json
    from toolkit.calibration.fit.session_fit import residual_correlation

    record = made.record
    names = [one.setting.name for one in made.fit.loads]

    def by_load(values: list[Any]) -> dict[str, Any]:
        return dict(zip(names, values, strict=True))

    loads = {}
    for one in made.fit.loads:
        # Of a session that is recorded already the record's own figures hold, whatever a fit gives today.
        fit, more, kept = one.fit, one.diagnostics, record.load(one.setting.name)
        loads[one.setting.name] = {
            "unit": one.setting.unit,
            "indication_units": dict(zip(record.indications, record.indication_units, strict=True)),
            "coefficients": dict(zip(fit.terms, fit.coefficients, strict=True)),
            "issued": dict(zip(fit.terms, kept.issued, strict=True)),
            "standard_errors": dict(zip(fit.terms, kept.standard_errors, strict=True)),
            "covariance_model": kept.covariance_model,
            "scatter": None if kept.scatter is None else asdict(kept.scatter),
            "residual_sd": fit.residual_sd,
            "dof": fit.dof,
            "condition_number": made.fit.condition_number,
            "condition_number_terms": made.fit.condition_number_terms,
            "vif": dict(zip(record.indications, made.fit.vif, strict=True)),
            "llf": one.llf,
            "check_max_percent_fs": one.check_max_percent_fs,
            "press": more.press,
            "reversibility": more.reversibility,
            "outlier_rows": list(more.outliers),
        }
    return {
        "record": {
            "id": record.id,
            "sha256": record.sha256,
            "status": status,
            "existing": made.existing,
            "path": str(made.path),
        },
        "findings": [finding.as_dict() for finding in made.findings],
        "readings": readings_json(made.readings),
        "residual_correlation": by_load([by_load(row) for row in residual_correlation(made.fit).tolist()]),
        "loads": loads,
    }


def candidate_text(made: Candidate, status: str) -> str:
    """Return a session's record and fit for people."""
    record = made.record
    lines = [
        f"{record.id}  {status}" + ("  (already recorded; nothing was written)" if made.existing else ""),
        f"sha256 {record.sha256}",
        f"file   {made.path}" + ("  (not written: a dry run)" if status == NOT_ENTERED else ""),
    ]
    for one in made.fit.loads:
        kept = record.load(one.setting.name)
        units = dict(zip(record.indications, record.indication_units, strict=True))
        rows = [
            [term, f"{c:.10g}", f"{i:.8g}", round_uncertainty(u), _per(term, one.setting.unit, units)]
            for term, c, i, u in zip(
                one.fit.terms, one.fit.coefficients, kept.issued, kept.standard_errors, strict=True
            )
        ]
        check = "no check loads" if one.check_max_percent_fs is None else (
            f"check loads within {one.check_max_percent_fs:.3g} % of full scale"
        )  # fmt: skip
        lines += [
            "",
            f"{one.setting.name} [{one.setting.unit}]",
            table(["term", "coefficient", "issued", "std error", "unit"], rows, align="<>>><"),
            f"residual sd {one.fit.residual_sd:.3g} {one.setting.unit}, {one.fit.dof} degrees of freedom, "
            f"lower limit factor {one.llf:.3g} {one.setting.unit}; {check}",
            *([kept.scatter_words] if kept.scatter_words else []),
        ]
    lines += ["", f"condition number of the indications {made.fit.condition_number:.3g}"]
    if made.findings:
        lines += ["findings:", *finding_lines(made.findings)]
    return "\n".join(lines)


def next_step(registry: Registry, record: CalibrationRecord, machine: str | None) -> str:
    """Return the approval, with what its gates ask for; where they block it, what comes before."""
    from toolkit.calibration.registry.judgement import machine_of
    from toolkit.calibration.registry.standing import failed_gates, gate_words

    try:
        failed = failed_gates(registry, record, machine=machine_of(record.instrument, machine))
    except ToolkitError as error:
        return f"what an approval would be refused for: {error.what} ({error.where}); {error.next_step}"
    blocks = [one for one in failed if one.effect == "blocks"]
    if blocks:
        return (
            f"settle what 'calibration approve' would refuse: {gate_words(blocks)} (toolkit explain RULE "
            f"tells more); where the session is wrong, correct it, calibrate again and discard {record.id}"
        )
    words = f"toolkit calibration approve {record.id} --in-force-from {record.date} --checked-by NAME"
    asked = {one.rule for one in failed}
    words += f" --machine {machine}" if machine else ""
    words += " --reason TEXT" if "replacement" in asked else ""
    words += " --polarity FILE" if "polarity-reading" in asked else ""
    return words


def _per(term: str, load_unit: str, units: dict[str, str]) -> str:
    if term == "intercept":
        return load_unit
    return f"{load_unit}/({units[term]})" if term in units else f"{load_unit} per unit of {term}"
