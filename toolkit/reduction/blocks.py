"""Load blocks: the runs of rows at one vertical load."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# A jump is larger than the row-to-row noise and than a small part of the largest load. The upper limit
# keeps a file with one row a load in five blocks: there every step is a jump and noise cannot be seen.
_NOISE_FACTOR = 8.0
_LEAST_JUMP = 0.02
_LARGEST_JUMP = 0.08


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Rows ``start`` to ``stop`` (0-based, stop excluded) at one load; ``mean_FZ`` [N]."""

    start: int
    stop: int
    mean_FZ: float

    @property
    def rows(self) -> slice:
        """The block as a slice of a recording's arrays."""
        return slice(self.start, self.stop)

    @property
    def n(self) -> int:
        """Number of rows."""
        return self.stop - self.start


def find_blocks(FZ: NDArray[np.float64]) -> tuple[Block, ...]:
    """Split rows where the load jumps.

    Parameters
    ----------
    FZ : (rows,) load [N], in the order of recording

    Returns
    -------
    blocks in the order of recording; they cover every row, a tare block included

    Examples
    --------
    >>> [block.n for block in find_blocks(np.array([250.0, 251, 567, 566, 567, 833]))]
    [2, 3, 1]
    """
    steps = np.abs(np.diff(FZ))
    largest = float(np.max(np.abs(FZ)))
    noise = 1.4826 * float(np.median(steps)) / np.sqrt(2) if steps.size else 0.0
    limit = min(max(float(_NOISE_FACTOR * noise), _LEAST_JUMP * largest), _LARGEST_JUMP * largest)
    edges = [0, *(np.flatnonzero(steps > limit) + 1).tolist(), len(FZ)]
    return tuple(Block(start=a, stop=b, mean_FZ=float(FZ[a:b].mean())) for a, b in itertools.pairwise(edges))


def is_tare(block: Block, *, smallest_load: float) -> bool:
    """Tell whether a block is a tare: under 5 % of the smallest load of the protocol [N]."""
    return abs(block.mean_FZ) < 0.05 * smallest_load
