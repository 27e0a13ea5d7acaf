"""Carry the values of one nominal load to one common load.

Blocks of one nominal load differ by some percent; forces are compared and halved only at one load. The
slope comes from the neighbouring loads of the same file, so that it is taken at the same slip angle.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from toolkit.reduction.model import Condition

# Rests at no step of the protocol are at two slip angles where they are further apart than half a degree.
_GAP_RAD = float(np.radians(0.5))


@dataclass(frozen=True, slots=True, kw_only=True)
class Slope:
    """dy/dFZ at one block and the standard uncertainty that the choice of neighbours leaves."""

    value: float
    u: float


def at_one_angle(conditions: Sequence[Condition]) -> tuple[tuple[int, ...], ...]:
    """Return the groups of conditions whose loads are neighbours: indices, one group a file and slip angle.

    A file of one slip angle is one group. A continuous recording has several: its rests are told apart by
    the protocol's step, those at no step by a gap in the angle, and a load that stands twice by its turn.
    """
    places: dict[tuple[str, float | None], list[int]] = {}
    for index, one in enumerate(conditions):
        places.setdefault((one.file, one.step_SA), []).append(index)
    groups: dict[tuple[str, float | None, int, int], list[int]] = {}
    for (file, step), mine in places.items():
        angles = sorted({conditions[index].SA for index in mine})
        cluster: dict[float, int] = {}
        last = angles[0]
        for SA in angles:
            number = cluster.get(last, 0) + (step is None and SA - last > _GAP_RAD)
            cluster[SA], last = number, SA
        seen: Counter[tuple[int, float | None]] = Counter()
        for index in sorted(mine, key=lambda i: conditions[i].first_row):
            one = conditions[index]
            turn = seen[cluster[one.SA], one.step_FZ]
            seen[cluster[one.SA], one.step_FZ] += one.step_FZ is not None
            groups.setdefault((file, step, cluster[one.SA], turn), []).append(index)
    return tuple(tuple(sorted(group)) for group in groups.values())


def slopes(FZ: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[Slope | None, ...]:
    """Return dy/dFZ at each block of one file from its neighbours in load.

    Parameters
    ----------
    FZ : (blocks,) mean loads [N]; y : (blocks,) mean force or moment

    Returns
    -------
    one entry a block; None where the file has one load only. Inside: the slope of the parabola through
    the block and both neighbours; at an end the same parabola's slope there. The uncertainty is what a cubic
    through one block more would change, the error of an interpolation by its next order; with three blocks
    that of a rectangle between the two secants (GUM 4.3.7); with two, half the secant itself.

    Examples
    --------
    >>> [round(s.value, 9) for s in slopes(np.array([1.0, 2.0, 4.0]), np.array([1.0, 4.0, 16.0]))]
    [2.0, 4.0, 8.0]
    """
    n = len(FZ)
    order = np.argsort(FZ, kind="stable")
    found: list[Slope | None] = [None] * n
    if n < 2 or np.min(np.diff(FZ[order])) <= 0:
        return tuple(found)
    x, values = FZ[order], y[order]
    secants = np.diff(values) / np.diff(x)
    if n == 2:
        one = Slope(value=float(secants[0]), u=float(abs(secants[0])) / 2)
        return (one, one)
    for place, block in enumerate(order):
        middle = min(max(place, 1), n - 2)
        left, right = secants[middle - 1], secants[middle]
        bend = (right - left) / (x[middle + 1] - x[middle - 1])
        # Newton's form of the parabola through the three, differentiated at the block itself.
        value = left + bend * ((x[place] - x[middle - 1]) + (x[place] - x[middle]))
        u = abs(right - left) / (2 * np.sqrt(3)) if n == 3 else _next_order(x, secants, middle, place)
        found[block] = Slope(value=float(value), u=float(u))
    return tuple(found)


def _next_order(x: NDArray[np.float64], secants: NDArray[np.float64], middle: int, place: int) -> float:
    """Return how far a cubic through the nearest fourth block moves the parabola's slope at a block."""
    nodes = x[middle - 1 : middle + 2]
    # The fourth block is the nearer of the two beyond the three.
    beyond = [i for i in (middle - 2, middle + 2) if 0 <= i < len(x)]
    fourth = min(beyond, key=lambda i: abs(x[i] - x[place]))
    first = min(fourth, middle - 1)
    bends = np.diff(secants[first : first + 3]) / (x[first + 2 : first + 4] - x[first : first + 2])
    third = (bends[1] - bends[0]) / (x[first + 3] - x[first])
    # The cubic adds third * (x - x1)(x - x2)(x - x3), whose slope at a node is the product of two gaps.
    gaps = [x[place] - node for node in nodes if node != x[place]]
    return float(abs(third * gaps[0] * gaps[1]))


def carry(value: float, u: float, *, slope: Slope | None, delta_FZ: float) -> tuple[float, float]:
    """Return (value, u) at a load that differs by ``delta_FZ`` [N]; without a slope nothing is carried."""
    if slope is None:
        return value, u
    return value + slope.value * delta_FZ, float(np.hypot(u, slope.u * delta_FZ))
