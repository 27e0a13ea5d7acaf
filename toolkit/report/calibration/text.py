"""A fit's report as plain text, and as a JSON-ready dict: the same content, nothing computed here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from toolkit.calibration.fit.balance_report import BalanceLoad, BalanceReport
from toolkit.calibration.fit.report import Coefficient, FitReport
from toolkit.estimate import plus_minus, round_uncertainty
from toolkit.listing import or_dash, table

# Cook's distance over 4/n and a leverage over twice the mean are looked at (Cook and Weisberg, 1982).
_MOST_ROWS = 12


def report_dict(report: FitReport, *, rows: bool) -> dict[str, Any]:
    """Return a load's report as a dict; ``rows`` adds what is told row by row."""
    lack = report.lack_of_fit
    content: dict[str, Any] = {
        "full_scale": report.full_scale,
        "n": report.n,
        "r_squared": report.r_squared,
        "predicted_r_squared": report.predicted_r_squared,
        "press": report.tests.press,
        "coefficients": {c.term: _entry_without(c, "term") for c in report.coefficients},
        "covariance": report.fit.covariance.tolist(),
        "correlation": report.correlation.tolist(),
        "vif": dict(report.vif),
        "lack_of_fit": None if lack is None else asdict(lack),
        "levels": report.levels,
        "replicated_rows": report.replicated_rows,
        "heteroscedasticity_p": report.tests.heteroscedasticity,
        "normality": None if report.normality is None else {
            "W": report.normality[0], "probability": report.normality[1],
        },
        "prediction_half_width": report.prediction_half_width,
        "prediction_coverage": 0.95,
        "tolerance_percent_fs": report.tolerance_percent_fs,
        "check_percent_fs": None if report.check_percent_fs is None else report.check_percent_fs.tolist(),
        "reversibility_percent_fs": report.reversibility_percent_fs,
        "reversals": [asdict(reversal) for reversal in report.reversals],
        "noise_free": report.noise_free,
    }  # fmt: skip
    if rows:
        weight = report.robust_weight
        content["rows"] = {
            "reference": report.reference.tolist(),
            "fitted": (report.reference - report.fit.residuals).tolist(),
            "residual": report.fit.residuals.tolist(),
            "leverage": report.fit.leverage.tolist(),
            "internal": report.tests.internal.tolist(),
            "external": report.tests.external.tolist(),
            "cook": report.tests.cook.tolist(),
            "robust_weight": None if weight is None else weight.tolist(),
            "direction": None if report.direction is None else list(report.direction),
        }
    return content


def balance_dict(report: BalanceReport) -> dict[str, Any]:
    """Return the balance form's report as a dict."""
    form, tares = report.form, report.tares
    return {
        "terms": list(form.terms),
        "not_excited": list(form.not_excited),
        "coefficients": {
            name: dict(zip(form.terms, row, strict=True))
            for name, row in zip(form.responses, form.coefficients.tolist(), strict=True)
        },
        "steps": report.steps,
        "newton_steps": report.newton_steps,
        "newton_difference": report.newton_difference,
        "loads": {load.load: _entry_without(load, "load", "unit") for load in report.loads},
        "tares": None if tares is None else {
            "relative": tares.relative,
            "steps": tares.steps,
            "values": [
                {"run": run, **dict(zip(form.loads, row, strict=True))}
                for run, row in zip(tares.runs, tares.values.tolist(), strict=True)
            ],
        },
    }  # fmt: skip


def _entry_without(entry: BalanceLoad | Coefficient, *names: str) -> dict[str, Any]:
    return {key: value for key, value in asdict(entry).items() if key not in names}


