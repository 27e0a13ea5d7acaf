"""The ten rows of Figure 4.4 as the thesis prints them, and the workbooks that are packaged of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.examples import NAMES
from toolkit.machine import load_machine
from toolkit.recording.labview import write_labview

SOURCE = (
    "Ten rows of a recording of the Michelin M-15, Figure 4.4 of the source document (the thesis); "
    "rows 2, 3, 102, 103, 202, 203, 302, 303, 402, 403 of the original spreadsheet"
)

SYMBOLS = ("FZ", "D52", "D51", "E5", "SA", "FY", "MZ")
"""In the order of the file; lbf, lbf, lbf, lbf, deg, lbf, lbf*ft."""

SPREADSHEET_ROWS = (2, 3, 102, 103, 202, 203, 302, 303, 402, 403)

ROWS = (
    (248.8146, 86.06072, 98.59261, -182.415, -0.30197, 371.3554, -0.35393),
    (250.0319, 86.05929, 98.59098, -182.414, -0.30197, 371.3506, -0.35392),
    (587.4521, 178.8015, 211.9537, -289.719, -0.30180, 686.6269, -2.83066),
    (586.4783, 178.8021, 211.9551, -289.720, -0.30180, 686.6300, -2.83078),
    (835.0397, 246.0777, 317.8654, -379.184, -0.30167, 950.8327, -8.31079),
    (834.5528, 246.0772, 317.8647, -379.184, -0.30168, 950.8312, -8.31077),
    (1112.572, 287.6001, 413.9110, -449.088, -0.30804, 1159.511, -16.4666),
    (1111.841, 287.5996, 413.9121, -449.088, -0.30804, 1159.512, -16.4669),
    (1376.714, 300.6323, 495.9810, -497.590, -0.30607, 1303.954, -27.1016),
    (1375.496, 300.6326, 495.9822, -497.591, -0.30607, 1303.956, -27.1018),
)


def write_fig4_4(folder: Path) -> tuple[Path, ...]:
    """Write the ten rows as real workbooks in the machine's own layout; return the files."""
    values = np.array(ROWS)
    columns = {symbol: values[:, index] for index, symbol in enumerate(SYMBOLS)}
    for name in NAMES:
        write_labview(folder / name, load_machine("m15"), columns, simulated=False, title=SOURCE)
    return tuple(folder / name for name in NAMES)
