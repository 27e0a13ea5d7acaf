"""Findings of a session: what a person should look at before the candidate is approved.

None of them changes the fit. Recommendations of another model are notes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.adequacy import COLLINEAR_FINDING
from toolkit.calibration.fit.balance_report import balance_findings
from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.fit.diagnostics import lack_of_fit, load_levels, loadings, replicate_groups
from toolkit.calibration.fit.printed_digits import copies, own_scatter
from toolkit.calibration.fit.recommend import NEGLIGIBLE_PERCENT, recommend_drop, recommend_wider
from toolkit.calibration.fit.robust import contradicting, deviating
from toolkit.calibration.fit.scatter_findings import (
    RunScale,
    difference_findings,
    method_findings,
    run_findings,
    run_scales,
    scatter_findings,
    stated_findings,
)
from toolkit.calibration.fit.session_fit import LoadResult, SessionFit, fit_session, session_statements
from toolkit.calibration.fit.session_rows import groups_of, mean_of
from toolkit.calibration.fit.statement_findings import statement_findings
from toolkit.calibration.records.record import DEFAULT_TOLERANCE
from toolkit.calibration.session.known_errors import undeclared_standard
from toolkit.calibration.session.read import Session
from toolkit.calibration.session.table import Table
from toolkit.errors import SessionError
from toolkit.findings import Finding
from toolkit.recording.hidden import hidden_findings

FEW_POINTS = 30
REPEATED = 0.1
COARSE = 0.05  # of the largest load, a standard uncertainty: nothing is calibrated
MOST_NAMED = 10
# A standard uncertainty itself, and Student's t for 95.45 % at one degree of freedom (13.97).
_LEAST_K, _MOST_K = 1.0, 14.0
_RISK = 0.01
_MOST_ROWS = 20


def session_findings(fit: SessionFit) -> tuple[Finding, ...]:
    """Return the findings of a session's data and fit."""
    session = fit.session
    wrong = {load.setting.name: contradicting_rows(session, load) for load in fit.loads}
    scales = {load.setting.name: run_scales(session, load) for load in fit.loads}
    doubted = {row for rows in wrong.values() for row in rows}
    doubted |= {row for runs in scales.values() for run in runs if run.most for row in run.rows}
    sound = _without(fit, doubted)
    findings = [
        *_data_findings(fit),
        *statement_findings(fit),
        *_model_findings(sound),
        *balance_findings(fit),
    ]
    condition = fit.adequacy.condition_number
    if condition > COLLINEAR_FINDING:
        message = f"condition number {condition:.3g} of the indications, over {COLLINEAR_FINDING:g}"
        findings.append(Finding(rule="collinear", where=session.path.name, message=message))
    for load, judged in zip(fit.loads, sound.loads, strict=True):
        findings += _load_findings(load, wrong[load.setting.name])
        findings += method_findings(session, judged)
        findings += stated_findings(load)
        findings += scatter_findings(judged)
    alone = _single(fit.session, doubted.union(*(load.diagnostics.outliers for load in fit.loads)))
    findings += difference_findings(sound if alone == doubted else _without(fit, alone))
    findings += _robust_findings(fit, wrong)
    findings += [
        finding for load in fit.loads for finding in _scale_findings(load, scales[load.setting.name])
    ]
    return tuple(findings)


def contradicting_rows(session: Session, load: LoadResult) -> tuple[int, ...]:
    """Return the rows (from 1) of a load that contradict the others.

    They do so as they are, and within their runs: runs that differ make no wrong rows, nor do sound rows of a
    run whose zero wrong ones have moved. And they contradict the mean of the others (`session_rows`): what a
    curve misses smoothly and what loading and unloading do apart are no wrong rows.
    """
    if load.exact:
        return ()
    reference = session.table.column(load.setting.name)
    design = build_basis(load.fit.terms, session.table.columns(session.indications)).design
    within = reference - load.of_runs
    root = np.ones(len(reference)) if load.fit.weights is None else np.sqrt(load.fit.weights)
    wrong = contradicting(design * root[:, None], reference * root)
    if wrong and load.of_runs.any():
        apart = contradicting(design * root[:, None], within * root)
        wrong = tuple(row for row in wrong if row in apart)
    if not wrong or load.fit.weights is not None:
        return wrong
    fitted = reference - load.fit.residuals
    mean = mean_of(design, fitted / float(np.abs(fitted).max()), session.table.up).columns
    return deviating(mean, within, wrong)


