"""`toolkit evaluate`: forces and moments of a tire file on a grid."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Json, Quiet, answer, exit_code, finding_lines

if TYPE_CHECKING:
    from toolkit.findings import Finding
    from toolkit.tires.slip import Angles
    from toolkit.tires.table import TireTable

NAME = "evaluate"
_MADE = {"FX": "FX [N]", "FY": "FY [N]", "MZ": "MZ [N*m]"}


def command(
    tire: Annotated[Path, typer.Argument(metavar="TIRE.tir", help="A tire property file, MF 5.2 or 6.x.")],
    grid: Annotated[
        Path, typer.Argument(metavar="GRID.csv", help="SA, FZ and optional IA, KAPPA, P, V with their units.")
    ],
    axes: Annotated[
        str, typer.Option("--axes", help="Axes of grid and answer: ISO-W, SAE, adapted-SAE, machine.")
    ] = "ISO-W",
    angles: Annotated[
        str, typer.Option("--angles", help="star: tan(alpha), sin(gamma); raw: the angles, as MF-Tyre.")
    ] = "star",
    out: Annotated[
        Path | None, typer.Option("--out", help="Write the grid with FX, FY, MZ to a .csv.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Evaluate a tire file at every row of a grid: FX, FY [N] and MZ [N*m] are added to it.

    Example: toolkit evaluate tire.tir grid.csv --axes SAE --out forces.csv
    """
    from toolkit.files import write_atomic
    from toolkit.tires.table import read_table
    from toolkit.tires.tir import read_tir

    started = time.perf_counter()
    table = read_table(grid, axes=axes, required=("SA", "FZ"), measured=False)
    if out is not None:
        _refuse_output(out, (tire, grid))
    file = read_tir(tire)
    values, findings = evaluate_grid(file, table, angles=angles)  # type: ignore[arg-type]
    text = grid_text(table, values)
    if out is not None:
        write_atomic(out, text)
    shown = text.rstrip("\n") if out is None else f"{len(table.cells)} rows written to {out}"
    if findings:
        shown += "\n\nfindings (toolkit explain RULE tells more):\n" + "\n".join(finding_lines(findings))
    payload = {
        "tire": str(tire),
        "model": "mf52" if file.version == "5.2" else "mf61",
        "axes": table.axes,
        "angles": angles,
        "units": {**_units(table), "FX": "N", "FY": "N", "MZ": "N*m"},
        "draft": any(one.rule == "draft" for one in findings),
        "rows": _rows(table, values),
        "out": None if out is None else str(out),
        "findings": [finding.as_dict() for finding in findings],
        "timing": {"seconds": time.perf_counter() - started},
    }
    answer(payload, shown, as_json=json, quiet=quiet)
    return exit_code(findings)


def evaluate_grid(
    file: Any, table: TireTable, *, angles: Angles
) -> tuple[dict[str, list[float]], tuple[Finding, ...]]:
    """Return FX, FY [N], MZ [N*m] of every row in the table's axes, and the findings."""
    from toolkit.calibration.records.use import DRAFT_MARK
    from toolkit.channels import signs
    from toolkit.findings import Finding
    from toolkit.tires.tir_evaluate import evaluate_tir

    mark = file.comment(DRAFT_MARK)
    turn = signs(table.axes, "ISO-W")
    optional = {name: column for name in ("IA", "KAPPA", "P", "V") if (column := table.get(name)) is not None}
    made, findings = evaluate_tir(
        file, SA=turn["SA"] * table["SA"], FZ=table["FZ"], angles=angles, **optional
    )
    if mark is not None:
        findings = (*findings, Finding(rule="draft", where=file.where, message=mark, level="error"))
    replaced = [name for name in _MADE if table.get(name) is not None]
    if replaced:
        text = f"the grid's own {', '.join(replaced)} stay out: the columns of that name are the tire file's"
        findings = (
            *findings,
            Finding(rule="grid-columns", where=str(table.path), message=text, level="note"),
        )
    values = {
        "FX": made.FX.tolist(),
        "FY": (turn["FY"] * made.FY).tolist(),
        "MZ": (turn["MZ"] * made.MZ).tolist(),
    }
    return values, findings


def grid_text(table: TireTable, values: dict[str, list[float]]) -> str:
    """Return the grid as CSV, its own cells as written, with FX, FY, MZ behind them."""
    kept = _kept(table)
    lines = [",".join([table.header[i] for i in kept] + list(_MADE.values()))]
    for row, cells in enumerate(table.cells):
        numbers = [repr(values[name][row]) for name in _MADE]
        lines.append(",".join([cells[i] for i in kept] + numbers))
    return "\n".join(lines) + "\n"


def _kept(table: TireTable) -> list[int]:
    return [i for i, (symbol, _) in enumerate(table.columns) if symbol not in _MADE]


def _units(table: TireTable) -> dict[str, str]:
    return {
        table.columns[i][0]: table.header[i].partition("[")[2].partition("]")[0].strip() for i in _kept(table)
    }


def _rows(table: TireTable, values: dict[str, list[float]]) -> list[dict[str, float]]:
    kept = _kept(table)
    return [
        {table.columns[i][0]: float(cells[i]) for i in kept} | {name: values[name][row] for name in _MADE}
        for row, cells in enumerate(table.cells)
    ]


def _refuse_output(out: Path, originals: tuple[Path, ...]) -> None:
    from toolkit.errors import OutputError

    if out.suffix.lower() != ".csv":
        raise OutputError(
            "the output is a table", where="--out", got=out.name, expected="a name that ends in .csv",
            next_step="choose such a name", rule="output-name",
        )  # fmt: skip
    if any(out.resolve() == one.resolve() for one in originals):
        raise OutputError(
            "the output would replace an input", where="--out", got=out, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
