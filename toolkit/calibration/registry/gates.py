"""Activation gates: what a record says in SI against an earlier one, and the check loads.

Sign and span are compared as responses (`response`), so that a unit that was written wrongly changes the span
by its factor, and one that was changed on purpose changes nothing. A sign is a fault only where it matters: a
response whose contribution over the session's range is inside the check loads' tolerance has a sign that
noise decides.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from toolkit.calibration.fit.printed_digits import copies, own_scatter
from toolkit.calibration.records.record import CalibrationRecord, Indication, LoadFit
from toolkit.calibration.registry.response import (
    Response,
    largest_load,
    range_of,
    response,
    same_dimension,
    same_unit,
    tolerance,
)
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.findings import Finding, Level

SPAN = 0.02
VERIFIED = 5.0
_RANK = 1e-8

Effect = Literal["blocks", "asks", "tells"]
_LEVELS: dict[Effect, Level] = {"blocks": "error", "asks": "note", "tells": "warning"}


@dataclass(frozen=True, slots=True, kw_only=True)
class GateResult:
    """One gate: ``rule`` such as sign, span or check-load; ``where`` names load and indication or row.

    ``effect``: ``blocks`` an approval; ``asks`` for something that an approval needs; ``tells`` what does
    not stand in its way, and is written to the ledger with it.
    """

    rule: str
    where: str
    message: str
    effect: Effect = "blocks"

    def finding(self) -> Finding:
        """Return the finding of a session: an error refuses the approval; what it only asks for is a note."""
        return Finding(rule=self.rule, where=self.where, message=self.message, level=_LEVELS[self.effect])


def refusals(findings: Iterable[Finding]) -> tuple[GateResult, ...]:
    """Return what of a session's findings refuses an approval: those that are errors."""
    return tuple(
        GateResult(rule=finding.rule, where=finding.where, message=finding.message)
        for finding in findings
        if finding.level == "error"
    )


def sign_and_span(
    new: CalibrationRecord, old: CalibrationRecord, *, only: Collection[str] | None = None
) -> tuple[GateResult, ...]:
    """Compare a record's responses with those of an earlier one, in SI, indication by indication.

    ``only`` names the indications to compare; default: all that both have. Where an indication's dimension
    changed (mV/V to counts), its sign is compared and its span cannot be.
    """
    failed: list[GateResult] = []
    before = {cell.name: cell for cell in old.cells}
    for load in new.loads:
        before_load = next((o for o in old.loads if o.load == load.load), None)
        if before_load is None or not same_dimension(load.unit, before_load.unit):
            continue
        for cell in new.cells:
            if cell.name in before and (only is None or cell.name in only):
                change = _change((new, load, cell), (old, before_load, before[cell.name]))
                failed += [] if change is None else [change]
    return tuple(failed)


_Place = tuple["CalibrationRecord", "LoadFit", "Indication"]


def _change(new: _Place, old: _Place) -> GateResult | None:
    comparable = same_dimension(new[2].unit, old[2].unit)
    over = range_of(new[2])
    now, before = response(*new, over), response(*old, over if comparable else None)
    where = f"{new[1].load}, {new[2].name}"
    text = f"{now} against {before} in {old[0].id}"
    flipped = now.value * before.value < 0
    if not comparable:
        if flipped and not _negligible(now, abs(now.value), (new[1],), 3 * now.u):
            return GateResult(rule="sign", where=where, message=f"the sign changed: {text}")
        return None
    change = abs(now.value - before.value)
    # A sign counts over the range in which the instrument was used so far: a session that hardly moves a
    # cell must not hide it.
    had = range_of(old[2])
    span = None if had is None else had[1] - had[0]
    if _negligible(now, change, (new[1], old[1]), 3 * math.hypot(now.u, before.u), span):
        return None
    if flipped:
        return GateResult(rule="sign", where=where, message=f"the sign changed: {text}")
    if change > SPAN * abs(before.value):
        ratio = now.value / before.value if before.value else math.inf
        size = f"by {100 * (ratio - 1):+.2f} %" if 0.1 < ratio < 10 else f"by a factor of {ratio:.4g}"
        return GateResult(rule="span", where=where, message=f"the span changed {size}: {text}")
    return None


def _negligible(
    now: Response, change: float, loads: tuple[LoadFit, ...], noise: float, used: float | None = None
) -> bool:
    """Tell whether a change of response [SI] is inside the tolerance, or inside its own uncertainty.

    The tolerance is the smallest that any of the records states, and never more than the span's own part of
    a largest load: a tolerance in a wrong unit must not switch the gate off. The uncertainty excuses a change
    no larger than that part either: a main response that is not known does not pass for an unchanged one.
    ``used`` is the indication's range in the earlier record.
    """
    scale = [SPAN * largest_load(load) for load in loads if not math.isnan(load.largest)]
    limits = [tolerance(load) for load in loads if not math.isnan(tolerance(load))] + scale
    # A legacy record has no range of its own: all that is left to compare is the response itself.
    if now.extent is None or not limits:
        return change <= noise
    moved = change * max(now.extent, used or 0.0)
    return moved <= min(limits) or (change <= noise and change * now.extent <= min(scale))