def _single(session: Session, rows: set[int]) -> set[int]:
    """Return the rows that are wrong by themselves: not those of a run of which most are."""
    group = groups_of(session.table, session.zero)[1]
    among = np.bincount(group[np.array(sorted(rows), dtype=np.int64) - 1], minlength=int(group.max()) + 1)
    majority = among > np.bincount(group) / 2
    return {row for row in rows if not majority[group[row - 1]]}


def _without(fit: SessionFit, rows: set[int]) -> SessionFit:
    """Return a session's fit without rows that contradict the others: advice follows sound rows alone."""
    if not rows:
        return fit
    table = fit.session.table
    remaining = np.ones(table.rows, dtype=np.bool_)
    remaining[[row - 1 for row in rows]] = False
    try:
        return fit_session(dataclasses.replace(fit.session, table=table.only(remaining)))
    except SessionError:
        return fit  # the others alone determine no equation


def _repeated(rows: Array, where: str) -> list[Finding]:
    """Return which rows repeat another one: a finding where they are many, else a note."""
    groups = replicate_groups(rows)
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    repeated = np.flatnonzero(first[inverse] != np.arange(len(rows)))
    if not repeated.size:
        return []
    pairs = [f"{at + 1} = {first[inverse[at]] + 1}" for at in repeated[:MOST_NAMED].tolist()]
    remainder = f" and {repeated.size - MOST_NAMED} more" if repeated.size > MOST_NAMED else ""
    share = repeated.size / len(rows)
    message = (
        f"{repeated.size} of {len(rows)} rows ({100 * share:.2g} %) repeat another row, indications and "
        f"loads alike: rows {', '.join(pairs)}{remainder}"
    )
    return [
        Finding(
            rule="duplicates", where=where, message=message, level="warning" if share > REPEATED else "note"
        )
    ]


def _beyond(session: Session, check: Table) -> list[Finding]:
    """Return the check loads outside of what was fitted, by more than a reading of its end may differ."""
    edges = [(load.name, load.unit, load.tolerance) for load in session.loads]
    edges += [
        (cell.name, cell.unit, DEFAULT_TOLERANCE * float(np.abs(session.table.column(cell.name)).max()))
        for cell in session.cells
    ]
    outside: dict[int, list[str]] = {}
    for name, text, slack in edges:
        fitted, values = session.table.column(name), check.column(name)
        low, high = float(fitted.min()), float(fitted.max())
        for at in np.flatnonzero((values < low - slack) | (values > high + slack)).tolist():
            excess = f"{name} = {values[at]:.6g} {text} (fitted: {low:.6g} to {high:.6g})"
            outside.setdefault(at, []).append(excess)
    return [
        Finding(
            rule="check-beyond-range",
            where=f"check row {at + 1}",
            message=f"{', '.join(excess)}: a check load there verifies an extrapolation, which neither the "
            "fit nor its uncertainty covers",
            level="note",  # as where there are no check loads: the range that was fitted stands
        )
        for at, excess in sorted(outside.items())
    ]