def report_text(report: FitReport) -> str:
    """Return a load's whole report as lines."""
    unit, fs = report.unit, "% FS"
    lines = [
        f"{report.load} [{unit}]  {report.n} rows, {report.fit.dof} degrees of freedom, full scale "
        f"{report.full_scale:.6g} {unit}",
        "",
        table(
            ["term", "coefficient", "std error", "t", "sign sure", fs],
            [
                [c.term, f"{c.value:.8g}", round_uncertainty(c.standard_error), f"{c.t:.1f}",
                 _sure(c.sign_confidence), f"{c.percent_fs:.3g}"]
                for c in report.coefficients
            ],
        ),
        "",
        "correlation of the coefficients",
        table(
            ["", *(c.term for c in report.coefficients)],
            [
                [c.term, *(f"{v:+.2f}" for v in row[: i + 1]), *("" for _ in row[i + 1 :])]
                for i, (c, row) in enumerate(
                    zip(report.coefficients, report.correlation.tolist(), strict=True)
                )
            ],
        ),
        "",
        *_pairs(_figures(report)),
    ]  # fmt: skip
    if report.noise_free:
        lines.append("the scatter is rounding of the numbers: no test says anything")
    else:
        lines += ["", "rows to look at", _rows(report)]
    if report.check_percent_fs is not None and report.check_reference is not None:
        lines += ["", "check loads", _checks(report)]
    if report.reversals:
        lines += ["", "reversibility: indicated load going down minus going up, at equal loads"]
        lines.append(_reversals(report))
    return "\n".join(lines)


def balance_text(report: BalanceReport) -> str:
    """Return the balance form's report as lines."""
    form, tares = report.form, report.tares
    lines = [
        "balance form (AIAA R-091): responses fitted on the loads, loads found by iteration; the record "
        "holds the direct form",
        "",
        table(
            ["term", *form.responses],
            [
                [term, *(f"{value:.6g}" for value in column)]
                for term, column in zip(form.terms, form.coefficients.T.tolist(), strict=True)
            ],
        ),
    ]
    if form.not_excited:
        lines.append(f"not told apart by these loads, left out of this form: {', '.join(form.not_excited)}")
    rows = [
        [load.load, f"{load.direct_sd_percent_fs:.3g}", f"{load.direct_max_percent_fs:.3g}",
         f"{load.iterated_sd_percent_fs:.3g}", f"{load.iterated_max_percent_fs:.3g}",
         or_dash(load.check_direct_percent_fs, ".3g"), or_dash(load.check_iterated_percent_fs, ".3g")]
        for load in report.loads
    ]  # fmt: skip
    header = ["% FS", "direct sd", "max", "iterated sd", "max", "check direct", "check iterated"]
    lines += [
        "",
        table(header, rows),
        f"load iteration: {report.steps} steps; Newton: {report.newton_steps}, largest difference "
        f"{100 * report.newton_difference:.1g} % of full scale",
    ]
    if tares is not None:
        kind = "counted from the runs' mean" if tares.relative else "counted from the natural zero"
        lines += ["", f"tare loads by run, {kind} ({tares.steps} steps)"]
        lines.append(
            table(
                ["run", *(f"{load.load} [{load.unit}]" for load in report.loads)],
                [
                    [str(run), *(plus_minus(v, u) for v, u in zip(row, errors, strict=True))]
                    for run, row, errors in zip(
                        tares.runs, tares.values.tolist(), tares.standard_errors.tolist(), strict=True
                    )
                ],
            )
        )
    return "\n".join(lines)


def _figures(report: FitReport) -> list[tuple[str, str]]:
    fit, tests = report.fit, report.tests
    of_cells, of_terms = report.adequacy.condition_number, report.adequacy.condition_number_terms
    unit, fs = report.unit, 100 / report.full_scale
    lack, spread, normal = report.lack_of_fit, tests.heteroscedasticity, report.normality
    levels = f"{report.levels} load levels with {report.replicated_rows} rows"
    rows = [
        ("residual sd", f"{fit.residual_sd:.4g} {unit} ({fit.residual_sd * fs:.3g} % FS)"),
        ("PRESS (rms, left out)", f"{tests.press:.4g} {unit} ({tests.press * fs:.3g} % FS)"),
        ("R^2, predicted R^2", f"{_near_one(report.r_squared)}, {_near_one(report.predicted_r_squared)}"),
        ("prediction, full scale", f"± {report.prediction_half_width:.4g} {unit} (95 %)"),
        ("condition number", f"{of_cells:.3g} (terms {of_terms:.3g})"),
        ("VIF", ", ".join(f"{name} {value:.2f}" for name, value in report.vif)),
        ("lack of fit", f"none determined; {levels}" if lack is None else (
            f"F({lack.lack_dof}, {lack.pure_dof}) = {lack.F:.3g}, p = {lack.probability:.2g}; {levels}, "
            f"pure error {lack.pure_error_sd:.3g}")),
        ("even scatter", "not tested" if spread is None else f"Breusch-Pagan p = {spread:.2g}"),
        ("normal residuals", "not tested" if normal is None else (
            f"Shapiro-Wilk W = {normal[0]:.4f}, p = {normal[1]:.2g}")),
    ]  # fmt: skip
    if report.reversibility_percent_fs is not None:
        rows.append(("reversibility", f"{report.reversibility_percent_fs:+.3g} % FS at worst"))
    return rows


