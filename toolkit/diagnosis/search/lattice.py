"""Coarse steps show in the recorded numbers themselves: every value stands on a lattice.

No search is needed, and none would do: where the noise is as large as the step, the simulation stepped alike
predicts nothing better. What tells is that all values are multiples of one step which is coarse against
the noise and coarse against the digits that the file prints.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import LATTICE

if TYPE_CHECKING:
    from toolkit.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Lattice:
    """The step of a channel's values, and how much more probable they are on it than between its points.

    ``half_width``: by which the step may be off, because the file prints the values' ends rounded.
    """

    step: float
    half_width: float
    log_score_gain: float


def lattice_of(values: Array, residual_sd: float) -> Lattice | None:
    """Return the lattice of recorded values, None where there is none or it does not matter.

    Parameters
    ----------
    values : as recorded, (n,), without missing ones
    residual_sd : of what a simulation leaves of them
    """
    if len(values) < LATTICE.fewest:
        return None
    steps = np.diff(np.unique(values))
    size = float(np.abs(values).max())
    steps = steps[steps > 1e-9 * max(size, 1e-300)]
    if len(steps) < LATTICE.fewest_steps:
        return None
    least = float(steps.min())
    counts = np.round(steps / least)
    if np.abs(steps / least - counts).max() > LATTICE.exact * max(float(counts.max()), 1.0):
        return None
    total = float(np.sum(counts))
    step = float(np.sum(steps)) / total
    printed = _last_place(values)
    rounded = step**2 / 12  # variance of what rounding to a step takes away
    if (
        step < (LATTICE.finer if len(steps) >= LATTICE.many else LATTICE.coarser) * printed
        or rounded < LATTICE.coarse * residual_sd**2
    ):
        return None
    ends = _rounding(values, printed)
    return Lattice(step=step, half_width=ends / total, log_score_gain=len(values) * math.log(step / printed))


def _rounding(values: Array, printed: float) -> float:
    """Return by how much the distance of the least and the largest value may be off: half a place each.

    A file prints either to a fixed place or to so many significant digits, then its ends are the coarsest.
    """
    shown = (f"{abs(value):.12g}".partition("e")[0].replace(".", "").lstrip("0") for value in values.tolist())
    digits = max(map(len, shown))
    ends = (abs(float(values.min())), abs(float(values.max())))
    places = (10.0 ** (math.floor(math.log10(end)) + 1 - digits) if end > 0 else printed for end in ends)
    return sum(0.5 * max(printed, place) for place in places)


def _last_place(values: Array) -> float:
    """Return the finest decimal place at which the values are printed."""
    places = 0
    for value in values[:200].tolist():
        _, _, decimals = f"{value:.12g}".partition(".")
        mantissa, _, exponent = decimals.partition("e")
        places = max(places, len(mantissa) - (int(exponent) if exponent else 0))
    return 10.0**-places
