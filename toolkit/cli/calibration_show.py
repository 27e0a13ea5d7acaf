"""What `toolkit calibration show` tells of a record, beside its state: cells, loads, files, check loads."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from toolkit.cli.console import table
from toolkit.estimate import round_uncertainty

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord, LoadFit


def described(record: CalibrationRecord, registry: Path) -> tuple[dict[str, Any], list[str]]:
    """Return a record as JSON values, and as lines of text. ``registry`` is the registry's folder."""
    cells = [
        {"name": c.name, "unit": c.unit, "serial": c.serial, "minimum": c.minimum, "maximum": c.maximum}
        for c in record.cells
    ]
    rows = [
        [c.name, c.unit, c.serial or "not stated", _range(c.minimum, c.maximum, c.unit)] for c in record.cells
    ]
    lines = ["", table(["indication", "unit", "serial", "range"], rows, align="<<<<")]
    misses = _check_misses(record, registry)
    loads: dict[str, Any] = {}
    for one in record.loads:
        errors = one.standard_errors or (None,) * len(one.terms)
        loads[one.load] = {
            "unit": one.unit,
            "coefficients": dict(zip(one.terms, one.coefficients, strict=True)),
            "issued": dict(zip(one.terms, one.issued, strict=True)),
            "standard_errors": dict(zip(one.terms, errors, strict=True)) if one.covariance else None,
            "covariance_model": one.covariance_model,
            "scatter": None if one.scatter is None else asdict(one.scatter),
            "residual_sd": one.residual_sd,
            "dof": one.dof,
            "n": one.n,
            "method": one.method,
            "minimum": one.minimum,
            "maximum": one.maximum,
            "check_tolerance": one.tolerance,
            "check_max": misses.get(one.load),
        }
        terms = [
            [term, repr(c), repr(i), "-" if u is None else round_uncertainty(u)]
            for term, c, i, u in zip(one.terms, one.coefficients, one.issued, errors, strict=True)
        ]
        lines += [
            "",
            f"{one.load} [{one.unit}]",
            table(["term", "coefficient", "issued", "std error"], terms),
        ]
        lines += _figures(one, misses.get(one.load))
    data = [{"role": d.role, "file": d.file, "sha256": d.sha256} for d in record.data]
    lines += ["", *(f"{d.role:<9}{d.file}  {d.sha256[:12]}" for d in record.data)]
    payload = {
        "zero": record.zero,
        "indication_units": dict(zip(record.indications, record.indication_units, strict=True)),
        "indications": cells,
        "loads": loads,
        "data": data,
    }
    return payload, lines


def _figures(one: LoadFit, miss: float | None) -> list[str]:
    if one.n is None or one.residual_sd is None:
        return ["a legacy import: no data, no residuals, no range"]
    lines = [
        f"{one.method}, {one.n} rows, {one.dof} degrees of freedom, "
        f"range {_range(one.minimum, one.maximum, one.unit)}, residual sd {one.residual_sd:.4g} {one.unit}"
    ]
    lines.append(f"standard errors by: {one.covariance_model}")
    if one.scatter_words is not None:
        lines.append(one.scatter_words)
    if one.tolerance is not None:
        told = "no check loads" if miss is None else f"check loads off by at most {miss:.4g} {one.unit}"
        lines.append(f"{told}, tolerance {one.tolerance:.4g} {one.unit}")
    return lines


def _check_misses(record: CalibrationRecord, registry: Path) -> dict[str, float]:
    from toolkit.calibration.registry.stored import stored_check
    from toolkit.calibration.terms import term_matrix

    check = stored_check(registry, record)
    if check is None:
        return {}
    columns = check.columns(record.indications)
    return {
        one.load: float(
            abs(term_matrix(one.terms, columns) @ one.coefficients - check.column(one.load)).max()
        )
        for one in record.loads
    }


def _range(low: float | None, high: float | None, unit: str) -> str:
    return "not known" if low is None or high is None else f"{low:.6g} to {high:.6g} {unit}"
