"""The scatter about a curve where every slip angle counts once, whatever the number of its rows.

Two hundred copies of one row agree with any curve through it: they say nothing of the scatter about it, and
the median of all residuals would be theirs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

_PLACES = 200.0  # of half the range of slip angle


def shares(u: Array, used: NDArray[np.bool_]) -> Array:
    """Return by how much each row counts (curves, points): rows of one slip angle make one together.

    ``u`` is the slip angle in half ranges about its middle; rows that are not used count 0.

    >>> shares(np.array([[-1.0, 1.0, 1.0]]), np.array([[True, True, True]])).tolist()
    [[1.0, 0.5, 0.5]]
    """
    place = np.rint(u * _PLACES).astype(np.intp)
    place -= place.min()
    size = int(place.max()) + 1
    slot = place + size * np.arange(len(place))[:, None]
    count = np.bincount(slot.ravel(), used.ravel().astype(np.float64), size * len(place))
    return np.asarray(used / np.maximum(count[slot], 1.0))


def median(values: Array, share: Array, at: float = 0.5) -> Array:
    """Return the median (curves,) or another quantile of values (curves, points) that count by their shares.

    >>> median(np.array([[5.0, 0.0, 0.0, 0.0, 3.0]]), np.array([[1.0, 0.3, 0.3, 0.4, 1.0]])).tolist()
    [3.0]
    """
    order = np.argsort(values, axis=1)
    below = np.cumsum(np.take_along_axis(share, order, axis=1), axis=1)
    part = at * below[:, -1:]
    spare = 1e-9 * below[:, -1:]
    # Of an even number the mean of the middle two.
    low, high = (below >= part - spare).argmax(axis=1), (below > part + spare).argmax(axis=1)
    places = np.take_along_axis(
        values, np.take_along_axis(order, np.stack([low, high], axis=1), axis=1), axis=1
    )
    return np.asarray(places.mean(axis=1))
