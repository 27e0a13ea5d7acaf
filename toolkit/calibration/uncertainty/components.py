"""The components of a budget, one function each; equations as in JCGM 100 and ISO 376:2011 annex C."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.terms import term_matrix
from toolkit.calibration.uncertainty.conditions import Temperature
from toolkit.calibration.uncertainty.model import Component, Distribution, Evaluation
from toolkit.calibration.uncertainty.readings import (
    creep,
    indication_errors,
    sensitivities,
    zero_drift,
)
from toolkit.calibration.uncertainty.scatter import Scatter, split_scatter
from toolkit.estimate import effective_dof

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.statements import Statements
    from toolkit.calibration.session.table import Table

ROOT3 = math.sqrt(3.0)


def components_of(
    record: CalibrationRecord,
    statements: Statements,
    loads: Table,
    check: Table | None,
    one: LoadFit,
    *,
    value: float,
    point: NDArray[np.float64],
    temperature: Temperature | None,
) -> tuple[Component, ...]:
    """Return every component at a point (indications,), whose load is ``value`` [the load's unit]."""
    scatter = scatter_of(record, loads, one)
    slope = sensitivities(record, one, point.tolist())
    share = abs(value) / one.largest
    return (
        _reference(statements, one),
        _fit(record, one, point),
        _repeatability(scatter),
        _reproducibility(scatter, share),
        _interpolation(record, scatter, check, one),
        _reversibility(scatter),
        _resolution(record, statements, slope),
        _cells(record, statements, slope),
        _zero(record, slope),
        _creep(record, one, value),
        _temperature(statements, temperature, slope, point, value),
    )


def scatter_of(record: CalibrationRecord, loads: Table, one: LoadFit) -> Scatter:
    """Return the scatter of a record's own residuals, taken apart."""
    design = term_matrix(one.terms, loads.columns(record.indications))
    load = loads.column(one.load)
    return split_scatter(
        residuals=load - design @ np.asarray(one.coefficients),
        design=design,
        load=load,
        loads=loads.matrix([each.load for each in record.loads]),
        table=loads,
    )


def fit_u(record: CalibrationRecord, one: LoadFit, point: NDArray[np.float64]) -> float:
    """Return sqrt(J V J^T), the standard uncertainty of the curve at a point (JCGM 100 eq. 13, H.3.4)."""
    J = term_matrix(one.terms, dict(zip(record.indications, point[:, None], strict=True)))[0]
    return math.sqrt(max(float(J @ np.asarray(one.covariance) @ J), 0.0))


def _reference(statements: Statements, one: LoadFit) -> Component:
    u = statements.reference.u(one.load)
    if u is None:
        return _absent("reference", "no uncertainty of the reference standard is stated", "session")
    if one.method == "gls" and statements.reference.shared_group is not None:
        text = "held by the fit's covariance: its rows share the reference's error (gls)"
        return _part("reference", text, "B", "normal", 0.0, math.inf, "session")
    stated = next(s for s in statements.reference.uncertainties if s.load == one.load)
    text = f"certificate: U = {stated.U:.4g} {one.unit} with k = {stated.k:g}, u = U/k at every load"
    return _part("reference", text, "B", "normal", u, math.inf, "session")


def _fit(record: CalibrationRecord, one: LoadFit, point: NDArray[np.float64]) -> Component:
    known = one.method != "ols"  # the covariance follows from stated uncertainties alone
    text = f"J V J^T of the {len(one.terms)} coefficients at {_point(record, point)}"
    return _part(
        "fit", text, "B" if known else "A", "normal" if known else "student", fit_u(record, one, point),
        math.inf if known or one.dof is None else one.dof, "data",
    )  # fmt: skip


def _repeatability(s: Scatter) -> Component:
    text = f"scatter of a reading at one load within a {s.factor}, all levels pooled"
    if not s.levels:
        text = f"scatter about the curve within a {s.factor}; it holds the misfit, as no load was repeated"
    return _part("repeatability", text, "A", "student", s.within, s.within_dof, "data")


def _reproducibility(s: Scatter, share: float) -> Component:
    parts = [(s.offset, s.offset_dof), (s.gain * share, s.gain_dof)]
    if s.groups < 2 or not s.offset_dof + s.gain_dof:
        return _absent("reproducibility", f"one {s.factor} tells nothing of the next", "data")
    used = [(u, float(dof)) for u, dof in parts if u > 0]
    u = math.sqrt(sum(u * u for u, _ in used))
    dof = effective_dof(used) if used else float(max(s.offset_dof, s.gain_dof))
    text = f"between {s.groups} {s.factor}s, free of the scatter within: zero {s.offset:.3g}, " \
        f"gain {s.gain:.3g} at full scale"  # fmt: skip
    return _part("reproducibility", text, "A", "student", u, dof, "data")


def _interpolation(record: CalibrationRecord, s: Scatter, check: Table | None, one: LoadFit) -> Component:
    """Return the misfit of the level means, else of the check loads (ISO 376 C: interpolation)."""
    if s.misfit_dof:
        text = f"distance of the level means from the curve (rms), free of the scatter; {s.misfit_dof} dof"
        return _part("interpolation", text, "A", "normal", s.misfit, s.misfit_dof, "data")
    if check is None:
        return _absent("interpolation", "no load was repeated and there are no check loads", "data")
    design = term_matrix(one.terms, check.columns(record.indications))
    off = design @ np.asarray(one.coefficients) - check.column(one.load)
    expected = s.within**2 + np.einsum("ij,jk,ik->i", design, np.asarray(one.covariance), design)
    u = math.sqrt(max(float(np.mean(off**2 - expected)), 0.0))
    text = f"distance of {check.rows} check loads from the curve (rms), free of scatter and fit"
    return _part("interpolation", text, "A", "normal", u, check.rows, "check loads")


def _reversibility(s: Scatter) -> Component:
    if not s.reversal_dof:
        return _absent("reversibility", "no load was applied in both directions", "data")
    text = (
        f"half the difference of the directions (rms of {s.reversal_dof} levels) {s.reversal:.3g}, / sqrt(3)"
    )
    return _part("reversibility", text, "A", "rectangular", s.reversal / ROOT3, s.reversal_dof, "data")


def _resolution(record: CalibrationRecord, statements: Statements, slope: NDArray[np.float64]) -> Component:
    errors = indication_errors(record, statements)
    silent = [cell.name for cell in statements.cells if cell.resolution is None]
    if len(silent) == len(errors):
        return _absent("resolution", "no indication's resolution is stated", "session")
    # Half a digit, rectangular (GUM F.2.2.1), in each reading that the indication is made of.
    parts = [c * e.half_width / ROOT3 * math.sqrt(e.readings) for c, e in zip(slope, errors, strict=True)]
    text = f"half a digit, rectangular, in {errors[0].readings} reading(s) an indication" + _without(silent)
    u = math.sqrt(sum(part * part for part in parts))
    return _part("resolution", text, "B", "rectangular", u, math.inf, "session")


def _cells(record: CalibrationRecord, statements: Statements, slope: NDArray[np.float64]) -> Component:
    silent = [cell.name for cell in statements.cells if cell.u is None]
    if len(silent) == len(statements.cells):
        return _absent("indication", "no indication's standard uncertainty is stated", "session")
    errors = indication_errors(record, statements)
    u = math.sqrt(sum((c * e.u) ** 2 for c, e in zip(slope, errors, strict=True)))
    text = "stated u of the indications, independent of each other" + _without(silent)
    return _part("indication", text, "B", "normal", u, math.inf, "session")


def _zero(record: CalibrationRecord, slope: NDArray[np.float64]) -> Component:
    drift = zero_drift(record)
    if isinstance(drift, str):
        return _absent("zero", drift, "session")
    moved = abs(float(slope @ np.asarray(drift)))
    text = f"zeros after the session minus before move the load by {moved:.3g}: rectangular half-width"
    return _part("zero", text, "B", "rectangular", moved / ROOT3, math.inf, "session")


def _creep(record: CalibrationRecord, one: LoadFit, value: float) -> Component:
    ratio = creep(record, one)
    if isinstance(ratio, str):
        return _absent("creep", ratio, "session")
    text = f"{100 * ratio:.3g} % of the load between the readings: rectangular half-width"
    return _part("creep", text, "B", "rectangular", ratio * abs(value) / ROOT3, math.inf, "session")


def _temperature(
    statements: Statements,
    given: Temperature | None,
    slope: NDArray[np.float64],
    point: NDArray[np.float64],
    value: float,
) -> Component:
    """Return what a temperature that differs from the session's does: one difference for all cells."""
    at = statements.temperature_C
    session = "the session's temperature is not stated" if at is None else f"the session was at {at:.1f} degC"
    cells = [cell for cell in statements.cells if (cell.span_per_K, cell.zero_per_K) != (None, None)]
    if given is None:
        known = "the range of use is not" if cells else "nor the range of use"
        why = f"{'a' if cells else 'no'} temperature coefficient is stated, {known}; {session}"
        return _absent("temperature", why, "conditions of use")
    if given.coefficient_per_K is not None:
        per_K = given.coefficient_per_K * value
        what = f"{given.coefficient_per_K:.3g} /K of the load"
    elif cells:
        rates = [
            (c.span_per_K or 0.0) * x + (c.zero_per_K or 0.0)
            for c, x in zip(statements.cells, point, strict=True)
        ]
        per_K = float(slope @ np.asarray(rates))
        what = f"coefficients of {', '.join(cell.name for cell in cells)}: {per_K:.3g} a kelvin"
    else:
        return _absent("temperature", f"no temperature coefficient is stated; {session}", "conditions of use")
    u = abs(per_K) * given.half_range_K / ROOT3
    text = f"{what}, +-{given.half_range_K:g} K rectangular; {session}"
    return _part("temperature", text, "B", "rectangular", u, math.inf, "conditions of use")


def _part(
    name: str, text: str, kind: Evaluation, distribution: Distribution, u: float, dof: float, source: str
) -> Component:
    return Component(
        name=name, description=text, type=kind, distribution=distribution, u=float(u), dof=float(dof),
        source=source,
    )  # fmt: skip


def _absent(name: str, why: str, source: str) -> Component:
    return Component(
        name=name, description=why, type="B", distribution="normal", u=0.0, dof=math.inf, source=source,
        stated=False,
    )  # fmt: skip


def _without(silent: list[str]) -> str:
    return f"; nothing is stated of {', '.join(silent)}" if silent else ""


def _point(record: CalibrationRecord, point: NDArray[np.float64]) -> str:
    return ", ".join(f"{n} = {x:.4g}" for n, x in zip(record.indications, point.tolist(), strict=True))
