"""A test's characteristics: the tables that the catalogue has columns of, and the values of the summary."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.characteristics.catalogue import columns, tables
from toolkit.characteristics.characteristic import COLUMNS as BUDGET
from toolkit.characteristics.characteristic import WideTable
from toolkit.characteristics.model import Row
from toolkit.characteristics.model import summary_estimates as estimates_of_summary
from toolkit.characteristics.model import summary_load as load_of_summary
from toolkit.estimate import Estimate, round_to_uncertainty
from toolkit.report.content import Cell
from toolkit.report.document import DeclaredTable, Rows
from toolkit.report.style import Style
from toolkit.report.test.content import REPORT, ReportedTest
from toolkit.report.vocabulary import QUANTITIES
from toolkit.units import printed

if TYPE_CHECKING:
    from toolkit.pipeline import TestResult

Cells = dict[str, Cell]


def put(cells: dict[str, Cell], name: str, estimate: Estimate | None, factor: float = 1.0) -> None:
    """Write an estimate and its expanded uncertainty, times an exact factor, into the cells of a row."""
    cells[name] = None if estimate is None else estimate.value * factor
    U = math.nan if estimate is None else estimate.expanded()[0] * factor
    cells[f"U_{name}"] = U if math.isfinite(U) else None


_HEADS = {
    "load": "load|load|force|.0f",
    "direction": "load|load|force|.0f\nrotation|direction of rotation",
    "angle": "rotation|direction of rotation\nload|load|force|.0f\nSA|slip angle|deg|.0f",
}


def wide_table(table: WideTable) -> DeclaredTable[ReportedTest]:
    """Return the declaration of a table with a column for each characteristic, and for its uncertainty."""
    lines = [
        f"{column.column_name} ±|{column.column_text}|{unit}|.{column.digits}f"
        for column in columns(table)
        for unit in [QUANTITIES.get(column.printed_unit, column.printed_unit)]
    ]
    return REPORT.table(table.name, table.text, "\n".join([_HEADS[table.scope], *lines]))(
        lambda report, _: wide_rows(report.result, table)
    )


def wide_rows(result: TestResult, table: WideTable) -> list[Cells]:
    """Return the rows of a table with a column for each characteristic.

    A load without any of them is left out; a direction is not.
    """
    declared = {column.name: column for column in columns(table)}
    lines: dict[tuple[float, str, float | None], Cells] = {}
    for row in result.characteristics.rows:
        if row.name not in declared:
            continue
        cells: Cells = {"load": row.load_N, "rotation": row.rotation}
        if row.SA_rad is not None:
            cells["SA"] = row.SA_rad / (math.pi / 180)
        cells = lines.setdefault((row.load_N, row.rotation, row.SA_rad), cells)
        declaration = declared[row.name]
        put(cells, declaration.column_name, row.estimate, declaration.factor)
    names = [declaration.column_name for declaration in declared.values()]
    return [
        cells
        for cells in lines.values()
        if table.scope != "load" or any(cells.get(name) is not None for name in names)
    ]


@REPORT.table(
    "characteristics",
    "every characteristic, one row each",
    """
    quantity|name of the characteristic
    rotation|direction of rotation, or both
    load|load|force|.0f
    value|value in the row's unit||.2f|U of U
    U|expanded uncertainty (95 %) in the row's unit||.2f|U of U
    k|coverage factor|1|.2f
    unit|unit of the row
    """,
)
def long_rows(report: ReportedTest, style: Style) -> Rows:
    """Return every characteristic that has a value, one row each, but for those at slip angles."""
    result, lines = report.result, list[Cells]()
    for table_column in (column for table in tables() if table.scope != "angle" for column in columns(table)):
        unit, factor = style.unit(table_column.printed_unit)
        scale = factor * table_column.factor
        for row in result.characteristics.of(table_column.name):
            if row.estimate is None:
                continue
            U, k = row.estimate.expanded()
            lines.append(
                {
                    "quantity": table_column.title,
                    "rotation": row.rotation,
                    "load": row.load_N,
                    "value": row.estimate.value * scale,
                    "U": U * scale if math.isfinite(U) else None,
                    "k": k if math.isfinite(k) else None,
                    "unit": printed(str(unit)),
                }
            )
    return lines


@REPORT.table(
    "budget",
    "standard uncertainties of each characteristic at the summary's load by their source, to two digits of "
    "their sum; a dash below its last place",
    "\n".join(
        [
            "quantity|name of the characteristic",
            "rotation|direction of rotation, or both",
            "unit|unit of the row",
            *(f"{column.name}|{column.text}" for column in BUDGET),
            "u|standard uncertainty of all",
        ]
    ),
)
def budget_rows(report: ReportedTest, style: Style) -> Rows:
    """Return the budget of each characteristic at the load of the summary."""
    result = report.result
    load = summary_load(result)
    return [
        _budget(row, style)
        for row in result.characteristics.rows
        if row.load_N == load and row.estimate is not None and row.SA_rad is None
    ]


def _budget(row: Row, style: Style) -> Cells:
    characteristic, sources = row.characteristic, dict(row.sources)
    unit, factor = style.unit(characteristic.printed_unit)
    factor *= characteristic.factor
    cells: Cells = {"quantity": characteristic.title, "rotation": row.rotation, "unit": printed(str(unit))}
    total = math.hypot(*sources.values()) * factor
    for column in BUDGET:
        part = math.hypot(*(sources.get(name, 0.0) for name in column.sources)) * factor
        cells[column.name] = _to_place(part, total, style)
    cells["u"] = _to_place(total, total, style)
    return cells


def _to_place(value: float, total: float, style: Style) -> str:
    """Return a part of a budget to the place of the second digit of its total; a dash below it."""
    if not total > 0:
        return "-"
    text = round_to_uncertainty(value, total)
    if not float(text):
        return "-"
    return style.decimal(text)


def summary_load(result: TestResult) -> float | None:
    """Return the load [N] of a report's summary: the one nearest the rated load, else the middle one."""
    return load_of_summary(result.characteristics, result.reduced.info.rated_load_N)


def summary_estimates(result: TestResult) -> dict[str, Estimate | None]:
    """Return the values of the summary by their names, in printed units; of directions the forward run."""
    return estimates_of_summary(result.characteristics, result.reduced.info.rated_load_N)


WIDE_TABLES = tuple(wide_table(table) for table in tables())
