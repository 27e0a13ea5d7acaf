"""The budget of a report: what makes each characteristic uncertain, and what the machine states."""

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
    """Return the table of standard uncertainties at the load of the summary, and what of them is stated."""
    head, cells, widths = zip(*_COLUMNS, strict=True)
    return p.table(
        "budget",
        "Standard uncertainties at the load of the summary by their source.",
        head,
        cells,
        widths,
        "lll" + "r" * (len(_COLUMNS) - 3),
    ) + p.table(
        "stated",
        "Stated standard uncertainties (GUM, type B) of what has no calibration record of its own.",
        ["quantity", "u", "its error is one of", "source"],
        ["quantity", "u", "common", "source"],
        [36, 30, 32, 68],
        "llll",
    )
