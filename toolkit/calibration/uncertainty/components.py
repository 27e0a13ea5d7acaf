"""The components of a budget, one function each; equations as in JCGM 100 and ISO 376:2011 annex C."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.records.scatter import UNTOLD
from toolkit.calibration.session.known_errors import row_uncertainty
from toolkit.calibration.session.statements import Statements
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import term_matrix
from toolkit.calibration.uncertainty.common_errors import (
    creep,
    indication_errors,
    left_at_zero,
    sensitivities,
    zero_drift,
)
from toolkit.calibration.uncertainty.model import Component, Distribution, Evaluation, Temperature
from toolkit.calibration.uncertainty.scatter import Scatter, scatter_of

ROOT3 = math.sqrt(3.0)
_READING = np.array([1.0, 0.0, 0.0, 0.0])


def components_of(
    record: CalibrationRecord,
    statements: Statements,
    loads: Table,
    check: Table | None,
    load: LoadFit,
    *,
    value: float,
    point: Array,
    temperature: Temperature | None,
    scatter: Scatter | None = None,
) -> tuple[tuple[Component, ...], float]:
    """Return every component at a point (indications,), whose load is ``value`` [the load's unit].

    ``scatter`` of the session's rows is the same at every point; None: it is taken here.

    With them the degrees of freedom of those that the session's rows give together: u^2 of their sum is
    linear in the variances within and between runs, and Satterthwaite's formula holds for it as a whole.
    """
    scatter = scatter or scatter_of(record, loads, load)
    slope = sensitivities(record, load, point.tolist())
    share = abs(value) / load.largest
    curve = _curve(record, load, scatter, point)
    new = _new_run(scatter, share)
    reading = float(scatter.reading(dict(zip(record.indications, point[:, None], strict=True)))[0])
    total = (0.0 if _from_stated(load, curve) else curve.variance) + scatter.runs.within**2 * reading
    total += new.variance if _estimated(scatter) else 0.0
    dof = scatter.dof(curve.gradient + reading * _READING + new.gradient, total)
    return (
        _reference(statements, load, value, loads),
        _fit(record, load, point, curve),
        _repeatability(scatter, reading),
        _reproducibility(scatter, new),
        _interpolation(record, scatter, check, load),
        _reversibility(scatter),
        _resolution(record, statements, slope),
        _cells(record, statements, slope),
        _zero(record, load, slope),
        _creep(record, load, value),
        _temperature(statements, temperature, slope, point, value),
    ), dof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Variance:
    """A variance [unit of the load, squared] and its gradient (4,) by the scatter's components."""

    variance: float
    gradient: Array
    dof: float


def _curve(record: CalibrationRecord, load: LoadFit, s: Scatter, point: Array) -> _Variance:
    """Return the variance of the curve at a point, J C J^T (JCGM 100 eq. 13, H.3.4)."""
    J = term_matrix(load.terms, dict(zip(record.indications, point[:, None], strict=True)))[0]
    stored = max(float(J @ np.asarray(load.covariance) @ J), 0.0)
    if load.scatter is None and s.runs.groups < 2 and load.method != "ols":
        return _Variance(variance=stored, gradient=np.zeros(4), dof=math.inf)
    if load.scatter is None and s.runs.groups < 2:
        # Of what is rounded away nothing is estimated.
        rounded = 0.0 if s.rows.rounded is None else float(J @ s.rows.rounded @ J)
        share = max(stored - rounded, 0.0) / (load.residual_sd or 1.0) ** 2
        dof = math.inf if load.dof is None else float(load.dof)
        return _Variance(variance=stored, gradient=np.array([share, 0.0, 0.0, 0.0]), dof=dof)
    variance, gradient = s.rows.variance(s.runs, J)
    return _Variance(variance=variance, gradient=gradient, dof=s.dof(gradient, variance))


def _estimated(s: Scatter) -> bool:
    """Tell whether zeros and gains of runs are of the rows, and not stated."""
    return s.runs.groups > 1 or s.runs.model == UNTOLD


def _from_stated(load: LoadFit, curve: _Variance) -> bool:
    """Tell whether the covariance follows from stated uncertainties alone: no scatter is above them."""
    return load.method != "ols" and math.isinf(curve.dof)


def _new_run(s: Scatter, share: float) -> _Variance:
    """Return the variance of another run's zero and gain at a share of the largest load."""
    gradient = np.array([0.0, 1.0, share**2, 0.0])
    variance = float(gradient[:3] @ s.runs.variances)
    return _Variance(variance=variance, gradient=gradient, dof=s.dof(gradient, variance) if variance else 1.0)


def _reference(statements: Statements, load: LoadFit, value: float, loads: Table) -> Component:
    """Return what the standard is uncertain by at a load: an amount at every load alike, or a share."""
    stated = statements.reference.of(load.load)
    if stated is None and load.reference_u is not None:
        text = f"u_{load.load} of the rows around the load, at most {load.reference_u:.4g} {load.unit}"
        u = _of_rows_around(loads, load, value)
        return _part("reference", text, "B", "normal", u, math.inf, "session")
    if stated is None:
        return _absent("reference", "no uncertainty of the reference standard is stated", "session")
    if load.method == "gls" and statements.reference.shared_group is not None:
        text = "held by the fit's covariance: its rows share the reference's error (gls)"
        return _part("reference", text, "B", "normal", 0.0, math.inf, "session")
    if stated.relative is None:
        size = f"{stated.U:.4g} {load.unit} at every load"
    else:
        size = f"{100 * stated.relative:.4g} % of the load"
    text = f"certificate: U = {size}, with k = {stated.k:g}"
    digital = statements.reference.digital
    if digital is not None and (place := digital.place(load.load)) is not None:
        text += f"; {digital.file} (sha256 {digital.sha256[:12]}) {place}"
    u = float(stated.u_at(np.asarray(value, dtype=np.float64)))
    return _part("reference", text, "B", "normal", u, math.inf, "session")


def _of_rows_around(loads: Table, load: LoadFit, value: float) -> float:
    """Return the standard uncertainty that rows state around a load: between levels in proportion."""
    u = row_uncertainty(loads, load.load)
    if u is None:
        return load.reference_u or 0.0
    level, place = np.unique(np.abs(loads.column(load.load)), return_inverse=True)
    largest = np.zeros(len(level))
    np.maximum.at(largest, place.ravel(), u)
    return float(np.interp(abs(value), level, largest))


def _fit(record: CalibrationRecord, load: LoadFit, point: Array, curve: _Variance) -> Component:
    from_stated = _from_stated(load, curve)
    text = f"J V J^T of the {len(load.terms)} coefficients at {_point(record, point)}"
    return _part(
        "fit", text, "B" if from_stated else "A", "normal" if from_stated else "student",
        math.sqrt(curve.variance), curve.dof, "data", joint=not from_stated,
    )  # fmt: skip


def _repeatability(s: Scatter, reading: float) -> Component:
    runs = s.runs
    text = f"scatter of a reading within a {runs.factor}"
    if runs.correlation > 0:
        text += f", correlated by {runs.correlation:.2f} from row to row"
    if s.profile is not None:
        shown = "the residuals show" if s.rows.noise is None else "the rows' stated uncertainties have"
        text += f", as {shown} it at this point"
    if not s.misfit_dof:
        text += "; it holds the misfit of the curve, which so few rows cannot tell apart"
    dof = s.dof(_READING, runs.within**2)
    u = runs.within * math.sqrt(reading)
    return _part("repeatability", text, "A", "student", u, dof, "data", joint=True)


def _reproducibility(s: Scatter, new: _Variance) -> Component:
    runs = s.runs
    u = math.sqrt(new.variance)
    if runs.groups < 2:
        if not u:
            why = f"so few rows, or one {runs.factor}, tell nothing of the next"
            return _absent("reproducibility", why, "data")
        text = f"stated of another {runs.factor}: zero {runs.zero:.3g}, gain {runs.gain:.3g} at full scale"
        if runs.model == UNTOLD:
            text = (
                f"at most between {runs.factor}s, whose rows are too few to tell: "
                f"zero {runs.zero:.3g}, gain {runs.gain:.3g} at full scale"
            )
            return _part("reproducibility", text, "A", "student", u, new.dof, "data", joint=True)
        return _part("reproducibility", text, "B", "normal", u, math.inf, "session")
    text = (
        f"between {runs.groups} {runs.factor}s, free of the scatter within: zero {runs.zero:.3g}, "
        f"gain {runs.gain:.3g} at full scale"
    )
    return _part("reproducibility", text, "A", "student", u, new.dof, "data", joint=True)


def _interpolation(record: CalibrationRecord, s: Scatter, check: Table | None, load: LoadFit) -> Component:
    """Return the misfit of the level means, else of the check loads (ISO 376 C: interpolation)."""
    if s.misfit_dof:
        text = f"distance of a smooth curve from the equation (rms), free of the scatter; {s.misfit_dof} dof"
        return _part("interpolation", text, "A", "normal", s.misfit, s.misfit_dof, "data")
    if check is None:
        return _absent(
            "interpolation", "too few rows to tell it from scatter, and there are no check loads", "data"
        )
    design = term_matrix(load.terms, check.columns(record.indications))
    off = design @ np.asarray(load.coefficients) - check.column(load.load)
    reading = s.reading(check.columns(record.indications))
    expected = s.runs.within**2 * reading + np.einsum(
        "ij,jk,ik->i", design, np.asarray(load.covariance), design
    )
    u = math.sqrt(max(float(np.mean(off**2 - expected)), 0.0))
    text = f"distance of {check.rows} check loads from the curve (rms), free of scatter and fit"
    return _part("interpolation", text, "A", "normal", u, check.rows, "check loads")


def _reversibility(s: Scatter) -> Component:
    if not s.reversal_dof:
        return _absent("reversibility", "too few rows were loaded and unloaded", "data")
    text = f"half the difference of the directions (rms over the loads) {s.reversal:.3g}, / sqrt(3)"
    return _part("reversibility", text, "A", "rectangular", s.reversal / ROOT3, s.reversal_dof, "data")


def _resolution(record: CalibrationRecord, statements: Statements, slope: Array) -> Component:
    errors = indication_errors(record, statements)
    silent = [cell.name for cell in statements.cells if cell.resolution is None]
    if len(silent) == len(errors):
        return _absent("resolution", "no indication's resolution is stated", "session")
    # Half a digit, rectangular (GUM F.2.2.1), in each reading that the indication is made of.
    parts = [c * e.half_width / ROOT3 * math.sqrt(e.readings) for c, e in zip(slope, errors, strict=True)]
    from_steps = [cell.name for cell in statements.cells if cell.found]
    text = f"half a digit, rectangular, in {errors[0].readings} reading(s) an indication" + _without(silent)
    text += f"; of {', '.join(from_steps)} the step of the readings" if from_steps else ""
    u = math.sqrt(sum(part * part for part in parts))
    return _part("resolution", text, "B", "rectangular", u, math.inf, "session")


def _cells(record: CalibrationRecord, statements: Statements, slope: Array) -> Component:
    silent = [cell.name for cell in statements.cells if cell.u is None]
    if len(silent) == len(statements.cells):
        return _absent("indication", "no indication's standard uncertainty is stated", "session")
    errors = indication_errors(record, statements)
    u = math.sqrt(sum((c * e.u) ** 2 for c, e in zip(slope, errors, strict=True)))
    text = "stated u of the indications, independent of each other" + _without(silent)
    return _part("indication", text, "B", "normal", u, math.inf, "session")


def _zero(record: CalibrationRecord, load: LoadFit, slope: Array) -> Component:
    drift, intercept = zero_drift(record), left_at_zero(record, load)
    if isinstance(drift, str) and not intercept:
        return _absent("zero", drift, "session")
    moved = 0.0 if isinstance(drift, str) else abs(float(slope @ np.asarray(drift)))
    reason = (
        []
        if isinstance(drift, str)
        else [f"zeros after the session minus before move the load by {moved:.3g}"]
    )
    if intercept:
        reason.append(f"tared indications of zero mean {intercept:.3g}")
    text = f"{'; '.join(reason)}: rectangular half-width"
    return _part("zero", text, "B", "rectangular", math.hypot(moved, intercept) / ROOT3, math.inf, "session")


def _creep(record: CalibrationRecord, load: LoadFit, value: float) -> Component:
    ratio = creep(record, load)
    if isinstance(ratio, str):
        return _absent("creep", ratio, "session")
    text = f"{100 * ratio:.3g} % of the load between the readings: rectangular half-width"
    return _part("creep", text, "B", "rectangular", ratio * abs(value) / ROOT3, math.inf, "session")


def _temperature(
    statements: Statements, temperature: Temperature | None, slope: Array, point: Array, value: float
) -> Component:
    """Return what a temperature that differs from the session's does: one difference for all cells."""
    at = statements.temperature_C
    session = "the session's temperature is not stated" if at is None else f"the session was at {at:.1f} degC"
    cells = [cell for cell in statements.cells if (cell.span_per_K, cell.zero_per_K) != (None, None)]
    if temperature is None:
        lacking = "the range of use is not" if cells else "nor the range of use"
        why = f"{'a' if cells else 'no'} temperature coefficient is stated, {lacking}; {session}"
        return _absent("temperature", why, "conditions of use")
    if temperature.coefficient_per_K is not None:
        per_K = temperature.coefficient_per_K * value
        source = f"{temperature.coefficient_per_K:.3g} /K of the load"
    elif cells:
        rates = [
            (c.span_per_K or 0.0) * x + (c.zero_per_K or 0.0)
            for c, x in zip(statements.cells, point, strict=True)
        ]
        per_K = float(slope @ np.asarray(rates))
        source = f"coefficients of {', '.join(cell.name for cell in cells)}: {per_K:.3g} a kelvin"
    else:
        return _absent("temperature", f"no temperature coefficient is stated; {session}", "conditions of use")
    u = abs(per_K) * temperature.half_range_K / ROOT3
    text = f"{source}, +-{temperature.half_range_K:g} K rectangular; {session}"
    return _part("temperature", text, "B", "rectangular", u, math.inf, "conditions of use")


def _part(
    name: str,
    text: str,
    kind: Evaluation,
    distribution: Distribution,
    u: float,
    dof: float,
    source: str,
    *,
    joint: bool = False,
) -> Component:
    return Component(
        name=name, description=text, type=kind, distribution=distribution, u=float(u), dof=float(dof),
        source=source, joint=joint,
    )  # fmt: skip


def _absent(name: str, why: str, source: str) -> Component:
    return Component(
        name=name, description=why, type="B", distribution="normal", u=0.0, dof=math.inf, source=source,
        stated=False,
    )  # fmt: skip


def _without(silent: list[str]) -> str:
    return f"; nothing is stated of {', '.join(silent)}" if silent else ""


def _point(record: CalibrationRecord, point: Array) -> str:
    return ", ".join(f"{n} = {x:.4g}" for n, x in zip(record.indications, point.tolist(), strict=True))
