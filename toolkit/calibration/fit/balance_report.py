"""A session's balance form beside its direct form: loads by iteration, tares, and what each leaves over.

The record holds the direct form (load = sum of c_i term_i(indications)); the balance form is told for
comparison, and changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.balance import (
    BalanceForm,
    Tares,
    estimate_tares,
    fit_balance,
    loads_by_iteration,
    loads_by_newton,
)
from toolkit.errors import SessionError
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.fit.session_fit import SessionFit


@dataclass(frozen=True, slots=True, kw_only=True)
class BalanceLoad:
    """One load, in % of full scale: standard deviation and largest residual of either form, and of the
    check loads (None where there are none).
    """

    load: str
    unit: str
    direct_sd_percent_fs: float
    direct_max_percent_fs: float
    iterated_sd_percent_fs: float
    iterated_max_percent_fs: float
    check_direct_percent_fs: float | None
    check_iterated_percent_fs: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BalanceReport:
    """The balance form of a session. ``tares`` is None where the file has no runs to tell apart.

    ``steps`` of the load iteration, ``newton_steps`` of Newton's; ``newton_difference`` is the largest
    difference of their loads as a part of full scale (0 within the tolerance where responses and loads are
    as many).
    """

    form: BalanceForm
    tares: Tares | None
    loads: tuple[BalanceLoad, ...]
    steps: int
    newton_steps: int
    newton_difference: float


def report_balance(fit: SessionFit) -> BalanceReport:
    """Return the balance form of a session that names the model ``balance``.

    Raises
    ------
    SessionError
        ``balance``: the loads do not determine the form; ``not-converged``
    """
    session, table = fit.session, fit.session.table
    names = [load.name for load in session.loads]
    loads, responses = table.columns(names), table.columns(session.indications)
    applied, measured = table.matrix(names), table.matrix(session.indications)
    tares = None
    if table.run is not None and len(np.unique(table.run)) > 1:
        tares = estimate_tares(loads=loads, responses=responses, run=table.run)
        applied = applied + tares.values[np.searchsorted(tares.runs, table.run)]
        form = tares.form
    else:
        form = fit_balance(loads=loads, responses=responses)
    solved = loads_by_iteration(form, measured)
    newton = loads_by_newton(form, measured)
    full = np.abs(table.matrix(names)).max(axis=0)
    residual = 100 * (applied - solved.loads) / full
    check = _check(fit, form, full)
    rows = []
    for j, load in enumerate(fit.loads):
        direct = 100 * load.fit.residuals / full[j]
        rows.append(
            BalanceLoad(
                load=load.setting.name,
                unit=load.setting.unit,
                direct_sd_percent_fs=100 * load.fit.residual_sd / float(full[j]),
                direct_max_percent_fs=float(np.abs(direct).max()),
                iterated_sd_percent_fs=float(np.sqrt(residual[:, j] @ residual[:, j] / form.fits[0].dof)),
                iterated_max_percent_fs=float(np.abs(residual[:, j]).max()),
                check_direct_percent_fs=load.check_max_percent_fs,
                check_iterated_percent_fs=None if check is None else float(check[j]),
            )
        )
    return BalanceReport(
        form=form,
        tares=tares,
        loads=tuple(rows),
        steps=solved.steps,
        newton_steps=newton.steps,
        newton_difference=float((np.abs(newton.loads - solved.loads) / form.full_scale).max()),
    )


def balance_findings(fit: SessionFit) -> list[Finding]:
    """Return notes on the balance form: tares over the check loads' tolerance, or why there is no form."""
    if fit.session.model != "balance":
        return []
    try:
        report = report_balance(fit)
    except SessionError as error:
        message = f"no balance form beside the direct one: {error.what}; got {error.got}"
        return [Finding(rule="balance", where=fit.session.path.name, message=message, level="note")]
    if report.tares is None:
        return []
    findings = []
    for number, values in zip(report.tares.runs, report.tares.values, strict=True):
        for load, value in zip(fit.loads, values.tolist(), strict=True):
            if abs(value) > load.setting.tolerance:
                message = (
                    f"run {number} carries {value:+.4g} {load.setting.unit} more than the runs' mean, "
                    f"tolerance {load.setting.tolerance:.4g} {load.setting.unit}: weigh the fixtures, and "
                    "add them to the reference loads"
                )
                findings.append(Finding(rule="tare", where=load.setting.name, message=message, level="note"))
    return findings


def _check(fit: SessionFit, form: BalanceForm, full: Array) -> Array | None:
    check = fit.session.check
    if check is None:
        return None
    solved = loads_by_iteration(form, check.matrix(fit.session.indications))
    reference = check.matrix([load.name for load in fit.session.loads])
    off: Array = 100 * np.abs(solved.loads - reference).max(axis=0) / full
    return off
