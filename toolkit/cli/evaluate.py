"""`toolkit evaluate`: forces and moments of a tire file on a grid."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, TypedDict

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import INTO_FILE, Output
from toolkit.findings import FindingEntry
from toolkit.lab.answers import Timing


class EvaluateAnswer(TypedDict):
    """A tire file, evaluated at every row of a grid."""

    tire: str
    model: Annotated[str, "mf52 or mf61"]
    axes: Annotated[str, "of the grid and of the forces"]
    angles: Annotated[str, "star: tan(alpha), sin(gamma); raw: the angles themselves"]
    units: Annotated[Mapping[str, str], "of the columns"]
    draft: bool
    rows: Annotated[list[Mapping[str, float | None]], "each by column"]
    out: Annotated[str | None, "file that was written"]
    findings: list[FindingEntry]
    timing: Timing


NAME = "evaluate"


@answers(EvaluateAnswer)
def command(
    tire: Annotated[Path, "A tire property file, MF 5.2 or 6.x.", ARGUMENT, Mark(metavar="TIRE.tir")],
    grid: Annotated[
        Path, "SA, FZ and optional IA, KAPPA, P, V with their units.", ARGUMENT, Mark(metavar="GRID.csv")
    ],
    axes: Annotated[str, "Axes of grid and answer: ISO-W, SAE, adapted-SAE, machine."] = "ISO-W",
    angles: Annotated[str, "star: tan(alpha), sin(gamma); raw: the angles, as MF-Tyre."] = "star",
    out: Annotated[Path | None, "Write the grid with FX, FY, MZ to a .csv.", INTO_FILE] = None,
    *,
    output: Output,
) -> int:
    """Evaluate a tire file at every row of a grid: FX, FY [N] and MZ [N*m] are added to it.

    Example: toolkit evaluate tire.tir grid.csv --axes SAE --out forces.csv
    """
    from toolkit.lab.answers import findings_text
    from toolkit.lab.tire_tests.evaluate import evaluate_grid, grid_rows, grid_text, grid_units, refuse_output
    from toolkit.listing import one_line
    from toolkit.publication import write_result
    from toolkit.tires.table import read_table
    from toolkit.tires.tir import read_tir

    table = read_table(grid, axes=axes, measured=False)
    if out is not None:
        refuse_output(out, (tire, grid))
    file = read_tir(tire)
    values, findings = evaluate_grid(file, table, angles=angles)  # type: ignore[arg-type]
    text = grid_text(table, values)
    if out is not None:
        write_result(out, text)
    printed = text.rstrip("\n") if out is None else f"{len(table.cells)} rows written to {one_line(out)}"
    if findings:
        printed += f"\n\n{findings_text(findings)}"
    payload = {
        "tire": str(tire),
        "model": "mf52" if file.version == "5.2" else "mf61",
        "axes": table.axes,
        "angles": angles,
        "units": grid_units(table),
        "draft": any(finding.rule == "draft" for finding in findings),
        "rows": grid_rows(table, values),
        "out": None if out is None else str(out),
        "findings": [finding.as_dict() for finding in findings],
        "timing": output.timing,
    }
    output.answer(payload, printed)
    return exit_code(findings)
