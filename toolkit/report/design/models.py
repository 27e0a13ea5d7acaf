"""The comparison of tire models in a report: kept only where it was asked for."""

# ruff: noqa: E501  lines of a template's text read best whole
from __future__ import annotations

from toolkit.report.design.blocks import Pieces, literal, paragraph, run

_COLUMNS = (
    # heading, cell, width in mm
    ("model", "model", 22),
    ("p, FY", "FY_parameters", 8),
    ("FY [%]", "FY_error", 12),
    ("floor [%]", "FY_floor", 12),
    ("left out [%]", "FY_left_out", 13),
    ("p, MZ", "MZ_parameters", 8),
    ("MZ [%]", "MZ_error", 12),
    ("floor [%]", "MZ_floor", 12),
    ("left out [%]", "MZ_left_out", 13),
    ("time [s]", "seconds", 11),
    ("conv.", "converged", 10),
    ("not determined", "not_determined", 33),
)
_WORDS = (
    "Tire models fitted to the same rows, those of the first direction of rotation. The error is "
    "100 √(Σ(model - measured)² / Σ measured²); the floor is the same for the measurements about their means in bins of "
    "0.25 deg and load, n/a where the bins hold too few rows; left out: every load predicted by a fit that never saw it. "
    "p counts the parameters fitted: those of magic_formula are of all its curves, one a load, and predict no other load. "
    "The smallest error over the rows fitted does not make the best model: parameters do that alone."
)


def models_section(p: Pieces) -> str:
    """Return heading, table and figures of the models, one block."""
    head, cells, widths = zip(*_COLUMNS, strict=True)
    return p.block(
        "tk:if.models",
        paragraph(run("Tire models side by side"), style="Heading2")
        + paragraph(literal(_WORDS), keep=True)
        + p.table("models", "Errors of the tire models.", head, cells, widths, "l" + "r" * 9 + "ll")
        + p.figure("models_fy", 150)
        + p.figure("models_mz", 150),
    )
