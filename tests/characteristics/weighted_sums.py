"""The uncertainty that a record gives a weighted sum of conditions, from the rows of `SharedErrors`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.characteristics.shared_errors import SharedErrors
    from toolkit.reduction.model import Condition


def calibration_u(shared: SharedErrors, channel: str, parts: Sequence[tuple[Condition, float]]) -> float:
    """Return the standard uncertainty [SI] of the sum of (condition, weight): fit and statements."""
    rows = shared.calibration_rows(channel, [condition for condition, _ in parts])
    return float(np.linalg.norm(rows @ np.array([weight for _, weight in parts])))