def _data_findings(fit: SessionFit) -> list[Finding]:
    findings: list[Finding] = []
    session = fit.session
    table, where = session.table, session.path.name
    if table.rows < FEW_POINTS:
        message = f"{table.rows} rows, fewer than {FEW_POINTS}: they tell scatter and misfit badly"
        findings.append(Finding(rule="few-points", where=where, message=message))
    names = [*session.indications, *(load.name for load in session.loads)]
    rows = table.matrix(names)
    findings += _repeated(rows, where)
    findings += hidden_findings(table.hidden, where)
    if session.check is not None:
        findings += hidden_findings(session.check.hidden, f"{where}, check loads")
    findings += run_findings(fit)
    if session.check is None:
        message = "no check loads: no term can be verified on approval"
        findings.append(Finding(rule="no-check", where=where, message=message, level="note"))
    else:
        check = session.check.matrix(names)
        findings += [*_repeated(check, f"{where}, check loads"), *_beyond(session, session.check)]
        equations = [(fit.session.terms, load.fit.coefficients, load.fit.residual_sd) for load in fit.loads]
        scatter = own_scatter(fit.session.indications, equations) + [0.0] * len(fit.loads)
        for at, row in copies(check, rows, scatter).items():
            message = (
                f"equals row {row + 1} of the fit, digit by digit: it checks nothing"
                if np.allclose(check[at], rows[row], rtol=1e-6, atol=0)
                else f"repeats row {row + 1} of the fit far below its scatter: it checks nothing"
            )
            findings.append(Finding(rule="check-not-apart", where=f"check row {at + 1}", message=message))
    if session.reference_due is not None and session.reference_due < session.date:
        message = f"the reference standard was due on {session.reference_due.isoformat()}"
        findings.append(Finding(rule="reference-due", where=where, message=message))
    stated = session_statements(session).reference
    for load in session.loads:
        largest = float(np.abs(table.column(load.name)).max())
        if (u := stated.u(load.name)) is not None and u > COARSE * largest:
            message = (
                f"the reference's standard uncertainty is {100 * u / largest:.3g} % of the largest load: "
                "with such a standard nothing is calibrated; is its unit right?"
            )
            findings.append(Finding(rule="coarse-reference", where=load.name, message=message, level="error"))
        if (part := stated.of(load.name)) is not None and not _LEAST_K <= part.k <= _MOST_K:
            message = (
                f"coverage factor k = {part.k:g}, where certificates state {_LEAST_K:g} to {_MOST_K:g}: the "
                f"standard uncertainty would be U/k = {part.u:.3g} {load.unit}; are U and k as certified?"
            )
            findings.append(Finding(rule="reference-k", where=load.name, message=message))
    if session.method == "gls":
        name = undeclared_standard(session_statements(session).reference, table)
        if name is not None:
            message = (
                f"shared_group {name!r} is no column of the data: taken as the name of one standard behind "
                "every row; say so by [reference] standard, or name a column"
            )
            findings.append(Finding(rule="shared-group", where=where, message=message, level="note"))
    return findings


def _load_findings(load: LoadResult, wrong: tuple[int, ...]) -> list[Finding]:
    findings: list[Finding] = []
    name, unit = load.setting.name, load.setting.unit
    for row in _named(load, wrong):
        residual = load.fit.residuals[row - 1] - load.of_runs[row - 1]
        within = (
            f" within its {load.scatter.factor}" if load.scatter is not None and load.of_runs.any() else ""
        )
        message = (
            f"residual {residual:+.4g} {unit}{within}, "
            f"{abs(load.diagnostics.apart[row - 1]):.1f} standard deviations from the other rows"
        )
        findings.append(Finding(rule="outlier", where=f"{name}, row {row}", message=message))
    if load.check_residuals is not None:
        for row in np.flatnonzero(np.abs(load.check_residuals) > load.setting.tolerance).tolist():
            off, tolerance = load.check_residuals[row], load.setting.tolerance
            message = f"off by {off:+.4g} {unit}, tolerance {tolerance:.4g} {unit}"
            where = f"{name}, check row {row + 1}"
            findings.append(Finding(rule="check-load", where=where, message=message))
    return findings


def _named(load: LoadResult, wrong: tuple[int, ...]) -> tuple[int, ...]:
    """Return the outliers by their own residuals, but for sound rows beside which others are wrong."""
    return tuple(row for row in load.diagnostics.outliers if not wrong or row in wrong)


