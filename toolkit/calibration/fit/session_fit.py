"""A session's fit: every load's equation with its diagnostics, as one result."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.adequacy import Adequacy, check_adequate
from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.fit.diagnostics import Diagnostics, diagnose, replicate_groups
from toolkit.calibration.fit.odr import fit_odr
from toolkit.calibration.fit.printed_digits import rounding_alone
from toolkit.calibration.fit.regression import (
    Factor,
    TermFit,
    covariance_of,
    fit_loads,
    fit_terms,
    raw_coefficients,
)
from toolkit.calibration.fit.rounding import Rounding, with_steps
from toolkit.calibration.fit.row_noise import RowNoise, noise_of, shown_rows, weighed_rows
from toolkit.calibration.fit.session_rows import groups_of
from toolkit.calibration.fit.session_scatter import FittedRows, scatter_as_shown, scatter_of_rows
from toolkit.calibration.records.record import ROUNDING
from toolkit.calibration.records.scatter import RunScatter
from toolkit.calibration.session.known_errors import KnownErrors, known_errors, row_uncertainty
from toolkit.calibration.session.read import LoadSetting, Session
from toolkit.calibration.session.settings import wrong
from toolkit.calibration.session.statements import Statements, parse_statements
from toolkit.calibration.terms import term_matrix

# Generalised least squares: reference loads that share errors, with a known covariance.


def fit_gls(
    *, terms: Sequence[str], columns: Mapping[str, Array], load: Array, errors: KnownErrors
) -> TermFit:
    """Fit load = sum of c_i term_i where rows of one group share an error.

    ``weights`` of the result is the diagonal of V^-1. ``scaled`` is V^-1 r over its root and ``leverage`` 1
    minus the share that P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1 has of that diagonal, so that a row's
    deletion residual is scaled / sqrt(weights) / (1 - leverage), as for independent rows.

    Raises
    ------
    ValueError
        no uncertainty of single rows is stated, and the residuals tell none
    """
    ordinary = fit_terms(terms=terms, columns=columns, load=load)
    largest = float(np.abs(load).max())
    u = errors.u
    if u is None:
        if ordinary.residual_sd <= 1e-12 * largest:
            raise ValueError("the residuals do not give the uncertainty of single rows")
        u = np.full(len(load), ordinary.residual_sd)
    v = np.full(len(load), errors.u_shared)
    if errors.proportional:
        v *= (load - ordinary.residuals) / largest
    a, group = v / u, errors.group
    total = np.bincount(group, weights=a * a)[group]
    basis = build_basis(terms, columns)
    # The limit of the factor for a'a -> 0 is 1/2; written so that nothing cancels.
    root = np.sqrt(1 + total)
    shrink = 1 / (root * (1 + root))

    def shared(x: Array, by: Array) -> Array:
        # (I - by a a') x within each group
        return np.asarray(x - by * a * np.bincount(group, weights=a * x)[group], dtype=np.float64)

    design = np.column_stack([shared(column / u, shrink) for column in basis.design.T])
    factor = Factor.of(np.asfortranarray(design), None)
    (solution,), (white,) = factor.solve(shared(load / u, shrink)[None, :])
    residuals = np.asarray(load - solution.dot(basis.design.T.astype(np.longdouble)), dtype=np.float64)
    diagonal = (1 - a * a / (1 + total)) / u**2
    pull = shared(residuals / u, 1 / (1 + total)) / u
    rows = np.column_stack([shared(column / u, 1 / (1 + total)) / u for column in basis.design.T])
    dof = len(load) - len(terms)
    return TermFit(
        terms=tuple(terms),
        coefficients=raw_coefficients(basis, solution),
        covariance=covariance_of(basis, factor.inverse),
        residual_sd=float(np.sqrt(residuals @ residuals / dof)),
        dof=dof,
        residuals=residuals,
        leverage=np.einsum("ij,jk,ik->i", rows, factor.inverse, rows) / diagonal,
        weights=diagonal,
        scaled=pull / np.sqrt(diagonal),
        chi2=float(white @ white),
    )


LLF_FACTOR = 2.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadResult:
    """One load. ``fit.covariance`` is that of `records.scatter` where the session's runs tell ``scatter``.

    ``rounding`` names the model by which it holds the stated resolution, None where none is stated.

    ``of_runs`` (rows,) is what of the residuals the runs' zeros and gains make; rows are judged without it.
    ``exact``: the rows lie on the equation as far as their printed digits tell, so that nothing scatters.

    ``stated`` is the root mean square of the rows' stated uncertainties by which the fit weighs, in the
    load's unit; ``chi2_within`` the weighted sum of squares that is not ``of_runs``. None: none is stated.

    ``llf`` and ``check_residuals`` (fitted - reference, check rows,) in the load's unit.

    ``check_max_percent_fs`` is None where the session has no check loads.
    """

    setting: LoadSetting
    fit: TermFit
    scatter: RunScatter | None
    rounding: str | None
    of_runs: Array
    exact: bool
    chi2_within: float | None
    stated: float | None
    diagnostics: Diagnostics
    llf: float
    check_residuals: Array | None
    check_max_percent_fs: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionFit:
    """All loads of a session; ``vif`` one value an indication."""

    session: Session
    loads: tuple[LoadResult, ...]
    adequacy: Adequacy


def fit_session(session: Session) -> SessionFit:
    """Fit every load of a session.

    Raises
    ------
    SessionError
        the data cannot determine the coefficients (see `adequacy`)
    """
    adequacy = check_adequate(session)
    table = session.table
    columns = table.columns(session.indications)
    cells = table.matrix(session.indications)
    groups = replicate_groups(cells)
    fits = _solved(session, columns)
    session = with_steps(session, fits)
    return SessionFit(
        session=session,
        loads=tuple(
            _result(session, setting, fit, cells, groups)
            for setting, fit in zip(session.loads, fits, strict=True)
        ),
        adequacy=adequacy,
    )


def residual_correlation(fit: SessionFit) -> Array:
    """Return the correlation of the loads' residuals (loads, loads): one cell's noise feeds all of them.

    Loads without scatter, or one load alone, have none: the identity.
    """
    residuals = np.array([load.fit.residuals for load in fit.loads])
    products = np.einsum("ij,kj->ik", residuals, residuals)
    length = np.sqrt(np.diag(products))
    safe = np.where(length > 0, length, 1.0)
    correlation: Array = products / np.outer(safe, safe)
    np.fill_diagonal(correlation, 1.0)
    return correlation


def _solved(session: Session, columns: dict[str, Array]) -> tuple[TermFit, ...]:
    loads = [session.table.column(setting.name) for setting in session.loads]
    if session.method == "ols":
        return fit_loads(terms=session.terms, columns=columns, loads=loads)
    fits = []
    for setting, load in zip(session.loads, loads, strict=True):
        if session.method == "wls":
            u = load_uncertainty(session, setting)
            fits.append(fit_terms(terms=session.terms, columns=columns, load=load, u=u))
            continue
        errors = load_errors(session, setting)
        try:
            if session.method == "gls":
                fits.append(fit_gls(terms=session.terms, columns=columns, load=load, errors=errors))
            else:
                u = np.ones(len(load)) if errors.u is None else errors.u
                fits.append(
                    fit_odr(terms=session.terms, columns=columns, load=load, u=u, u_cells=errors.u_cells)
                )
        except ValueError as error:
            expected = f"uncertainties that determine the fit, such as a column u_{setting.name}"
            raise wrong(session.path, f"method {session.method}, {setting.name}", error, expected) from error
    return tuple(fits)


def _result(
    session: Session, setting: LoadSetting, fit: TermFit, cells: Array, groups: NDArray[np.intp]
) -> LoadResult:
    table = session.table
    load = table.column(setting.name)
    design = term_matrix(session.terms, table.columns(session.indications))
    noise = noise_of(
        session.method, session_statements(session), table, setting.name, terms=fit.terms,
        coefficients=fit.coefficients, indications=session.indications, where=session.path,
    )  # fmt: skip
    exact = rounding_alone(fit, table.columns(session.indications), load, setting.tolerance)
    fitted_rows = FittedRows(
        design=design, load=load, table=table, zero=session.zero, noise=noise, residuals=fit.residuals,
        residual_sd=fit.residual_sd, dof=fit.dof,
        between=session_statements(session).between(setting.name),
    )  # fmt: skip
    scatter = scatter_of_rows(fitted_rows)
    rounding = Rounding.of(
        session_statements(session), table.columns(session.indications), terms=fit.terms,
        coefficients=fit.coefficients,
    )  # fmt: skip
    rows = weighed_rows(design, load, groups_of(table, session.zero)[1], noise, rounding=rounding)
    of_runs = np.zeros_like(load) if scatter is None else rows.of_runs(scatter, fit.residuals)
    if noise is None and not exact:
        # By the residuals as a record's refit has them, from the coefficients alone.
        residuals = load - design @ np.asarray(fit.coefficients)
        unlike, profile = shown_rows(rows, design, table.columns(session.indications), residuals - of_runs)
        shown = None if profile is None else scatter_as_shown(scatter, fitted_rows)
        if shown is not None:
            scatter, rows = shown, unlike
    alone = fit.covariance if rows.rounded is None else fit.covariance + rows.rounded
    fit = dataclasses.replace(fit, covariance=alone if scatter is None else rows.covariance(scatter))
    check_residuals, percent = None, None
    if session.check is not None:
        check = session.check
        fitted = term_matrix(session.terms, check.columns(session.indications)) @ np.asarray(fit.coefficients)
        check_residuals = fitted - check.column(setting.name)
        percent = 100 * float(np.abs(check_residuals).max()) / float(np.abs(load).max())
    return LoadResult(
        setting=setting,
        fit=fit,
        scatter=scatter,
        rounding=None if rounding is None else ROUNDING,
        of_runs=of_runs,
        exact=exact,
        chi2_within=None if noise is None or not noise.stated else noise.chi2(fit.residuals - of_runs),
        stated=None if noise is None or not noise.stated else noise.size,
        diagnostics=_diagnosed(
            fit,
            of_runs,
            noise,
            cells=cells,
            load=load,
            up=table.up,
            groups=groups,
            exact=exact,
            loads=len(session.loads),
        ),
        llf=max(LLF_FACTOR * fit.residual_sd, _resolution(session, fit)),
        check_residuals=check_residuals,
        check_max_percent_fs=percent,
    )


def within_runs(fit: TermFit, of_runs: Array, noise: RowNoise | None) -> TermFit:
    """Return a fit with the residuals that it has within its runs."""
    if not of_runs.any():
        return fit
    residuals = fit.residuals - of_runs
    sd = float(np.sqrt(np.sum(residuals**2) / fit.dof))
    return dataclasses.replace(
        fit,
        residuals=residuals,
        scaled=residuals if noise is None else noise.scaled(residuals),
        residual_sd=sd,
        chi2=None if noise is None else noise.chi2(residuals),
    )


def _diagnosed(
    fit: TermFit,
    of_runs: Array,
    noise: RowNoise | None,
    *,
    cells: Array,
    load: Array,
    up: NDArray[np.bool_] | None,
    groups: NDArray[np.intp],
    exact: bool,
    loads: int,
) -> Diagnostics:
    judged = partial(diagnose, cells=cells, load=load, up=up, replicates=groups, loads=loads)
    diagnostics = judged(fit)
    if exact:
        return dataclasses.replace(diagnostics, outliers=(), lack_of_fit=None, heteroscedasticity=None)
    if not of_runs.any():
        return diagnostics
    within = judged(within_runs(fit, of_runs, noise))
    return dataclasses.replace(
        diagnostics,
        apart=within.external,
        outliers=within.outliers,
        heteroscedasticity=within.heteroscedasticity,
    )


def load_uncertainty(session: Session, setting: LoadSetting) -> Array | None:
    """Return the standard uncertainties that weigh the rows, in the load's unit; None for plain OLS."""
    return row_uncertainty(session.table, setting.name) if session.method == "wls" else None


def load_errors(session: Session, setting: LoadSetting) -> KnownErrors:
    """Return what the session states about the errors of one load, for gls and odr."""
    stated = session_statements(session)
    return known_errors(session.method, stated, session.table, setting.name, session.path)


def session_statements(session: Session) -> Statements:
    """Return what a session states beside its data, typed."""
    return parse_statements(
        session.settings,
        indications={cell.name: cell.unit for cell in session.cells},
        loads={load.name: load.unit for load in session.loads},
        largest={load.name: float(abs(session.table.column(load.name)).max()) for load in session.loads},
        date=session.date,
        where=session.path,
        columns={cell.name: cell.column_unit or cell.unit for cell in session.cells},
        steps={cell.name: cell.step for cell in session.cells if cell.step is not None},
    )


def _resolution(session: Session, fit: TermFit) -> float:
    """Return the load that one step of the coarsest cell is worth; 0 where none is known."""
    coefficients = dict(zip(fit.terms, fit.coefficients, strict=True))
    return max(
        (
            abs(coefficients.get(cell.name, 0.0)) * step
            for cell in session.cells
            if (step := cell.resolution or cell.step)
        ),
        default=0.0,
    )
