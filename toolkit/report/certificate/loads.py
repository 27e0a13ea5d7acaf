"""The results of every load: equation, residuals, uncertainty over the range, check loads, adjustment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.terms import INTERCEPT, parse_term
from toolkit.calibration.uncertainty.budget import calibration_budget, predict
from toolkit.calibration.uncertainty.common_errors import standard_errors
from toolkit.report.certificate.model import Adjustment, CheckLine, LoadResult, TermLine
from toolkit.report.certificate.statements import decide

if TYPE_CHECKING:
    from toolkit.calibration.control.as_found import AsFound
    from toolkit.calibration.records.record import CalibrationRecord, LoadFit
    from toolkit.calibration.session.table import Table
    from toolkit.calibration.uncertainty.model import Budget


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundSession:
    """An as-found result, with the record of its session and that session's loads, in the record's units."""

    result: AsFound
    session: CalibrationRecord
    loads: Table
    check: Table | None


def load_results(
    record: CalibrationRecord,
    loads: Table,
    check: Table | None,
    *,
    rule: str | None,
    unverifiable: tuple[str, ...],
    found: FoundSession | None,
    as_left: bool,
) -> tuple[LoadResult, ...]:
    """Return the results of every load of a checked record.

    Parameters
    ----------
    loads, check : its reference and check loads, in its units
    rule : decision rule, None where none was agreed
    unverifiable : terms as "load: term"
    found : what the as-found session found by the record in force before, where that is known
    as_left : the record is of the session after the adjustment
    """
    return tuple(
        _load(record, load, loads, check, rule, unverifiable, found, as_left) for load in record.loads
    )


def _load(
    record: CalibrationRecord,
    load: LoadFit,
    loads: Table,
    check: Table | None,
    rule: str | None,
    unverifiable: tuple[str, ...],
    session: FoundSession | None,
    as_left: bool,
) -> LoadResult:
    reference = loads.column(load.load)
    fitted = load.at(loads.columns(record.indications))
    residuals = fitted - reference
    tolerance = load.check_tolerance
    checks = () if check is None else _checks(record, load, loads, check, rule, tolerance)
    errors = standard_errors(record, load.load)
    return LoadResult(
        fit=load,
        terms=tuple(
            TermLine(term=t, full=c, issued=i, standard_error=u, unit=_term_unit(record, load, t))
            for t, c, i, u in zip(load.terms, load.coefficients, load.issued_texts, errors, strict=True)
        ),
        tolerance=tolerance,
        references=tuple(reference.tolist()),
        residuals=tuple(residuals.tolist()),
        full_scale=calibration_budget(record, loads, check, load.load),
        range=tuple(
            calibration_budget(record, loads, check, load.load, at)
            for at in steps(float(reference.min()), float(reference.max()))
        ),
        checks=checks,
        adjustment=_adjustment(
            load, session, _left(record, load, loads, check, residuals, checks) if as_left else None
        ),
        unverifiable=tuple(
            name.partition(": ")[2] for name in unverifiable if name.partition(": ")[0] == load.load
        ),
    )


def steps(low: float, high: float) -> tuple[float, ...]:
    """Return the loads at which the uncertainty is told: ends, halves and zero, rising.

    >>> steps(-10.0, 20.0), steps(2.0, 20.0)
    ((-10.0, -5.0, 0.0, 10.0, 20.0), (2.0, 5.0, 10.0, 15.0, 20.0))
    """
    if low < 0 < high:
        return low, low / 2, 0.0, high / 2, high
    if low >= 0:
        return low, *(q * high for q in (0.25, 0.5, 0.75) if q * high > low), high
    return low, *(q * low for q in (0.75, 0.5, 0.25) if q * low < high), high


def _checks(
    record: CalibrationRecord, load: LoadFit, loads: Table, check: Table, rule: str | None, tolerance: float
) -> tuple[CheckLine, ...]:
    lines = []
    cells = check.matrix(record.indications).tolist()
    for row, (point, reference) in enumerate(zip(cells, check.column(load.load).tolist(), strict=True), 1):
        prediction = predict(
            record, loads, check, load.load, dict(zip(record.indications, point, strict=True))
        )
        result, uncertainty = prediction.budget.at, prediction.budget
        stated = rule is not None and not prediction.beyond
        lines.append(
            CheckLine(
                row=row,
                reference=reference,
                result=result,
                uncertainty=uncertainty,
                beyond=prediction.beyond,
                verdict=decide(rule, result - reference, tolerance, uncertainty.U)
                if stated and rule
                else None,
            )
        )
    return tuple(lines)


def _left(
    record: CalibrationRecord,
    load: LoadFit,
    loads: Table,
    check: Table | None,
    residuals: Array,
    checks: tuple[CheckLine, ...],
) -> tuple[float, Budget]:
    """Return the largest deviation as left and its uncertainty: of the check loads, else of the residuals."""
    if checks:
        worst = max(checks, key=lambda line: abs(line.deviation))
        return worst.deviation, worst.uncertainty
    row = int(np.abs(residuals).argmax())
    at = float(loads.column(load.load)[row])
    return float(residuals[row]), calibration_budget(record, loads, check, load.load, at)


def _adjustment(
    load: LoadFit, session: FoundSession | None, as_left: tuple[float, Budget] | None
) -> Adjustment | None:
    deviation = next((o for o in session.result.loads if o.load == load.load), None) if session else None
    if deviation is None or session is None or session.result.record is None:
        return None
    # The item's deviation under the reference is judged by what the as-found session knows of both: the
    # coefficients of the record in force are a given there, and have no share in it.
    at = deviation.reference[deviation.worst_row - 1]
    return Adjustment(
        found_by=session.result.record,
        as_found=deviation.max_error,
        found=calibration_budget(session.session, session.loads, session.check, load.load, at),
        as_left=None if as_left is None else as_left[0],
        left=None if as_left is None else as_left[1],
    )


def _term_unit(record: CalibrationRecord, load: LoadFit, term: str) -> str:
    if term == INTERCEPT:
        return load.unit
    units = record.units
    parsed = parse_term(term)
    factors = [f"({units[name]})" + (f"^{power}" if power > 1 else "") for name, power in parsed.powers]
    factors += [f"({units[name]})" for name in parsed.absolutes]
    return f"{load.unit}/" + (factors[0] if len(factors) == 1 else "(" + "*".join(factors) + ")")
