"""A tire file on a grid: forces and moments of every row, in the grid's own axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.findings import Finding
    from toolkit.tires.slip import Angles
    from toolkit.tires.table import TireTable
    from toolkit.tires.tir import TirFile

COMPUTED = {"FX": "FX [N]", "FY": "FY [N]", "MZ": "MZ [N*m]"}


def evaluate_grid(
    file: TirFile, table: TireTable, *, angles: Angles
) -> tuple[dict[str, list[float]], tuple[Finding, ...]]:
    """Return FX, FY [N], MZ [N*m] of every row in the table's axes, and the findings."""
    from toolkit.calibration.records.use import DRAFT_MARK
    from toolkit.channels import signs
    from toolkit.findings import Finding
    from toolkit.tires.table_fit import condition_findings
    from toolkit.tires.tir_evaluate import evaluate_tir

    mark = file.comment(DRAFT_MARK)
    turn = signs(table.axes, "ISO-W")
    optional = {name: column for name in ("IA", "KAPPA", "P", "V") if (column := table.get(name)) is not None}
    forces, findings = evaluate_tir(
        file, SA=turn["SA"] * table["SA"], FZ=table["FZ"], angles=angles, **optional
    )
    # A grid may ask for any slip ratio, load and speed; angles and pressures of no tire are a wrong unit.
    findings = (*findings, *condition_findings(table, only=("P", "SA", "IA")))
    turned = forces.in_axes(table.axes)
    if mark is not None:
        findings = (*findings, Finding(rule="draft", where=file.where, message=mark, level="error"))
    replaced = [name for name in COMPUTED if table.get(name) is not None]
    if replaced:
        text = f"the grid's own {', '.join(replaced)} stay out: the columns of that name are the tire file's"
        findings = (
            *findings,
            Finding(rule="grid-columns", where=str(table.path), message=text, level="note"),
        )
    values = {"FX": turned.FX.tolist(), "FY": turned.FY.tolist(), "MZ": turned.MZ.tolist()}
    return values, findings


def grid_text(table: TireTable, values: dict[str, list[float]]) -> str:
    """Return the grid as CSV, its own cells as written, with FX, FY, MZ behind them."""
    columns = _columns_that_stay(table)
    lines = [",".join([table.header[i] for i in columns] + list(COMPUTED.values()))]
    for row, cells in enumerate(table.cells):
        numbers = [repr(values[name][row]) for name in COMPUTED]
        lines.append(",".join([cells[i] for i in columns] + numbers))
    return "\n".join(lines) + "\n"


def _columns_that_stay(table: TireTable) -> list[int]:
    return [i for i, (symbol, _) in enumerate(table.columns) if symbol not in COMPUTED]


def grid_units(table: TireTable) -> dict[str, str]:
    """Return the unit of every column that stays, as its header has it, and of the columns added."""
    stated = {
        table.columns[i][0]: table.header[i].partition("[")[2].partition("]")[0].strip()
        for i in _columns_that_stay(table)
    }
    return {**stated, "FX": "N", "FY": "N", "MZ": "N*m"}


def grid_rows(table: TireTable, values: dict[str, list[float]]) -> list[dict[str, float]]:
    """Return the rows as JSON values, by column."""
    columns = _columns_that_stay(table)
    return [
        {table.columns[i][0]: float(cells[i]) for i in columns}
        | {name: values[name][row] for name in COMPUTED}
        for row, cells in enumerate(table.cells)
    ]


def refuse_output(out: Path, originals: tuple[Path, ...]) -> None:
    """Refuse an output that is no .csv, or that would replace an input."""
    from toolkit.errors import OutputError
    from toolkit.files import same_file

    if out.suffix.lower() != ".csv":
        raise OutputError(
            "the output is a table", where="--out", got=out.name, expected="a name that ends in .csv",
            next_step="choose such a name", rule="output-name",
        )  # fmt: skip
    if any(same_file(out, original) for original in originals):
        raise OutputError(
            "the output would replace an input", where="--out", got=out, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
