"""Activation gates: sign and span against the last approved record, and the check loads.

A sign is a fault only where it matters: a coefficient whose contribution over the session's range is
inside the check loads' tolerance has a sign that noise decides.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.terms import INTERCEPT, term_matrix

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.table import Table

SPAN = 0.02
VERIFIED = 5.0
_RANK = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class GateResult:
    """One failed gate: ``rule`` is sign, span or check-load; ``where`` names load and term or row."""

    rule: str
    where: str
    message: str


def sign_and_span(
    new: CalibrationRecord, old: CalibrationRecord, *, only: Collection[str] | None = None
) -> tuple[GateResult, ...]:
    """Compare a record's coefficients with those of an earlier one, per serial and unit.

    An indication with another serial or unit is not compared (`new_history`); ``only`` names those that are.
    """
    failed: list[GateResult] = []
    fresh = set(new_history(new, old))
    if only is not None:
        fresh |= {cell.name for cell in new.cells} - set(only)
    cells = {cell.name: cell for cell in new.cells}
    for one in new.loads:
        other = next((o for o in old.loads if o.load == one.load and o.unit == one.unit), None)
        if other is None:
            continue
        before = dict(zip(other.terms, other.coefficients, strict=True))
        for at, (term, value) in enumerate(zip(one.terms, one.coefficients, strict=True)):
            cell = cells.get(term)
            if cell is None or term in fresh or term not in before:
                continue
            reach = 1.0 if cell.maximum is None or cell.minimum is None else cell.maximum - cell.minimum
            change = abs(value - before[term])
            tolerance = one.tolerance or 1e-3 * one.largest
            # A legacy record has no range of its own: all that is left to compare is the sign.
            if np.isfinite(tolerance) and change * reach <= tolerance:
                continue
            if change <= 3 * _u_change(one, other, at, term):
                continue
            text = f"{value:.6g} against {before[term]:.6g} in {old.id}"
            where = f"{one.load}, {term}"
            if value * before[term] < 0:
                failed.append(GateResult(rule="sign", where=where, message=f"the sign changed: {text}"))
            elif change > SPAN * abs(before[term]):
                percent = 100 * (value / before[term] - 1) if before[term] else np.inf
                message = f"the span changed by {percent:+.2f} %: {text}"
                failed.append(GateResult(rule="span", where=where, message=message))
    return tuple(failed)


def new_history(new: CalibrationRecord, old: CalibrationRecord) -> tuple[str, ...]:
    """Return the indications whose serial or unit differs: their sign and span have no history."""
    before = {cell.name: cell for cell in old.cells}
    return tuple(
        cell.name
        for cell in new.cells
        if cell.name not in before
        or (before[cell.name].serial, before[cell.name].unit) != (cell.serial, cell.unit)
    )


def check_loads(record: CalibrationRecord, check: Table) -> tuple[GateResult, ...]:
    """Return the check loads that the record's coefficients miss by more than the tolerance."""
    failed: list[GateResult] = []
    for one in record.loads:
        fitted = term_matrix(one.terms, check.columns(record.indications)) @ np.asarray(one.coefficients)
        off = fitted - check.column(one.load)
        tolerance = one.tolerance or 1e-3 * one.largest
        failed += [
            GateResult(
                rule="check-load",
                where=f"{one.load}, check row {row + 1}",
                message=f"off by {off[row]:+.4g} {one.unit}, tolerance {tolerance:.4g} {one.unit}",
            )
            for row in np.flatnonzero(np.abs(off) > tolerance)
        ]
    return tuple(failed)


def unverifiable(record: CalibrationRecord, check: Table | None) -> tuple[str, ...]:
    """Return the terms that the check loads cannot verify, as "load: term".

    A term is verified where the check set has full column rank and the term's contribution over it,
    |c_i| dX_i, exceeds five tolerances: only then would a flipped or lost coefficient show. The intercept
    has no range; it is verified with the rank alone.
    """
    names: list[str] = []
    for one in record.loads:
        if check is None:
            names += [f"{one.load}: {term}" for term in one.terms]
            continue
        matrix = term_matrix(one.terms, check.columns(record.indications))
        lost = _undetermined(matrix)
        tolerance = one.tolerance or 1e-3 * one.largest
        effect = np.abs(one.coefficients) * np.ptp(matrix, axis=0)
        names += [
            f"{one.load}: {term}"
            for at, term in enumerate(one.terms)
            if lost[at] or (term != INTERCEPT and not effect[at] > VERIFIED * tolerance)
        ]
    return tuple(names)


def _undetermined(matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[bool]:
    """Return which terms take part in the null space of the check loads' scaled term matrix."""
    length = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    _, values, right = np.linalg.svd(matrix / np.where(length == 0, 1.0, length))
    rank = int(np.sum(values > _RANK * values[0])) if len(values) else 0
    null = right[rank:]
    return [bool(np.any(np.abs(null[:, j]) > 1e-6)) or bool(length[j] == 0) for j in range(matrix.shape[1])]


def _u_change(one: LoadFit, other: LoadFit, at: int, term: str) -> float:
    u = one.covariance[at][at] if one.covariance else 0.0
    if other.covariance:
        j = other.terms.index(term)
        u += other.covariance[j][j]
    return float(np.sqrt(u))
