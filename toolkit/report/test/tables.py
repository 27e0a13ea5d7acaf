"""A test's tables: columns of the catalogue, rows of plain numbers in the report's units."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import tables
from toolkit.report.columns import TABLES, Column
from toolkit.report.content import Cell, Table
from toolkit.report.style import Style
from toolkit.report.test.characteristics import budget_rows, long_rows, wide_rows
from toolkit.report.test.models import model_rows
from toolkit.report.test.stated import stated_rows

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
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
        **{table.name: partial(wide_rows, result, table) for table in tables()},
        "budget": lambda: budget_rows(result, style),
        "stated": lambda: stated_rows(result.reduced.stated, style),
        "characteristics": lambda: long_rows(result, style),
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