def layout(new: CalibrationRecord, old: CalibrationRecord) -> tuple[GateResult, ...]:
    """Return what changed in units, loads and indications: no fault by itself, and always told."""
    gate_results: list[GateResult] = []
    kinds = (
        ("load", {o.load: (o.unit, None) for o in new.loads}, {o.load: (o.unit, None) for o in old.loads}),
        (
            "indication",
            {c.name: (c.unit, c.column_unit) for c in new.cells},
            {c.name: (c.unit, c.column_unit) for c in old.cells},
        ),
    )
    for kind, now, before in kinds:
        for name, units in now.items():
            if name not in before:
                message = f"the {kind} is new: {old.id} does not have it"
                gate_results.append(
                    GateResult(rule="layout-changed", where=name, message=message, effect="tells")
                )
                continue
            unit_now, unit_before = (cell_unit[1] or cell_unit[0] for cell_unit in (units, before[name]))
            if same_unit(unit_now, unit_before) and same_unit(units[0], before[name][0]):
                continue
            message = f"the unit changed: {unit_now}, in {old.id} {unit_before}"
            if not same_dimension(units[0], before[name][0]):
                message += "; they measure different kinds of quantity, so that the span cannot be compared"
            gate_results.append(GateResult(rule="unit-changed", where=name, message=message, effect="tells"))
        for name in before:
            if name not in now:
                message = f"the {kind} of {old.id} is missing"
                gate_results.append(
                    GateResult(rule="layout-changed", where=name, message=message, effect="tells")
                )
    return tuple(gate_results)


def check_loads(record: CalibrationRecord, check: Table) -> tuple[GateResult, ...]:
    """Return the check loads that the record's coefficients miss by more than the tolerance."""
    failed: list[GateResult] = []
    for load in record.loads:
        fitted = load.at(check.columns(record.indications))
        off = fitted - check.column(load.load)
        tolerance = load.check_tolerance
        failed += [
            GateResult(
                rule="check-load",
                where=f"{load.load}, check row {row + 1}",
                message=f"off by {off[row]:+.4g} {load.unit}, tolerance {tolerance:.4g} {load.unit}",
            )
            for row in np.flatnonzero(np.abs(off) > tolerance)
        ]
    return tuple(failed)


def unverifiable(
    record: CalibrationRecord, check: Table | None, loads: Table | None = None
) -> tuple[str, ...]:
    """Return the terms that the check loads cannot verify, as "load: term".

    A term is verified where the check set has full column rank and the term's contribution over it,
    |c_i| dX_i, exceeds five tolerances: only then would a flipped or lost coefficient show. The intercept
    has no range; it is verified with the rank alone. Check loads that repeat rows of the fit, ``loads``, were
    not applied again and verify nothing.
    """
    names: list[str] = []
    if check is not None and loads is not None:
        check = _apart(record, check, loads)
    for load in record.loads:
        if check is None:
            names += [f"{load.load}: {term}" for term in load.terms]
            continue
        matrix = term_matrix(load.terms, check.columns(record.indications))
        lost = _undetermined(matrix)
        tolerance = load.check_tolerance
        effect = np.abs(load.coefficients) * np.ptp(matrix, axis=0)
        names += [
            f"{load.load}: {term}"
            for at, term in enumerate(load.terms)
            if lost[at] or (term != INTERCEPT and not effect[at] > VERIFIED * tolerance)
        ]
    return tuple(names)


def _apart(record: CalibrationRecord, check: Table, loads: Table) -> Table | None:
    """Return the check loads that are no copies of rows of the fit; None where all are."""
    names = [*record.indications, *(load.load for load in record.loads)]
    equations = [
        (load.terms, load.coefficients, load.residual_sd)
        for load in record.loads
        if load.residual_sd is not None
    ]
    scatter = own_scatter(record.indications, equations)
    apart = np.ones(check.rows, dtype=np.bool_)
    apart[list(copies(check.matrix(names), loads.matrix(names), scatter + [0.0] * len(record.loads)))] = False
    return check.only(apart) if apart.any() else None


def _undetermined(matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> list[bool]:
    """Return which terms take part in the null space of the check loads' scaled term matrix."""
    length = np.sqrt(np.einsum("ij,ij->j", matrix, matrix))
    _, values, right = np.linalg.svd(matrix / np.where(length == 0, 1.0, length))
    rank = int(np.sum(values > _RANK * values[0])) if len(values) else 0
    null = right[rank:]
    return [bool(np.any(np.abs(null[:, j]) > 1e-6)) or bool(length[j] == 0) for j in range(matrix.shape[1])]
