"""A test's tables: columns of the catalogue, rows of plain numbers in the report's units."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from toolkit.estimate import round_to_uncertainty
from toolkit.report.columns import TABLES, Column
from toolkit.report.content import Cell, Table
from toolkit.report.style import Style
from toolkit.report.test.models import model_rows
from toolkit.report.test.stated import stated_rows

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.estimate import Estimate
    from toolkit.findings import Finding
    from toolkit.pipeline import TestResult
    from toolkit.recording.details import Opinion
    from toolkit.tires.comparison import Comparison

_DEG = math.pi / 180
Row = dict[str, Cell]


def build_tables(
    result: TestResult,
    record: CalibrationRecord | None,
    findings: Sequence[Finding],
    style: Style,
    opinions: Sequence[Opinion] = (),
    comparison: Comparison | None = None,
) -> dict[str, Table]:
    """Return every table of the catalogue; one without data has no rows."""
    makers: dict[str, Callable[[], list[Row]]] = {
        "results": lambda: _results(result),
        "stiffness": lambda: _stiffness(result),
        "pull": lambda: _pull(result, _PULL),
        "pull_thesis": lambda: _pull(result, _THESIS),
        "at_angles": lambda: _at_angles(result),
        "budget": lambda: _budget(result, style),
        "stated": lambda: stated_rows(result.reduced.stated, style),
        "characteristics": lambda: _characteristics(result, style),
        "fits": lambda: _fits(result, style),
        "models": lambda: model_rows(comparison),
        "calibration": lambda: _calibration(record),
        "acquisition": lambda: _acquisition(result),
        "findings": lambda: [one.as_dict() for one in findings],  # type: ignore[misc]
        "opinions": lambda: [{"statement": one.statement, "basis": one.basis} for one in opinions],
        "files": lambda: _files(result),
    }
    return {name: _table(name, makers[name](), style) for name in TABLES}


def _table(name: str, rows: list[Row], style: Style) -> Table:
    columns, factors = [], []
    for column in TABLES[name][1]:
        unit, factor = style.unit(column.unit)
        digits = style.digits(f"{name}.{column.name}", column.name, unit)
        spec = f".{digits}f" if digits is not None and column.spec.endswith("f") else column.spec
        # Decimals by the column's full name rule; those by unit are for numbers without an uncertainty.
        own = column.U if style.digits(f"{name}.{column.name}") is None else None
        columns.append(replace(column, unit=unit, spec=spec, U=own))
        factors.append(factor)
    cells = tuple(
        tuple(_scaled(row.get(c.name), c, f) for c, f in zip(columns, factors, strict=True)) for row in rows
    )
    return Table(name=name, columns=tuple(columns), rows=cells)


def _scaled(cell: Cell, column: Column, factor: float) -> Cell:
    return cell if cell is None or isinstance(cell, str) or column.quantity is None else cell * factor


def _put(row: Row, name: str, estimate: Estimate | None, factor: float = 1.0) -> None:
    row[name] = None if estimate is None else estimate.value * factor
    U = math.nan if estimate is None else estimate.expanded()[0] * factor
    row[f"U_{name}"] = U if math.isfinite(U) else None


def _results(result: TestResult) -> list[Row]:
    u = {(p.file, p.first_row): p for p in result.characteristics.points}
    return [
        {
            "rotation": c.rotation,
            "SA": c.SA / _DEG,
            "FZ": c.FZ,
            "FY": c.FY,
            "U_FY": 2 * u[c.file, c.first_row].u_FY,
            "MZ": c.MZ,
            "U_MZ": 2 * u[c.file, c.first_row].u_MZ,
            "file": c.file,
        }
        for c in result.reduced.used()
    ]


_STIFFNESS = ("cornering_secant", "cornering_slope", "aligning_secant", "aligning_slope")
_PULL = ("conicity", "plysteer", "CRAT", "PRAT", "PRAT_at_FY_zero")
_THESIS = (
    "thesis_CRAT",
    "thesis_PRAT",
    "thesis_PRAT_at_FY_zero",
    "residual_forward",
    "residual_reverse",
)


def _stiffness(result: TestResult) -> list[Row]:
    rows = []
    for one in result.characteristics.stiffness:
        row: Row = {"load": one.load_N, "rotation": one.rotation}
        for name in _STIFFNESS:
            kind, way = name.split("_")
            _put(row, name, getattr(one, f"{way}_{kind}"), _DEG)
        rows.append(row)
    return rows


def _pull(result: TestResult, names: tuple[str, ...]) -> list[Row]:
    rows = []
    for one in result.characteristics.pull:
        if all(getattr(one, name) is None for name in names):
            continue
        row: Row = {"load": one.load_N}
        for name in names:
            _put(row, name, getattr(one, name))
        rows.append(row)
    return rows


_LONG = {
    "cornering_secant": ("cornering stiffness, ±1 deg secant", "N/deg"),
    "cornering_slope": ("cornering stiffness, slope at 0 deg", "N/deg"),
    "aligning_secant": ("aligning stiffness, ±1 deg secant", "N*m/deg"),
    "aligning_slope": ("aligning stiffness, slope at 0 deg", "N*m/deg"),
    "conicity": ("conicity", "N"),
    "plysteer": ("plysteer", "N"),
    "CRAT": ("CRAT", "N*m"),
    "PRAT": ("PRAT at 0 deg", "N*m"),
    "PRAT_at_FY_zero": ("PRAT at FY = 0", "N*m"),
    "thesis_CRAT": ("CRAT, the thesis's formula", "N*m"),
    "thesis_PRAT": ("PRAT, the thesis's formula", "N*m"),
    "thesis_PRAT_at_FY_zero": ("PRAT at FY = 0, the thesis's formula", "N*m"),
    "residual_forward": ("residual aligning torque, forward", "N*m"),
    "residual_reverse": ("residual aligning torque, reverse", "N*m"),
}


def _at_angles(result: TestResult) -> list[Row]:
    rows = []
    for one in result.characteristics.at_angles:
        row: Row = {"rotation": one.rotation, "load": one.load_N, "SA": one.SA_rad / _DEG}
        _put(row, "FY", one.FY)
        _put(row, "MZ", one.MZ)
        rows.append(row)
    return rows


# Columns of the budget table and the sources that they hold.
_SOURCES = {
    "calibration": ("calibration",),
    "zero": ("cell zero", "tare"),
    "SA_zero": ("slip angle zero",),
    "SA_scale": ("slip angle scale",),
    "load_cell": ("load",),
    "pressure": ("pressure",),
    "repeatability": ("repeatability", "slip angle scatter"),
    "fit": ("fit",),
}


def summary_load(result: TestResult) -> float | None:
    """Return the load [N] of a report's summary: the one nearest the rated load, else the middle one."""
    chars, rated = result.characteristics, result.reduced.info.rated_load_N
    loads = sorted({one.load_N for one in chars.stiffness} | {one.load_N for one in chars.pull})
    if not loads:
        return None
    return min(loads, key=lambda one: abs(one - rated)) if rated else loads[len(loads) // 2]


def _budget(result: TestResult, style: Style) -> list[Row]:
    rows: list[Row] = []
    load = summary_load(result)
    for one in result.characteristics.budgets:
        if one.load_N != load:
            continue
        way, _, kind = one.name.partition("_")
        text, unit = _LONG[f"{kind}_{way}" if way in ("secant", "slope") else one.name]
        shown, factor = style.unit(unit)
        factor *= _DEG if "/" in unit else 1.0
        sources = dict(one.sources)
        row: Row = {"quantity": text, "rotation": one.rotation, "unit": str(shown).replace("*", "·")}
        total = math.hypot(*sources.values()) * factor
        for column, names in _SOURCES.items():
            part = math.hypot(*(sources.get(name, 0.0) for name in names)) * factor
            row[column] = _to_place(part, total, style)
        row["u"] = _to_place(total, total, style)
        rows.append(row)
    return rows


def _to_place(value: float, total: float, style: Style) -> str:
    """Return a part of a budget to the place of the second digit of its total; a dash below it."""
    if not total > 0:
        return "-"
    text = round_to_uncertainty(value, total)
    if not float(text):
        return "-"
    return text.replace(".", ",") if style.decimal_comma else text


def _characteristics(result: TestResult, style: Style) -> list[Row]:
    rows: list[Row] = []
    for name, (text, unit) in _LONG.items():
        shown, factor = style.unit(unit)
        kind, _, way = name.partition("_")
        stiff = name in _STIFFNESS
        items: Sequence[Any] = result.characteristics.stiffness if stiff else result.characteristics.pull
        for one in items:
            found: Estimate | None = getattr(one, f"{way}_{kind}" if stiff else name)
            if found is None:
                continue
            U, k = found.expanded()
            scale = factor * (_DEG if stiff else 1.0)
            rows.append(
                {
                    "quantity": text,
                    "rotation": one.rotation if stiff else "both",
                    "load": one.load_N,
                    "value": found.value * scale,
                    "U": U * scale if math.isfinite(U) else None,
                    "k": k if math.isfinite(k) else None,
                    "unit": str(shown).replace("*", "·"),
                }
            )
    return rows


def _fits(result: TestResult, style: Style) -> list[Row]:
    rows: list[Row] = []
    for channel, unit in (("FY", "N"), ("MZ", "N*m")):
        factor = style.unit(unit)[1]
        for one in result.characteristics.fits:
            fit = getattr(one, channel)
            if fit is None:
                continue
            row: Row = {
                "channel": channel,
                "rotation": one.rotation,
                "load": one.load_N,
                "error": fit.error_percent,
                "floor": fit.scatter_floor_percent,
            }
            for p in fit.parameters:
                scale = factor if p.name in ("D", "Sv") else 1 / _DEG if p.name == "Sh" else 1.0
                row[p.name] = p.value * scale
                row[f"u_{p.name}"] = None if p.standard_error is None else p.standard_error * scale
            rows.append(row)
    return rows


def _calibration(record: CalibrationRecord | None) -> list[Row]:
    rows: list[Row] = []
    units = dict(zip(record.indications, record.indication_units, strict=True)) if record else {}
    for load in record.loads if record else ():
        for i, term in enumerate(load.terms):
            unit = units.get(term)
            rows.append(
                {
                    "load": load.load,
                    "term": term,
                    "coefficient": load.coefficients[i],
                    "issued": load.issued[i] if i < len(load.issued) else None,
                    "standard_error": math.sqrt(load.covariance[i][i]) if i < len(load.covariance) else None,
                    "unit": (f"{load.unit} per {unit}" if unit else load.unit).replace("*", "·"),
                }
            )
    return rows


def _acquisition(result: TestResult) -> list[Row]:
    worst: dict[str, dict[str, float]] = {}
    for c in result.reduced.used():
        row = worst.setdefault(c.file, {})
        for name, theirs, ours in (
            ("FY_difference", c.FY_file, c.FY),
            ("MZ_difference", c.MZ_file, c.MZ),
        ):
            if theirs is not None:
                row[name] = max(row.get(name, 0.0), abs(theirs - ours))
    return [{"file": file, **row} for file, row in worst.items() if row]


def _files(result: TestResult) -> list[Row]:
    seen = {c.file: c for c in result.reduced.conditions}
    return [{"file": c.file, "rotation": c.rotation, "sha256": c.file_sha256} for c in seen.values()]
