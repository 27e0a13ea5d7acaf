"""The budget of a report: what makes each characteristic uncertain, one column a source."""

from __future__ import annotations

from toolkit.report.design.blocks import Pieces

_COLUMNS = (
    # heading, cell, width in mm
    ("quantity", "quantity", 38),
    ("drum", "rotation", 13),
    ("unit", "unit", 15),
    ("calib.", "calibration", 11),
    ("cell zero", "zero", 11),
    ("SA zero", "SA_zero", 11),
    ("SA scale", "SA_scale", 11),
    ("load", "load_cell", 11),
    ("press.", "pressure", 11),
    ("rows", "repeatability", 11),
    ("fit", "fit", 11),
    ("u", "u", 12),
)


def budget_table(p: Pieces) -> str:
    """Return the table of standard uncertainties at the load of the summary."""
    head, cells, widths = zip(*_COLUMNS, strict=True)
    return p.table(
        "budget",
        "Standard uncertainties at the load of the summary by their source.",
        head,
        cells,
        widths,
        "lll" + "r" * (len(_COLUMNS) - 3),
    )
