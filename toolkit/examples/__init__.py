"""Examples that come with the package: a real recording, and plans for the virtual machine.

The recording is ten rows of the M-15, as printed in Figure 4.4 of the source document. The acquisition
program computed the two last columns with a calibration whose E5 terms were negative. The figure shows two
rows of each of the five load blocks of the 0 deg step; the measured slip angle is -0.30 deg.
"""

from __future__ import annotations

from pathlib import Path

NAMES = ("M15_fig4_4.xlsx", "M15_fig4_4")
"""The same workbook twice: the recordings of the source document have no extension."""


def packaged_fig4_4() -> tuple[Path, Path]:
    """Return the packaged recording with and without a file extension."""
    folder = Path(__file__).parent / "fig4_4"
    return folder / NAMES[0], folder / NAMES[1]
