"""Findings of a session: what a person should look at before the candidate is approved.

None of them changes the fit. Recommendations of another model are notes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.adequacy import COLLINEAR_FINDING
from toolkit.calibration.fit.balance_report import balance_findings
from toolkit.calibration.fit.diagnostics import replicate_groups
from toolkit.calibration.fit.levels import lack_of_fit, load_levels
from toolkit.calibration.fit.recommend import NEGLIGIBLE_PERCENT, recommend_drop, recommend_wider
from toolkit.calibration.fit.robust import hidden_outliers, robust_weights
from toolkit.calibration.fit.session_fit import session_statements, within_runs
from toolkit.calibration.fit.session_rows import groups_of
from toolkit.calibration.session.known_errors import undeclared_standard
from toolkit.calibration.session.settings import DEFAULT_TOLERANCE
from toolkit.findings import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.readings import SessionReadings, ShuntCheck
    from toolkit.calibration.fit.session_fit import LoadResult, SessionFit
    from toolkit.calibration.session.read import Session
    from toolkit.calibration.session.table import Table

FEW_POINTS = 30
REPEATED = 0.1
COARSE_REFERENCE = 0.05
MOST_NAMED = 10
_RISK = 0.01


def session_findings(fit: SessionFit) -> tuple[Finding, ...]:
    """Return the findings of a session's data and fit."""
    session = fit.session
    found = [*_data_findings(session), *_model_findings(fit), *balance_findings(fit)]
    if fit.condition_number > COLLINEAR_FINDING:
        message = (
            f"condition number {fit.condition_number:.3g} of the indications, over {COLLINEAR_FINDING:g}"
        )
        found.append(Finding(rule="collinear", where=session.path.name, message=message))
    for load in fit.loads:
        found += _load_findings(session, load)
    found += _robust_findings(fit)
    return tuple(found)


