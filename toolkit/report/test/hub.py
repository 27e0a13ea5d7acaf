"""The hub's calibrated loads beside FY and MZ, as tables of a test's report."""

from __future__ import annotations

import math

from toolkit.report.content import Cell
from toolkit.report.document import Rows
from toolkit.report.style import Style
from toolkit.report.test.content import REPORT, ReportedTest


@REPORT.table(
    "hub_forces",
    "the hub's calibrated forces beside FY, one row a condition, SAE J670",
    """
    rotation|direction of rotation
    SA|measured slip angle|deg|.2f
    load|measured load|force|.0f
    FX ±|longitudinal force|force|.1f
    FZ ±|normal force by the hub's cells|force|.1f
    file|recording
    """,
)
def hub_forces(report: ReportedTest, _style: Style) -> Rows:
    """Return the conditions that were used, where the hub measures a force beside FY."""
    return _rows(report, ("FX", "FZ"))


@REPORT.table(
    "hub_moments",
    "the hub's calibrated moments beside MZ, one row a condition, SAE J670",
    """
    rotation|direction of rotation
    SA|measured slip angle|deg|.2f
    load|measured load|force|.0f
    MX ±|overturning moment|moment|.2f
    MY ±|rolling resistance moment|moment|.2f
    file|recording
    """,
)
def hub_moments(report: ReportedTest, _style: Style) -> Rows:
    """Return the conditions that were used, where the hub measures a moment beside MZ."""
    return _rows(report, ("MX", "MY"))


def _rows(report: ReportedTest, loads: tuple[str, ...]) -> Rows:
    for c in report.used:
        cells: dict[str, Cell] = {}
        for entry in c.hub:
            if entry.load in loads:
                cells |= {entry.load: entry.value, f"U_{entry.load}": 2 * entry.u}
        if cells:
            angle = math.degrees(c.SA)
            yield {"rotation": c.rotation, "SA": angle, "load": c.FZ, "file": c.file, **cells}