def _rows(report: FitReport) -> str:
    fit, tests = report.fit, report.tests
    mean = 1 - fit.dof / report.n
    weight = np.ones(report.n) if report.robust_weight is None else report.robust_weight
    marks = {
        "outlier": np.isin(np.arange(report.n), np.array(tests.outliers, dtype=int) - 1),
        "leverage": fit.leverage > 2 * mean,
        "Cook": tests.cook > 4 / report.n,
        "robust": weight < 0.05,
    }
    interest = np.flatnonzero(np.any(list(marks.values()), axis=0))
    if not len(interest):
        return "  none: no outlier, no leverage over twice the mean, no Cook's distance over 4/n"
    order = interest[np.argsort(-tests.cook[interest])][:_MOST_ROWS]
    text = table(
        ["row", "reference", "residual", "leverage", "internal", "external", "Cook", "weight", "why"],
        [
            [str(i + 1), f"{report.reference[i]:.6g}", f"{fit.residuals[i]:+.3g}",
             f"{fit.leverage[i]:.3f}", f"{tests.internal[i]:+.2f}", f"{tests.external[i]:+.2f}",
             f"{tests.cook[i]:.3f}", f"{weight[i]:.2f}",
             ", ".join(name for name, rows in marks.items() if rows[i])]
            for i in order.tolist()
        ],
        align=">>>>>>>><",
    )  # fmt: skip
    omitted = len(interest) - len(order)
    return text + (f"\n  and {omitted} more of smaller Cook's distance" if omitted else "")


def _checks(report: FitReport) -> str:
    reference, off = report.check_reference, report.check_percent_fs
    if reference is None or off is None:
        return ""
    return table(
        [
            "row",
            f"reference [{report.unit}]",
            "fitted - reference [% FS]",
            f"± {report.tolerance_percent_fs:.3g}",
        ],
        [
            [str(i), f"{value:.6g}", f"{d:+.4f}", "ok" if abs(d) <= report.tolerance_percent_fs else "OUT"]
            for i, (value, d) in enumerate(zip(reference.tolist(), off.tolist(), strict=True), start=1)
        ],
    )  # fmt: skip


def _reversals(report: FitReport) -> str:
    worst = sorted(report.reversals, key=lambda r: -abs(r.percent_fs))[:_MOST_ROWS]
    text = table(
        ["run", f"load [{report.unit}]", f"down - up [{report.unit}]", "% FS"],
        [
            [
                "-" if r.run is None else str(r.run),
                f"{r.load:.6g}",
                f"{r.difference:+.3g}",
                f"{r.percent_fs:+.4f}",
            ]
            for r in worst
        ],
    )  # fmt: skip
    omitted = len(report.reversals) - len(worst)
    return text + (f"\n  and {omitted} more, smaller" if omitted else "")


def _sure(value: float) -> str:
    # 1.0000 would claim what no data can.
    return "> 99.99 %" if value > 0.9999 else f"{100 * value:.2f} %"


def _near_one(value: float) -> str:
    return f"1 - {1 - value:.2g}" if 0 < 1 - value < 1e-3 else f"{value:.6f}"


def _pairs(rows: Sequence[tuple[str, str]]) -> list[str]:
    width = max(len(name) for name, _ in rows)
    return [f"{name:<{width}}  {value}" for name, value in rows]