def _repeated(rows: NDArray[np.float64], where: str) -> list[Finding]:
    """Return which rows repeat another one: a finding where they are many, else a note."""
    groups = replicate_groups(rows)
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[inverse] != np.arange(len(rows)))
    if not again.size:
        return []
    pairs = [f"{at + 1} = {first[inverse[at]] + 1}" for at in again[:MOST_NAMED].tolist()]
    more = f" and {again.size - MOST_NAMED} more" if again.size > MOST_NAMED else ""
    share = again.size / len(rows)
    message = (
        f"{again.size} of {len(rows)} rows ({100 * share:.2g} %) repeat another row, indications and loads "
        f"alike: rows {', '.join(pairs)}{more}"
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
            told = f"{name} = {values[at]:.6g} {text} (fitted: {low:.6g} to {high:.6g})"
            outside.setdefault(at, []).append(told)
    return [
        Finding(
            rule="check-beyond-range",
            where=f"check row {at + 1}",
            message=f"{', '.join(told)}: a check load there verifies an extrapolation, which neither the fit "
            "nor its uncertainty covers",
            level="note",  # as where there are no check loads: the range that was fitted stands
        )
        for at, told in sorted(outside.items())
    ]


def _data_findings(session: Session) -> list[Finding]:
    found: list[Finding] = []
    table, where = session.table, session.path.name
    if table.rows < FEW_POINTS:
        message = f"{table.rows} points; ASTM E74 asks for at least {FEW_POINTS}"
        found.append(Finding(rule="few-points", where=where, message=message))
    names = [*session.indications, *(load.name for load in session.loads)]
    rows = table.matrix(names)
    found += _repeated(rows, where)
    factor, group = groups_of(table)
    if session.method == "ols" and not group.any() and not session_statements(session).between_runs:
        message = (
            f"one {factor}: how {factor}s differ in zero and gain is unknown, and no uncertainty holds it; "
            f"a second {factor} of the same loads would tell, a third and more tell it better; what is known "
            "from elsewhere goes into [between_runs]"
        )
        found.append(Finding(rule="one-run", where=where, message=message, level="note"))
    if session.check is None:
        message = "no check loads: no term can be verified on approval"
        found.append(Finding(rule="no-check", where=where, message=message, level="note"))
    else:
        check = session.check.matrix(names)
        found += [*_repeated(check, f"{where}, check loads"), *_beyond(session, session.check)]
        # Most rows of a long session share no first value with a check load.
        fitted = {tuple(row) for row in rows[np.isin(rows[:, 0], check[:, 0])].tolist()}
        for number, row in enumerate(check.tolist(), start=1):
            if tuple(row) in fitted:
                message = "a check load equals a row of the fit: it checks nothing"
                found.append(Finding(rule="check-not-apart", where=f"check row {number}", message=message))
    if session.reference_due is not None and session.reference_due < session.date:
        message = f"the reference standard was due on {session.reference_due.isoformat()}"
        found.append(Finding(rule="reference-due", where=where, message=message))
    stated = session_statements(session).reference
    for load in session.loads:
        largest = float(np.abs(table.column(load.name)).max())
        if (u := stated.u(load.name)) is not None and u > COARSE_REFERENCE * largest:
            message = (
                f"the reference's standard uncertainty is {100 * u / largest:.3g} % of the largest load: "
                "with such a standard nothing is calibrated; is its unit right?"
            )
            found.append(Finding(rule="coarse-reference", where=load.name, message=message))
    if session.method == "gls":
        name = undeclared_standard(session_statements(session).reference, table)
        if name is not None:
            message = (
                f"shared_group {name!r} is no column of the data: taken as the name of one standard behind "
                "every row; say so by [reference] standard, or name a column"
            )
            found.append(Finding(rule="shared-group", where=where, message=message, level="note"))
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
    if spread is not None and spread < _RISK / len(session.loads) and session.method == "ols":
        message = 'the scatter grows or shrinks with the load; consider method = "wls" with u_ columns'
        found.append(Finding(rule="method", where=name, message=message, level="note"))
    return found


def _model_findings(fit: SessionFit) -> list[Finding]:
    """Recommend other terms, each with the lines to write; the fit stays as the session names it."""
    session = fit.session
    if session.method not in ("ols", "wls"):
        return []
    found: list[Finding] = []
    wider = recommend_wider(fit)
    if wider is not None:
        message = (
            f"{wider.name} fits better than chance: F = {wider.F:.3g}, p = {wider.probability:.1g}, residual "
            f"sd {wider.before_percent_fs:.3g} -> {wider.after_percent_fs:.3g} % of full scale; "
            f"to use it write in SESSION.toml: {_inline(wider.lines)}"
        )
        where = ", ".join(wider.loads)
        found.append(Finding(rule="model", where=where, message=message, level="note"))
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
        found.append(Finding(rule="terms", where=session.path.name, message=message, level="note"))
    if wider is None:
        found += _misfits(fit)
    return found


def _misfits(fit: SessionFit) -> list[Finding]:
    table = fit.session.table
    level = load_levels(table.matrix([load.name for load in fit.session.loads]))
    found = []
    for load in fit.loads:
        lack = lack_of_fit(load.fit, level)
        # Scatter that is rounding has no pure error to judge by.
        if lack is None or load.fit.residual_sd <= 1e-9 * load.setting.tolerance:
            continue
        if lack.probability < _RISK / len(fit.loads):
            message = (
                f"levels differ by more than their own scatter (F = {lack.F:.3g} with {lack.lack_dof} and "
                f"{lack.pure_dof} degrees of freedom, p = {lack.probability:.1g}), and no model that a "
                "session can name fits better: look at the residuals against the load and against the order"
            )
            found.append(Finding(rule="lack-of-fit", where=load.setting.name, message=message, level="note"))
    return found


def _robust_findings(fit: SessionFit) -> list[Finding]:
    """Point at rows that hide each other; those already named as outliers are not named twice."""
    columns = fit.session.table.columns(fit.session.indications)
    found = []
    for one in fit.loads:
        load = fit.session.table.column(one.setting.name) - one.of_runs
        within = within_runs(one.fit, one.of_runs)
        weights = robust_weights(within, columns=columns, load=load)
        hidden = hidden_outliers(within, weights, columns=columns)
        rows = [row for row in hidden if row not in one.diagnostics.outliers]
        if rows:
            message = (
                f"row{'s' if len(rows) > 1 else ''} {_some(rows)}: almost no weight in a robust fit "
                "(Huber, then Tukey's biweight); rows that are wrong together hide from the ordinary "
                "residuals. The fit is unchanged: look at these loadings"
            )
            found.append(Finding(rule="robust", where=one.setting.name, message=message, level="note"))
    return found


def _some(rows: list[int], most: int = 20) -> str:
    text = ", ".join(str(row) for row in rows[:most])
    return text if len(rows) <= most else f"{text} and {len(rows) - most} more"


def _inline(lines: str) -> str:
    return "; ".join(lines.split("\n"))


# Findings of a session's readings: what a person should look at before the candidate is approved.


LARGEST_RATIO_MV_V = 10.0  # metal foil bridges give 1 to 4 mV/V at capacity
TEMPERATURE_C = (18.0, 28.0)  # ISO 376


def readings_findings(found: SessionReadings, where: str) -> tuple[Finding, ...]:
    """Return the findings of a session's readings; ``where`` names the session."""
    made = [
        Finding(
            rule="bridge-range",
            where=name,
            message=f"a bridge output of {ratio:.4g} mV/V, over {LARGEST_RATIO_MV_V:g}: is its unit, "
            "excitation or scale right?",
        )
        for name, ratio in found.largest_ratio
        if ratio > LARGEST_RATIO_MV_V
    ]
    made += [
        Finding(
            rule="zero-drift",
            where=zero.load,
            message=f"the zeros of {', '.join(zero.cells)} moved by {zero.drift:+.4g} {zero.unit} "
            f"({zero.percent_fs:+.3g} % of full scale), tolerance {zero.tolerance:.4g} {zero.unit}",
        )
        for zero in found.zero_loads
        if abs(zero.drift) > zero.tolerance
    ]
    made += [finding for shunt in found.shunts if (finding := _shunt(shunt)) is not None]
    made += [
        Finding(
            rule="creep",
            where=f"creep at {load}",
            message="two readings of one indication, or of the load, are needed: nothing was evaluated",
            level="note",
        )
        for load in found.creep_left_out
    ]
    made += [
        Finding(
            rule="scale-unit",
            where=name,
            message='a scale without a unit is not applied: write scale = { value, unit = "mV/V" }',
            level="note",
        )
        for name in found.unscaled
    ]
    low, high = TEMPERATURE_C
    if found.temperature_C is not None and not low <= found.temperature_C <= high:
        message = f"{found.temperature_C:.4g} degC; ISO 376 asks for {low:g} to {high:g} degC"
        made.append(Finding(rule="temperature", where=where, message=message, level="note"))
    return tuple(made)


def _shunt(one: ShuntCheck) -> Finding | None:
    where = f"{one.name}, {one.source}"
    if one.difference_percent is None or one.expected is None:
        message = f"a shunt step of {one.measured:.6g} {one.unit} without an expected one in that unit"
        return Finding(rule="shunt", where=where, message=message, level="note")
    if one.within:
        return None
    zero = "" if one.zero is not None or one.source == "shunt_measured" else ", no zero reading before it"
    message = (
        f"the shunt gives {one.measured:.6g} {one.unit} for {one.expected:.6g}: "
        f"{one.difference_percent:+.3g} %, tolerance {one.tolerance_percent:g} %{zero}"
    )
    return Finding(rule="shunt", where=where, message=message)
