"""The machine's own .xlsx as a run of a case: columns under the channels' symbols."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def read_workbook(path: Path) -> dict[str, NDArray[np.float64]]:
    """Return the workbook's columns, each under its header and under its symbol, in the file's units."""
    from toolkit.recording.read import read_table

    table = read_table(path)
    return table
