"""`toolkit calibrate SESSION.toml`: fit a session's reference-load data."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
from toolkit.cli.fit_report import Figures, Full, check_folder, tell
from toolkit.cli.home import registry_to_write
from toolkit.errors import ConfigError, ToolkitError
from toolkit.estimate import round_uncertainty

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.candidate import Candidate
    from toolkit.calibration.registry.registry import Registry

NAME = "calibrate"
NOT_ENTERED = "not entered"


def command(
    session: Annotated[Path, typer.Argument(help="SESSION.toml, with its CSV or .xlsx files beside it.")],
    calibrations: Calibrations = None,
    out: Annotated[Path | None, typer.Option("--out", help="Another name for --calibrations.")] = None,
    machine: Machine = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Compute and judge everything, and make nothing.")
    ] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Enter a session anew whose record was discarded.")
    ] = False,
    full: Full = False,
    figures: Figures = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fit a session: a candidate record and its diagnostics.

    A class of ISO 376 is granted to a session of one indication and one load that states its preloads to
    the largest load, "[standard] preloads = 3", and has runs at rotated mountings; rows are in time order.

    Example: toolkit calibrate sessions/2026-03.toml --figures fit
    """
    from toolkit.calibration.control.calibrate import calibrate, rehearse
    from toolkit.calibration.registry.registry import Registry

    if calibrations is not None and out is not None and calibrations != out:
        raise ConfigError(
            "the registry is named twice",
            where="--calibrations, --out",
            got=f"{calibrations} and {out}",
            expected="one folder: --out is another name for --calibrations",
            next_step="leave one of them out; nothing was written",
            rule="usage",
        )
    registry = Registry(registry_to_write(calibrations or out, home))
    if dry_run and figures is not None:
        raise ConfigError(
            "a dry run makes no files",
            where="--dry-run, --figures",
            got=f"--figures {figures}",
            expected="one of the two",
            next_step="leave out --figures, or enter the session; nothing was written",
            rule="usage",
        )
    check_folder(figures)
    made = (rehearse if dry_run else calibrate)(session, registry, machine=machine, again=again)
    status = NOT_ENTERED if dry_run and not made.existing else registry.status(made.record.id).state
    payload, text = _payload(made, status), _text(made, status)
    if status == "candidate":
        text += f"\n\nnext: {_next(registry, made.record, machine)}"
    payload["dry_run"] = dry_run
    if full or as_json or figures is not None:
        from toolkit.calibration.standards.evaluation import evaluations

        payload["standards"] = [one.as_dict() for one in evaluations(made.fit)]
        told = tell(made.fit, title=made.record.id, full=full, figures=figures)
        for name, report in told.loads.items():
            payload["loads"][name]["report"] = report
        payload |= told.payload
        text += told.text
    answer(payload, text, as_json=as_json, quiet=quiet)
    return 0 if made.existing else exit_code(made.findings)


def _payload(made: Candidate, status: str) -> dict[str, Any]:
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


def _text(made: Candidate, status: str) -> str:
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


def _next(registry: Registry, record: CalibrationRecord, machine: str | None) -> str:
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
