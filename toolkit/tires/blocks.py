"""Load blocks of a table: the gaps in the sorted loads, not a list of nominal ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Gaps are taken relative to the load above them: the spread within a block grows with the load.
_SEPARATE = 0.04  # a smaller gap never parts two blocks
_CONTRAST = 2.5  # between the smallest gap that parts blocks and the largest within one
_RESOLVED = 0.008  # gaps below this are all alike


def load_blocks(load: NDArray[np.float64]) -> tuple[NDArray[np.intp], ...]:
    """Return the rows of each load block, ascending in load, rows in their order.

    Parameters
    ----------
    load : (rows,) N, not negative

    The sorted loads' gaps fall into large ones (between blocks) and small ones (within); the cut is where
    the ratio of neighbouring gaps is largest. Without a clear cut there is one block.

    >>> [block.tolist() for block in load_blocks(np.array([1000.0, 2000.0, 1010.0, 1995.0]))]
    [[0, 2], [1, 3]]
    """
    order = np.argsort(load, kind="stable")
    rising = load[order]
    if len(load) < 2 or rising[-1] <= 0:
        return (np.arange(len(load)),)
    gaps = np.diff(rising) / np.maximum(rising[1:], 1e-9 * rising[-1])
    falling = np.sort(gaps)[::-1]
    following = np.maximum(np.append(falling[1:], 0.0), _RESOLVED)
    contrast = np.where(falling >= _SEPARATE, falling / following, 0.0)
    best = int(np.argmax(contrast))
    if contrast[best] < _CONTRAST:
        return (np.arange(len(load)),)
    cuts = np.flatnonzero(gaps >= falling[best]) + 1
    return tuple(np.sort(rows) for rows in np.split(order, cuts))
