"""Printed digits of a column, or of a table of rows."""

from __future__ import annotations

import math

import numpy as np

from toolkit.recording.digits import half_last_places


def half_last_place(values) -> np.ndarray:
    """Half a last place by value, for a column (rows,) or a table (rows, columns)."""
    table = np.asarray(values, dtype=np.float64)
    return half_last_places(table.reshape(len(table), math.prod(table.shape[1:])).T.copy()).T.reshape(
        table.shape
    )
