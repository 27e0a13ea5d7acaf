"""How well a fit describes its rows: the error in percent, and the scatter that no model could remove."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array

_BIN = np.deg2rad(0.25)
_ROWS = 3  # fewer rows in a bin have no mean to speak of
_PLACES = 200.0  # of half the range of slip angle


def error_percent(residual: Array, y: Array) -> float:
    """Return 100 sqrt(sum residual^2 / sum y^2) over the rows fitted, the channel as given.

    >>> error_percent(np.array([3.0, 4.0]), np.array([30.0, 40.0]))
    10.0
    """
    return float(100 * np.sqrt(np.sum(residual**2) / np.sum(y**2)))


def scatter_floor_percent(SA: Array, y: Array, load: NDArray[np.intp] | None = None) -> float | None:
    """Return the error in percent of the rows about their own mean in bins of slip angle (and load).

    Parameters
    ----------
    SA : (rows,) rad; the bins are 0.25 deg wide and centred on multiples of it, so that set angles
        fall in the middle of a bin and not on its edge
    y : (rows,) N or N·m
    load : (rows,) number of the load block

    Returns
    -------
    percent, over the rows of bins that hold at least three; None where these are under half of the rows, or
    all zero
    """
    place = np.rint(SA / _BIN).astype(np.intp)
    place -= place.min()
    if load is not None:
        place += (place.max() + 1) * np.asarray(load)
    rows = np.bincount(place)
    full = rows[place] >= _ROWS
    if 2 * np.count_nonzero(full) < len(y) or not y[full].any():
        return None
    mean = np.bincount(place, y) / np.maximum(rows, 1)
    return error_percent((y - mean[place])[full], y[full])


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