def _model_findings(fit: SessionFit) -> list[Finding]:
    """Recommend other terms, each with the lines to write; the fit stays as the session names it."""
    session = fit.session
    if session.method not in ("ols", "wls"):
        return []
    findings: list[Finding] = []
    wider = recommend_wider(fit)
    if wider is not None:
        message = (
            f"{wider.name} fits better than chance: F = {wider.F:.3g}, p = {wider.probability:.1g}, residual "
            f"sd {wider.before_percent_fs:.3g} -> {wider.after_percent_fs:.3g} % of full scale; "
            f"to use it write in SESSION.toml: {_inline(wider.lines)}"
        )
        where = ", ".join(wider.loads)
        findings.append(Finding(rule="model", where=where, message=message, level="note"))
    spare = recommend_drop(fit)
    if spare is not None:
        small = f"under {NEGLIGIBLE_PERCENT:g} % of full scale in every load"
        groups = {
            f"{small} and significant in none": [t for t in spare.small if t in spare.idle],
            small: [t for t in spare.small if t not in spare.idle],
            "significant in no load": [t for t in spare.idle if t not in spare.small],
        }
        parts = [f"{', '.join(terms)} ({why})" for why, terms in groups.items() if terms]
        message = (
            f"candidates to drop: {'; '.join(parts)}; all at once: p = {spare.probability:.1g}; "
            f"to drop them write in SESSION.toml: {_inline(spare.lines)}"
        )
        findings.append(Finding(rule="terms", where=session.path.name, message=message, level="note"))
    if wider is None:
        findings += _misfits(fit)
    return findings


def _misfits(fit: SessionFit) -> list[Finding]:
    table = fit.session.table
    level = load_levels(table.matrix([load.name for load in fit.session.loads]))
    loading = loadings(level, table.run, table.up)
    findings = []
    for load in fit.loads:
        lack = None if load.exact else lack_of_fit(load.fit, level, loading)
        if lack is None:
            continue
        if lack.probability < _RISK / len(fit.loads):
            message = (
                f"levels differ by more than their own scatter (F = {lack.F:.3g} with {lack.lack_dof} and "
                f"{lack.pure_dof} degrees of freedom, p = {lack.probability:.1g}), and no model that a "
                "session can name fits better: look at the residuals against the load and against the order"
            )
            findings.append(
                Finding(rule="lack-of-fit", where=load.setting.name, message=message, level="note")
            )
    return findings


def _robust_findings(fit: SessionFit, wrong: Mapping[str, tuple[int, ...]]) -> list[Finding]:
    """Name rows that hide each other; those already named as outliers are not named twice."""
    findings = []
    for load in fit.loads:
        name = load.setting.name
        outliers = _named(load, wrong[name])
        rows = [row for row in wrong[name] if row not in outliers]
        if rows:
            message = (
                f"row{'s' if len(rows) > 1 else ''} {_row_list(rows)}{_of_runs(fit.session, rows)}: "
                f"contradict{'' if len(rows) > 1 else 's'} the other rows; rows that are wrong together hide "
                "from the ordinary residuals. The fit is unchanged: look at these loadings"
            )
            findings.append(Finding(rule="robust", where=name, message=message))
    return findings


def _scale_findings(load: LoadResult, scales: tuple[RunScale, ...]) -> list[Finding]:
    findings = []
    for scale in scales:
        first, last = scale.rows[0], scale.rows[-1]
        block = last - first + 1 == len(scale.rows)
        rows = f"{first} to {last}" if block else _row_list(list(scale.rows))
        message = (
            f"{scale.factor} {scale.run:g} (rows {rows}): its loads are {scale.ratio:.4g} times what "
            f"{'most' if scale.most else 'the'} other {scale.factor}s tell of the same indications"
        )
        if scale.units is not None:
            message += f", the ratio of {scale.units}: was it recorded in another unit?"
        findings.append(Finding(rule="run-scale", where=load.setting.name, message=message, level="error"))
    return findings


def _of_runs(session: Session, rows: list[int]) -> str:
    """Return of which runs more than half stand among rows, in words; empty where of none."""
    factor, group = groups_of(session.table, session.zero)
    count = np.bincount(group)
    among = np.bincount(group[np.array(rows) - 1], minlength=len(count))
    if len(count) == 1:
        return ""
    number = session.table.rotation if factor == "mounting" else session.table.run
    numbers = [] if number is None else np.unique(number).tolist()
    texts = [
        f"{part} of the {total} rows of {factor} {name:g}"
        for name, part, total in zip(numbers, among.tolist(), count.tolist(), strict=True)
        if part > total / 2
    ]
    return f" ({', '.join(texts)})" if texts else ""


def _row_list(rows: list[int]) -> str:
    text = ", ".join(str(row) for row in rows[:_MOST_ROWS])
    return text if len(rows) <= _MOST_ROWS else f"{text} and {len(rows) - _MOST_ROWS} more"


def _inline(lines: str) -> str:
    return "; ".join(lines.split("\n"))
