"""A session's fit: every load's equation with its diagnostics, as one result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.adequacy import check_adequate, condition_number, terms_condition_number
from toolkit.calibration.fit.diagnostics import Diagnostics, diagnose, variance_inflation
from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.calibration.terms import term_matrix
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.read import LoadSetting, Session

LLF_FACTOR = 2.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadResult:
    """One load. ``llf`` and ``check_residuals`` (fitted - reference, check rows,) in the load's unit.

    ``check_max_percent_fs`` is None where the session has no check loads.
    """

    setting: LoadSetting
    fit: TermFit
    diagnostics: Diagnostics
    llf: float
    check_residuals: NDArray[np.float64] | None
    check_max_percent_fs: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SessionFit:
    """All loads of a session; ``vif`` one value an indication."""

    session: Session
    loads: tuple[LoadResult, ...]
    condition_number: float
    condition_number_terms: float
    vif: tuple[float, ...]


def fit_session(session: Session) -> SessionFit:
    """Fit every load of a session.

    Raises
    ------
    SessionError
        the data cannot determine the coefficients (see `adequacy`)
    """
    check_adequate(session)
    table = session.table
    columns = table.columns(session.indications)
    cells = table.matrix(session.indications)
    terms = term_matrix(session.terms, columns)
    return SessionFit(
        session=session,
        loads=tuple(_fit_load(session, setting, cells, columns) for setting in session.loads),
        condition_number=condition_number(cells),
        condition_number_terms=terms_condition_number(terms),
        vif=variance_inflation(cells),
    )


def _fit_load(
    session: Session,
    setting: LoadSetting,
    cells: NDArray[np.float64],
    columns: dict[str, NDArray[np.float64]],
) -> LoadResult:
    table = session.table
    load = table.column(setting.name)
    fit = fit_terms(terms=session.terms, columns=columns, load=load, u=load_uncertainty(session, setting))
    residuals, percent = None, None
    if session.check is not None:
        check = session.check
        fitted = term_matrix(session.terms, check.columns(session.indications)) @ np.asarray(fit.coefficients)
        residuals = fitted - check.column(setting.name)
        percent = 100 * float(np.abs(residuals).max()) / float(np.abs(load).max())
    return LoadResult(
        setting=setting,
        fit=fit,
        diagnostics=diagnose(fit, cells=cells, load=load, direction=table.direction),
        llf=max(LLF_FACTOR * fit.residual_sd, _resolution(session, fit)),
        check_residuals=residuals,
        check_max_percent_fs=percent,
    )


def load_uncertainty(session: Session, setting: LoadSetting) -> NDArray[np.float64] | None:
    """Return the standard uncertainties that weigh the rows, in the load's unit; None for plain OLS."""
    if session.method != "wls":
        return None
    name = f"u_{setting.name}"
    factor = unit(session.table.unit(name)).factor / unit(setting.unit).factor
    return session.table.column(name) * factor


def _resolution(session: Session, fit: TermFit) -> float:
    """Return the load that one digit of the coarsest stated cell is worth; 0 where none is stated."""
    named = dict(zip(fit.terms, fit.coefficients, strict=True))
    return max(
        (abs(named.get(cell.name, 0.0)) * cell.resolution for cell in session.cells if cell.resolution),
        default=0.0,
    )
