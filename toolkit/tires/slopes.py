"""The slope of a tire's curve at a slip angle: the limit of its difference quotient, for every model alike.

A brush, TMeasy or LuGre tire has terms in |slip|: its curve has a slope at zero, but the chord over +-h
departs from it in proportion to h, by percents on a stiff tire with little friction. Chords over smaller and
smaller h are therefore extrapolated to h = 0, with all powers of h since |slip| brings the odd ones too
(Richardson 1911); of all extrapolations that is taken which is nearest to those that it came from (Ridders,
Advances in Engineering Software 4 (1982) 75).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.global_model import GlobalModel, Rows, make_rows
from toolkit.tires.recorded import as_array

_WIDEST = 1e-3  # rad
_PART = 4.0  # each chord is so many times shorter than the one before
_CHORDS = 9  # down to 1.5e-8 rad: shorter than any zero error, and long beside the rounding of a double


def limit_slope(curve: Callable[[Array], Any], at: float = 0.0) -> Array:
    """Return the slope of a curve at a slip angle [rad], (...) for a curve (..., n) of angles (n,).

    A kink of the curve itself, where no slope exists, gives the mean of both sides.

    >>> round(float(limit_slope(lambda s: 2 * s - 50 * s * abs(s))), 9)
    2.0
    """
    half = _WIDEST / _PART ** np.arange(_CHORDS)
    values = as_array(curve(np.concatenate([at + half, at - half])))
    # The angles as they were rounded, so that their distance is exact.
    width = (at + half) - (at - half)
    column = np.moveaxis((values[..., :_CHORDS] - values[..., _CHORDS:]) / width, -1, 0)
    best, spread = column[-1], np.full(column.shape[1:], np.inf)
    for power in range(1, _CHORDS):
        gain = _PART**power
        finer = (gain * column[1:] - column[:-1]) / (gain - 1)
        for before, after, extrapolated in zip(column[:-1], column[1:], finer, strict=True):
            distance = np.maximum(np.abs(extrapolated - before), np.abs(extrapolated - after))
            nearer = distance < spread
            best, spread = np.where(nearer, extrapolated, best), np.where(nearer, distance, spread)
        column = finer
    return as_array(best)


def stiffness(model: GlobalModel, values: Sequence[Any], *, load: float, like: Rows, channel: str) -> Array:
    """Return dY/dSA at SA = 0 [N/rad, N·m/rad] in the model's axes, upright, free rolling, nominal otherwise.

    Parameters
    ----------
    values : parameters as `GlobalModel.forces` takes them, one value or a column (copies, 1) each
    load : [N]
    like : whose nominal load, pressure, speed and radius are taken
    """

    def curve(SA: Array) -> Array:
        rows = make_rows(
            SA, load, FNOMIN=like.FNOMIN, NOMPRES=like.NOMPRES, LONGVL=like.LONGVL,
            UNLOADED_RADIUS=like.UNLOADED_RADIUS,
        )  # fmt: skip
        with np.errstate(all="ignore"):
            return model.forces(values, rows)[channel]

    return limit_slope(curve)
