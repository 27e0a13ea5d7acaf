"""The array that every computation is given and returns: float64, in SI."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Numbers in SI units; shapes stand in the docstrings."""

Arrays: TypeAlias = dict[str, Array]
"""Arrays by the names of what they hold: columns of a run, outputs of a simulation."""
