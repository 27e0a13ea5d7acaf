"""Findings of a session: what a person should look at before the candidate is approved.

None of them changes the fit. Recommendations of another model are notes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.adequacy import COLLINEAR_FINDING
from toolkit.calibration.fit.diagnostics import repeated_share
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.fit.session_fit import LoadResult, SessionFit
    from toolkit.calibration.session.read import Session

FEW_POINTS = 30
REPEATED = 0.1
_RISK = 0.01


def session_findings(fit: SessionFit) -> tuple[Finding, ...]:
    """Return the findings of a session's data and fit."""
    session = fit.session
    found = [*_data_findings(session), *_model_findings(fit)]
    if fit.condition_number > COLLINEAR_FINDING:
        message = (
            f"condition number {fit.condition_number:.3g} of the indications, over {COLLINEAR_FINDING:g}"
        )
        found.append(Finding(rule="collinear", where=session.path.name, message=message))
    for one in fit.loads:
        found += _load_findings(session, one)
    return tuple(found)


def _data_findings(session: Session) -> list[Finding]:
    found: list[Finding] = []
    table, where = session.table, session.path.name
    if table.rows < FEW_POINTS:
        message = f"{table.rows} points; ASTM E74 asks for at least {FEW_POINTS}"
        found.append(Finding(rule="few-points", where=where, message=message))
    names = [*session.indications, *(load.name for load in session.loads)]
    rows = table.matrix(names)
    share = repeated_share(rows)
    if share > REPEATED:
        message = f"{100 * share:.0f} % of the rows repeat another row, indications and loads alike"
        found.append(Finding(rule="duplicates", where=where, message=message))
    if session.check is None:
        message = "no check loads: no term can be verified on approval"
        found.append(Finding(rule="no-check", where=where, message=message, level="note"))
    else:
        fitted = {tuple(row) for row in rows.tolist()}
        for number, row in enumerate(session.check.matrix(names).tolist(), start=1):
            if tuple(row) in fitted:
                message = "a check load equals a row of the fit: it checks nothing"
                found.append(Finding(rule="check-not-apart", where=f"check row {number}", message=message))
    if session.reference_due is not None and session.reference_due < session.date:
        message = f"the reference standard was due on {session.reference_due.isoformat()}"
        found.append(Finding(rule="reference-due", where=where, message=message))
    return found


def _load_findings(session: Session, one: LoadResult) -> list[Finding]:
    found: list[Finding] = []
    name, unit = one.setting.name, one.setting.unit
    for row in one.diagnostics.outliers:
        message = (
            f"residual {one.fit.residuals[row - 1]:+.4g} {unit}, "
            f"{abs(one.diagnostics.external[row - 1]):.1f} standard deviations from the other rows"
        )
        found.append(Finding(rule="outlier", where=f"{name}, row {row}", message=message))
    if one.check_residuals is not None:
        for row in np.flatnonzero(np.abs(one.check_residuals) > one.setting.tolerance).tolist():
            message = (
                f"off by {one.check_residuals[row]:+.4g} {unit}, tolerance {one.setting.tolerance:.4g} {unit}"
            )
            found.append(Finding(rule="check-load", where=f"{name}, check row {row + 1}", message=message))
    spread = one.diagnostics.heteroscedasticity
    if spread is not None and spread < _RISK and session.method == "ols":
        message = 'the scatter grows or shrinks with the load; consider method = "wls" with u_ columns'
        found.append(Finding(rule="method", where=name, message=message, level="note"))
    return found


def _model_findings(fit: SessionFit) -> list[Finding]:
    """Recommend the next model where it fits better beyond chance (F test on the added terms)."""
    from scipy.special import fdtrc

    from toolkit.calibration.fit.regression import fit_terms
    from toolkit.calibration.terms import model_terms

    session = fit.session
    if session.model == "balance" or session.method != "ols":
        return []
    degree = session.degree + 1
    terms = model_terms("polynomial", session.indications, degree=degree)
    extra = len(terms) - len(session.terms)
    columns = session.table.columns(session.indications)
    found: list[Finding] = []
    for one in fit.loads:
        if one.fit.dof <= extra + 1 or one.fit.residual_sd <= 1e-12 * one.setting.tolerance:
            continue
        try:
            wider = fit_terms(terms=terms, columns=columns, load=session.table.column(one.setting.name))
        except np.linalg.LinAlgError:
            continue
        rest = wider.residual_sd**2
        gain = one.fit.residual_sd**2 * one.fit.dof - rest * wider.dof
        ratio = gain / extra / rest if rest > 0 else 0.0
        probability = float(fdtrc(extra, wider.dof, max(ratio, 0.0)))
        if probability < _RISK / 10:
            message = (
                f"degree {degree} is recommended: it fits better (F = {ratio:.3g}, p = {probability:.1g})"
            )
            found.append(Finding(rule="model", where=one.setting.name, message=message, level="note"))
    return found
