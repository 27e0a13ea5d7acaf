"""Findings of how a session's rows scatter: what runs tell of each other, what stated uncertainties hold.

Of a run that was recorded in another unit the loads are a number times what the other runs tell. To a model
of scatter such a run has a gain of its own: no row is an outlier within it. So one equation is fitted to all
runs together with a factor of each, and a factor is held against the ratios of units. The equation is linear
whatever the session's is: what bends is small beside the ratio of two units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.run_differences import CellGains, cell_gains, copied_runs, odd_run
from toolkit.calibration.fit.run_scatter import FEWEST_DOF
from toolkit.calibration.fit.session_fit import LoadResult, SessionFit, session_statements
from toolkit.calibration.fit.session_rows import are_untold, groups_of
from toolkit.calibration.records.scatter import chi2_limit
from toolkit.calibration.session.read import Session
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.findings import Finding
from toolkit.units import ratio_of_units

_RISK = 0.01
_GROSS = 1e-3  # chance of a chi-square that asks for a look before approval


def run_findings(fit: SessionFit) -> list[Finding]:
    """Return that the rows tell nothing of how runs differ."""
    session = fit.session
    factor, group = groups_of(session.table, session.zero)
    if session_statements(session).between_runs:
        return []
    cure = (
        f"a second {factor} of the same loads would tell, a third and more tell it better; what is known "
        "from elsewhere goes into [between_runs]"
    )
    if are_untold(session.table, session.zero):
        count = len(np.unique(groups_of(session.table, session.zero, every=True)[1]))
        message = (
            f"{session.table.rows} rows in {count} {factor}s: so few rows show no zero and no gain of a "
            f"{factor}, so that nothing tells how {factor}s differ, nor how many there were; all rows count "
            f"as one {factor}, with as large a zero and a gain as their scatter allows. Rows that were read "
            f"without taking the instrument down are of one {factor}: number them alike"
        )
    elif not group.any():
        message = (
            f"one {factor}: how {factor}s differ in zero and gain is unknown, and no uncertainty holds it; "
            f"{cure}"
        )
    elif fit.loads[0].fit.dof < FEWEST_DOF:
        message = (
            f"so few rows that zeros and gains of {factor}s cannot be told from noise, and no uncertainty "
            f"holds them; {cure}"
        )
    else:
        return []
    return [Finding(rule="one-run", where=session.path.name, message=message, level="note")]


def stated_findings(load: LoadResult) -> list[Finding]:
    """Return that the rows scatter by more than the uncertainties that the fit weighs them by."""
    if load.chi2_within is None or load.fit.chi2 is None or load.stated is None:
        return []
    dof, unit = load.fit.dof, load.setting.unit
    limit = chi2_limit(dof)
    if max(load.chi2_within, load.fit.chi2) <= limit:
        return []
    apart = load.of_runs.any()
    beyond = load.chi2_within > limit
    chi2 = load.chi2_within if beyond else load.fit.chi2
    inside = f" within {load.scatter.factor}s" if load.scatter is not None and apart and beyond else ""
    message = (
        f"the rows scatter{inside} {np.sqrt(chi2 / dof):.3g} times as much as their stated uncertainties "
        f"({load.stated:.3g} {unit} rms): chi-square {chi2:.4g} with {dof} degrees of freedom, by chance "
        f"up to {limit:.4g} (95 %)"
    )
    if load.scatter is not None and apart:
        message += (
            f"; between {load.scatter.groups} {load.scatter.factor}s zero {load.scatter.zero:.3g} and gain "
            f"{load.scatter.gain:.3g} {unit} at full scale"
        )
    message += (
        "; the covariance holds what the rows show"
        if beyond
        else "; the uncertainties hold the scatter within a run, and the covariance what runs differ by"
    )
    gross = beyond and load.chi2_within > _gross(dof)
    level: Literal["warning", "note"] = "warning" if gross else "note"
    return [Finding(rule="stated-u", where=load.setting.name, message=message, level=level)]


def _gross(dof: int) -> float:
    from scipy.special import chdtri

    return float(chdtri(dof, _GROSS))


def method_findings(session: Session, load: LoadResult) -> list[Finding]:
    """Return that another method suits the rows better; not where unnumbered runs may make them seem so."""
    spread = load.diagnostics.heteroscedasticity
    if spread is None or spread >= _RISK / len(session.loads) or session.method != "ols":
        return []
    factor, group = groups_of(session.table, session.zero)
    if group.any():
        message = 'the scatter grows or shrinks with the load; consider method = "wls" with u_ columns'
    else:
        message = (
            f"the scatter grows or shrinks with the load, as it does where {factor}s differ in gain, and no "
            f"{factor}s are told apart: number them before another method is considered"
        )
    return [Finding(rule="method", where=load.setting.name, message=message, level="note")]


def difference_findings(fit: SessionFit) -> list[Finding]:
    """Return a run of another instrument, cells whose gains move by themselves, and runs that were copied."""
    session, findings = fit.session, []
    moved: list[tuple[str, CellGains]] = []
    for load in fit.loads:
        name, unit = load.setting.name, load.setting.unit
        odd = odd_run(session, load)
        if odd is None:
            gains = cell_gains(session, load)
            moved += [] if gains is None else [(name, gains)]
            continue
        message = (
            f"{odd.factor} {odd.run:g} lies {odd.off:.3g} {unit} (rms) from the equation of the other "
            f"{odd.factor}s, with a zero and a gain of its own, where these lie {odd.others:.2g} {unit} from "
            "it: "
        )
        message += (
            f"was it read of another instrument, with other cells or another wiring? Without {odd.factor} "
            f"{odd.run:g} the others agree"
            if odd.alone
            else f"the two {odd.factor}s are not of one instrument; a third would tell which is wrong"
        )
        findings.append(Finding(rule="run-apart", where=name, message=message, level="error"))
    if moved:
        _, largest = max(moved, key=lambda pair: pair[1].size)
        factor = groups_of(session.table, session.zero)[0]
        message = (
            f"gains of single cells differ from {factor} to {factor} by {100 * largest.size:.2g} % (F = "
            f"{largest.F:.3g} with {largest.dof[0]} and {largest.dof[1]} degrees of freedom, p = "
            f"{largest.probability:.1g}), beyond the one gain of each load and {factor} that the covariance "
            "holds: coefficients and loads are less certain than stated. Look at the excitation and the "
            "amplifier of each cell"
        )
        where = ", ".join(name for name, _ in moved)
        findings.append(Finding(rule="cell-gains", where=where, message=message))
    copied = copied_runs(session)
    if copied is not None:
        unit = session.table.unit(copied.indication)
        first, second = copied.runs
        message = (
            f"{copied.factor}s {first:g} and {second:g} repeat each other: in {copied.pairs} pairs of rows "
            f"{copied.indication} differs by {copied.apart:.2g} {unit} (standard deviation of a reading, "
            f"zero and gain apart), where {copied.against} scatter by {copied.usual:.2g} {unit}: were both "
            "read? Copies make every uncertainty too small"
        )
        findings.append(Finding(rule="copied-runs", where=session.path.name, message=message))
    return findings


def scatter_findings(load: LoadResult) -> list[Finding]:
    """Return that the rows lie further from their own equation than a check load may lie from it."""
    unit, tolerance = load.setting.unit, load.setting.tolerance
    if load.fit.residual_sd <= tolerance:
        return []
    message = (
        f"the rows lie {load.fit.residual_sd:.4g} {unit} from their own equation (residual standard "
        f"deviation), and a check load may lie {tolerance:.4g} {unit} from it"
    )
    if load.scatter is not None and (load.scatter.zero or load.scatter.gain):
        message += (
            f"; within a {load.scatter.factor} {load.scatter.within:.3g}, between {load.scatter.factor}s "
            f"zero {load.scatter.zero:.3g} and gain {load.scatter.gain:.3g} {unit} at full scale"
        )
    return [Finding(rule="scatter", where=load.setting.name, message=message)]


_APART = 0.05  # runs of one instrument differ by less
_LARGEST_SHARE = 0.1  # of the residuals: a scale that leaves more explains something else
_LEAST_SINGULAR = 0.02  # least singular value of an equation and factors that the runs tell apart


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScale:
    """A run or mounting (``factor``) whose loads are ``ratio`` times what ``most`` of the runs tell.

    ``rows`` from 1. ``units`` says which units have that ratio, such as ``lbf against N``; None where none
    have. ``most`` is False where as many runs say the other thing.
    """

    factor: str
    run: float
    rows: tuple[int, ...]
    ratio: float
    units: str | None
    most: bool


def run_scales(session: Session, load: LoadResult) -> tuple[RunScale, ...]:
    """Return the runs of a load that have another scale than the others."""
    factor, group = groups_of(session.table, session.zero)
    if load.fit.weights is not None or not group.any() or load.fit.residual_sd <= load.setting.tolerance:
        return ()
    reference = session.table.column(load.setting.name)
    linear = [term for term in load.fit.terms if term in (*session.indications, INTERCEPT)]
    design = term_matrix(linear, session.table.columns(session.indications))
    scale = _scales(design, reference, group)
    if scale is None:
        return ()
    agree = (np.abs(scale[:, None] / scale - 1) < _APART).sum(axis=1)
    usual = int(np.argmax(agree))
    ratio = scale / scale[usual]
    if _rms(design, reference / ratio[group]) > _LARGEST_SHARE * _rms(design, reference):
        return ()
    number = session.table.rotation if factor == "mounting" else session.table.run
    names = np.unique(group if number is None else number)
    return tuple(
        RunScale(
            factor=factor,
            run=float(names[at]),
            rows=tuple((np.flatnonzero(group == at) + 1).tolist()),
            ratio=float(ratio[at]),
            units=ratio_of_units(float(ratio[at]), load.setting.unit),
            most=int(agree[at]) < int(agree[usual]),
        )
        for at in np.flatnonzero(np.abs(ratio - 1) >= _APART).tolist()
    )


def _scales(design: Array, load: Array, group: NDArray[np.int64]) -> Array | None:
    """Return each run's factor against the first (runs,): load = scale x design c; None: not told apart."""
    # A run counts by the size of its own indications, which may be those in another unit.
    moved = design[:, np.ptp(design, axis=0) > 0]
    size = np.sqrt(np.bincount(group, weights=np.mean((moved / np.abs(moved).max(axis=0)) ** 2, axis=1)))
    if not size.all():
        return None
    weight = (np.sqrt(np.bincount(group)) / size)[group]
    design, load = design * weight[:, None], load * weight
    factors = -np.where(group[:, None] == np.arange(1, int(group.max()) + 1), load[:, None], 0.0)
    matrix = np.column_stack([design, factors])
    length = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    if not length.all():
        return None
    solution, _, _, singular = np.linalg.lstsq(matrix / length, np.where(group == 0, load, 0.0), rcond=None)
    inverse = (solution / length)[design.shape[1] :]
    if singular[-1] < _LEAST_SINGULAR or not (inverse > 0).all():
        return None
    return np.asarray(np.concatenate([[1.0], 1 / inverse]), dtype=np.float64)


def _rms(design: Array, load: Array) -> float:
    """Return what an equation leaves of loads, by their size."""
    residual = load - design @ np.linalg.lstsq(design, load, rcond=None)[0]
    return float(np.linalg.norm(residual) / np.linalg.norm(load))
