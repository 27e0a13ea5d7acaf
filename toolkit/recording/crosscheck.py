"""The second opinion: openpyxl reads the same members, and every number must be the same."""

from __future__ import annotations

import io
import warnings
from typing import Any

from toolkit.errors import CellError, UnreadableError
from toolkit.recording.archive import stored_archive
from toolkit.recording.cells import reference
from toolkit.recording.safe_open import Gated
from toolkit.recording.table import Table


def cross_check(gated: Gated, sheet: str, table: Table) -> None:
    """Compare a table as it was read (a grid, python-calamine) with openpyxl's reading of it.

    The full reader is used: openpyxl's read-only one believes ``<dimension>``.

    Raises
    ------
    CellError
        rule ``readers-differ``: the first cell that the two readers do not agree on
    UnreadableError
        rule ``readers-differ``: openpyxl cannot read the file at all
    """
    table = table.in_rows()
    second = _openpyxl_rows(gated, sheet)
    height = max(len(table.rows), len(second))
    width = max((len(row) for row in (*table.rows, *second)), default=0)
    for row in range(height):
        for column in range(width):
            first_value, two = _cell(table.rows, row, column), _cell(second, row, column)
            if first_value != two and not (
                first_value == "" and isinstance(two, str) and two.startswith("#")
            ):
                raise CellError(
                    f"cell {reference(row + 1, column + 1)}: two readers disagree",
                    where=f"{table.where}, cell {reference(row + 1, column + 1)}",
                    got=f"read {first_value!r}, openpyxl {two!r}"[:200],
                    expected="the same value from both",
                    next_step="look at that cell in the file; save a copy of it with Excel",
                    rule="readers-differ",
                )


def _openpyxl_rows(gated: Gated, sheet: str) -> list[tuple[Any, ...]]:
    import openpyxl

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about styles and extensions, which hold no values
            workbook = openpyxl.load_workbook(
                io.BytesIO(stored_archive(gated.members)), data_only=True, keep_links=False
            )
            return list(workbook[sheet].iter_rows(values_only=True))
    except Exception as error:
        raise UnreadableError(
            "the second reader cannot read the workbook",
            where=f"{gated.path}, sheet {sheet!r}",
            got=f"openpyxl: {error}"[:300],
            expected="a workbook that both readers read",
            next_step="open it in Excel and save it again",
            rule="readers-differ",
        ) from error


def _cell(rows: Any, row: int, column: int) -> Any:
    if row >= len(rows) or column >= len(rows[row]):
        return ""
    value = rows[row][column]
    return "" if value is None else value
