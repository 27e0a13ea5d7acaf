"""The components of a budget, one function each; equations as in JCGM 100 and ISO 376:2011 annex C.

Each is computed for many points at once: a budget at one load is that of a single point.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.records.scatter import UNTOLD, quadratic
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
from toolkit.calibration.uncertainty.model import Contribution, Distribution, Evaluation, Temperature
from toolkit.calibration.uncertainty.scatter import Scatter

ROOT3 = math.sqrt(3.0)
_READING = np.array([1.0, 0.0, 0.0, 0.0])


def components_of(
    record: CalibrationRecord,
    statements: Statements,
    loads: Table,
    check: Table | None,
    load: LoadFit,
    *,
    values: Array,
    points: Array,
    temperature: Temperature | None,
    scatter: Scatter,
) -> tuple[tuple[Contribution, ...], Array]:
    """Return every component at points (points, indications), whose loads are ``values`` [the load's unit].

    ``scatter`` of the session's rows is the same at every point.

    With them the degrees of freedom of those that the session's rows give together: u^2 of their sum is
    linear in the variances within and between runs, and Satterthwaite's formula holds for it as a whole.
    """
    columns = dict(zip(record.indications, points.T, strict=True))
    slopes = sensitivities(record, load, points)
    curve = _curve(load, scatter, columns)
    new = _new_run(scatter, np.abs(values) / load.largest)
    reading = scatter.reading(columns)
    total = (0.0 if _from_stated(load, curve) else curve.variance) + scatter.runs.within**2 * reading
    total = total + (new.variance if _estimated(scatter) else 0.0)
    dof = scatter.dof(curve.gradient + reading[:, None] * _READING + new.gradient, total)
    return (
        _reference(statements, load, values, loads),
        _fit(record, load, points, curve),
        _repeatability(scatter, reading),
        _reproducibility(scatter, new),
        _interpolation(record, scatter, check, load),
        _reversibility(scatter),
        _resolution(record, statements, slopes),
        _cells(record, statements, slopes),
        _zero(record, load, slopes),
        _creep(record, load, values),
        _temperature(statements, temperature, slopes, points, values),
    ), dof


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Variance:
    """Variances (points,) [unit of the load, squared], gradients (points, 4) by the scatter's components."""

    variance: Array
    gradient: Array
    dof: Array


def _curve(load: LoadFit, s: Scatter, columns: Mapping[str, Array]) -> _Variance:
    """Return the variance of the curve at points, J C J^T (JCGM 100 eq. 13, H.3.4)."""
    J = term_matrix(load.terms, columns)
    if load.scatter is not None or s.runs.groups > 1:
        variance, gradient = s.rows.variance(s.runs, J)
        return _Variance(variance=variance, gradient=gradient, dof=s.dof(gradient, variance))
    stored, gradient = np.maximum(quadratic(J, np.asarray(load.covariance)), 0.0), np.zeros((len(J), 4))
    if load.method != "ols":
        return _Variance(variance=stored, gradient=gradient, dof=np.array(math.inf))
    # Of what is rounded away nothing is estimated.
    rounded = 0.0 if s.rows.rounded is None else quadratic(J, s.rows.rounded)
    gradient[:, 0] = np.maximum(stored - rounded, 0.0) / (load.residual_sd or 1.0) ** 2
    dof = math.inf if load.dof is None else float(load.dof)
    return _Variance(variance=stored, gradient=gradient, dof=np.array(dof))


def _estimated(s: Scatter) -> bool:
    """Tell whether zeros and gains of runs are of the rows, and not stated."""
    return s.runs.groups > 1 or s.runs.model == UNTOLD


def _from_stated(load: LoadFit, curve: _Variance) -> bool:
    """Tell whether the covariance follows from stated uncertainties alone: no scatter is above them."""
    return load.method != "ols" and bool(np.isinf(curve.dof).all())


def _new_run(s: Scatter, shares: Array) -> _Variance:
    """Return the variance of another run's zero and gain at shares (points,) of the largest load."""
    none = np.zeros_like(shares)
    gradient = np.column_stack([none, np.ones_like(shares), shares**2, none])
    variance = gradient[:, :3] @ s.runs.variances
    dof = np.where(variance == 0, 1.0, s.dof(gradient, variance))
    return _Variance(variance=variance, gradient=gradient, dof=dof)


def _reference(statements: Statements, load: LoadFit, values: Array, loads: Table) -> Contribution:
    """Return what the standard is uncertain by at a load: an amount at every load alike, or a share."""
    stated = statements.reference.of(load.load)
    if stated is None and load.reference_u is not None:
        text = f"u_{load.load} of the rows around the load, at most {load.reference_u:.4g} {load.unit}"
        u = _of_rows_around(loads, load, values)
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
    return _part("reference", text, "B", "normal", stated.u_at(values), math.inf, "session")


def _of_rows_around(loads: Table, load: LoadFit, values: Array) -> Array:
    """Return the standard uncertainty that rows state around loads: between levels in proportion."""
    u = row_uncertainty(loads, load.load)
    if u is None:
        return np.array(load.reference_u or 0.0)
    level, place = np.unique(np.abs(loads.column(load.load)), return_inverse=True)
    largest = np.zeros(len(level))
    np.maximum.at(largest, place.ravel(), u)
    return np.asarray(np.interp(np.abs(values), level, largest))


def _fit(record: CalibrationRecord, load: LoadFit, points: Array, curve: _Variance) -> Contribution:
    from_stated = _from_stated(load, curve)
    return _part(
        "fit", lambda row: f"J V J^T of the {len(load.terms)} coefficients at {_point(record, points[row])}",
        "B" if from_stated else "A", "normal" if from_stated else "student", np.sqrt(curve.variance),
        curve.dof, "data", joint=not from_stated,
    )  # fmt: skip


def _repeatability(s: Scatter, reading: Array) -> Contribution:
    runs = s.runs
    text = f"scatter of a reading within a {runs.factor}"
    if runs.correlation > 0:
        text += f", correlated by {runs.correlation:.2f} from row to row"
    if s.profile is not None:
        shown = "the residuals show" if s.rows.noise is None else "the rows' stated uncertainties have"
        text += f", as {shown} it at this point"
    if not s.misfit_dof:
        text += "; it holds the misfit of the curve, which so few rows cannot tell apart"
    dof = s.dof(_READING[None], runs.variances[:1])
    u = runs.within * np.sqrt(reading)
    return _part("repeatability", text, "A", "student", u, dof, "data", joint=True)


def _reproducibility(s: Scatter, new: _Variance) -> Contribution:
    runs = s.runs
    u = np.sqrt(new.variance)
    if runs.groups < 2:
        if not (runs.zero or runs.gain):
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


def _interpolation(record: CalibrationRecord, s: Scatter, check: Table | None, load: LoadFit) -> Contribution:
    """Return the misfit of the level means, else of the check loads (ISO 376 C: interpolation)."""
    if s.misfit_dof:
        text = f"distance of a smooth curve from the equation (rms), free of the scatter; {s.misfit_dof} dof"
        return _part("interpolation", text, "A", "normal", s.misfit, s.misfit_dof, "data")
    if check is None:
        return _absent(
            "interpolation", "too few rows to tell it from scatter, and there are no check loads", "data"
        )
    columns = check.columns(record.indications)
    off, design = load.at(columns) - check.column(load.load), term_matrix(load.terms, columns)
    reading = s.reading(columns)
    expected = s.runs.within**2 * reading + quadratic(design, np.asarray(load.covariance))
    u = math.sqrt(max(float(np.mean(off**2 - expected)), 0.0))
    text = f"distance of {check.rows} check loads from the curve (rms), free of scatter and fit"
    return _part("interpolation", text, "A", "normal", u, check.rows, "check loads")


def _reversibility(s: Scatter) -> Contribution:
    if not s.reversal_dof:
        return _absent("reversibility", "too few rows were loaded and unloaded", "data")
    text = f"half the difference of the directions (rms over the loads) {s.reversal:.3g}, / sqrt(3)"
    return _part("reversibility", text, "A", "rectangular", s.reversal / ROOT3, s.reversal_dof, "data")


def _resolution(record: CalibrationRecord, statements: Statements, slopes: Array) -> Contribution:
    errors = indication_errors(record, statements)
    silent = [cell.name for cell in statements.cells if cell.resolution is None]
    if len(silent) == len(errors):
        return _absent("resolution", "no indication's resolution is stated", "session")
    # Half a digit, rectangular (GUM F.2.2.1), in each reading that the indication is made of.
    parts = [c * e.half_width / ROOT3 * math.sqrt(e.readings) for c, e in zip(slopes.T, errors, strict=True)]
    from_steps = [cell.name for cell in statements.cells if cell.found]
    text = f"half a digit, rectangular, in {errors[0].readings} reading(s) an indication" + _without(silent)
    text += f"; of {', '.join(from_steps)} the step of the readings" if from_steps else ""
    u = np.sqrt(sum(part * part for part in parts))
    return _part("resolution", text, "B", "rectangular", u, math.inf, "session")


def _cells(record: CalibrationRecord, statements: Statements, slopes: Array) -> Contribution:
    silent = [cell.name for cell in statements.cells if cell.u is None]
    if len(silent) == len(statements.cells):
        return _absent("indication", "no indication's standard uncertainty is stated", "session")
    errors = indication_errors(record, statements)
    u = np.sqrt(sum((c * e.u) ** 2 for c, e in zip(slopes.T, errors, strict=True)))
    text = "stated u of the indications, independent of each other" + _without(silent)
    return _part("indication", text, "B", "normal", u, math.inf, "session")


def _zero(record: CalibrationRecord, load: LoadFit, slopes: Array) -> Contribution:
    drift, intercept = zero_drift(record), left_at_zero(record, load)
    if isinstance(drift, str) and not intercept:
        return _absent("zero", drift, "session")
    moved = None if isinstance(drift, str) else np.abs(slopes @ np.asarray(drift))

    def text(row: int) -> str:
        reason = []
        if moved is not None:
            reason.append(f"zeros after the session minus before move the load by {moved[row]:.3g}")
        if intercept:
            reason.append(f"tared indications of zero mean {intercept:.3g}")
        return f"{'; '.join(reason)}: rectangular half-width"

    u = np.hypot(0.0 if moved is None else moved, intercept) / ROOT3
    return _part("zero", text, "B", "rectangular", u, math.inf, "session")


def _creep(record: CalibrationRecord, load: LoadFit, values: Array) -> Contribution:
    ratio = creep(record, load)
    if isinstance(ratio, str):
        return _absent("creep", ratio, "session")
    text = f"{100 * ratio:.3g} % of the load between the readings: rectangular half-width"
    return _part("creep", text, "B", "rectangular", ratio * np.abs(values) / ROOT3, math.inf, "session")


def _temperature(
    statements: Statements, temperature: Temperature | None, slopes: Array, points: Array, values: Array
) -> Contribution:
    """Return what a temperature that differs from the session's does: one difference for all cells."""
    at = statements.temperature_C
    session = "the session's temperature is not stated" if at is None else f"the session was at {at:.1f} degC"
    cells = [cell for cell in statements.cells if (cell.span_per_K, cell.zero_per_K) != (None, None)]
    if temperature is None:
        lacking = "the range of use is not" if cells else "nor the range of use"
        why = f"{'a' if cells else 'no'} temperature coefficient is stated, {lacking}; {session}"
        return _absent("temperature", why, "conditions of use")
    if temperature.coefficient_per_K is not None:
        per_K = temperature.coefficient_per_K * values
    elif cells:
        spans = np.array([cell.span_per_K or 0.0 for cell in statements.cells])
        zeros = np.array([cell.zero_per_K or 0.0 for cell in statements.cells])
        per_K = np.einsum("ij,ij->i", slopes, spans * points + zeros)
    else:
        return _absent("temperature", f"no temperature coefficient is stated; {session}", "conditions of use")

    def text(row: int) -> str:
        source = f"coefficients of {', '.join(cell.name for cell in cells)}: {per_K[row]:.3g} a kelvin"
        if temperature.coefficient_per_K is not None:
            source = f"{temperature.coefficient_per_K:.3g} /K of the load"
        return f"{source}, +-{temperature.half_range_K:g} K rectangular; {session}"

    u = np.abs(per_K) * temperature.half_range_K / ROOT3
    return _part("temperature", text, "B", "rectangular", u, math.inf, "conditions of use")


def _part(
    name: str,
    text: str | Callable[[int], str],
    kind: Evaluation,
    distribution: Distribution,
    u: Array | float,
    dof: Array | float,
    source: str,
    *,
    joint: bool = False,
    stated: bool = True,
) -> Contribution:
    return Contribution(
        name=name, describe=(lambda _row: text) if isinstance(text, str) else text, type=kind,
        distribution=distribution, u=np.asarray(u), dof=np.asarray(dof), source=source, joint=joint,
        stated=stated,
    )  # fmt: skip


def _absent(name: str, why: str, source: str) -> Contribution:
    return _part(name, why, "B", "normal", 0.0, math.inf, source, stated=False)


def _without(silent: list[str]) -> str:
    return f"; nothing is stated of {', '.join(silent)}" if silent else ""


def _point(record: CalibrationRecord, point: Array) -> str:
    return ", ".join(f"{n} = {x:.4g}" for n, x in zip(record.indications, point.tolist(), strict=True))
