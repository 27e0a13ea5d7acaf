"""Carry the values of one nominal load to one common load.

Blocks of one nominal load differ by some percent; forces are compared and halved only at one load. The
slope comes from the neighbouring loads of the same file, so that it is taken at the same slip angle.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Rotation

# Rests at no step of the protocol are at two slip angles where they are further apart than half a degree.
_GAP_RAD = float(np.radians(0.5))


class OnCurve(Protocol):
    """A load block as a point of its test's curves: what `toolkit.reduction.model.Condition` says of it."""

    @property
    def file(self) -> str: ...  # noqa: D102
    @property
    def rotation(self) -> Rotation: ...  # noqa: D102
    @property
    def first_row(self) -> int: ...  # noqa: D102
    @property
    def step_SA(self) -> float | None: ...  # noqa: D102
    @property
    def step_FZ(self) -> float | None: ...  # noqa: D102
    @property
    def SA(self) -> float: ...  # noqa: D102
    @property
    def FZ(self) -> float: ...  # noqa: D102
    @property
    def FY(self) -> float: ...  # noqa: D102
    @property
    def MZ(self) -> float: ...  # noqa: D102


@dataclass(frozen=True, slots=True, kw_only=True)
class Slope:
    """dy/dFZ at one block and the standard uncertainty that the choice of neighbours leaves."""

    value: float
    u: float


def at_one_angle(conditions: Sequence[OnCurve]) -> tuple[tuple[int, ...], ...]:
    """Return the groups of conditions whose loads are neighbours: indices, one group a file and slip angle.

    A file of one slip angle is one group. A continuous recording has several: its rests are told apart by
    the protocol's step, those at no step by a gap in the angle, and a load that stands twice by its turn.
    """
    places: dict[tuple[str, float | None], list[int]] = {}
    for index, condition in enumerate(conditions):
        places.setdefault((condition.file, condition.step_SA), []).append(index)
    groups: dict[tuple[str, float | None, int, int], list[int]] = {}
    for (file, step), mine in places.items():
        angles = sorted({conditions[index].SA for index in mine})
        cluster: dict[float, int] = {}
        last = angles[0]
        for SA in angles:
            number = cluster.get(last, 0) + (step is None and SA - last > _GAP_RAD)
            cluster[SA], last = number, SA
        count_by_place: Counter[tuple[int, float | None]] = Counter()
        for index in sorted(mine, key=lambda i: conditions[i].first_row):
            condition = conditions[index]
            turn = count_by_place[cluster[condition.SA], condition.step_FZ]
            count_by_place[cluster[condition.SA], condition.step_FZ] += condition.step_FZ is not None
            groups.setdefault((file, step, cluster[condition.SA], turn), []).append(index)
    return tuple(tuple(sorted(group)) for group in groups.values())


def slopes(FZ: Array, y: Array) -> tuple[Slope | None, ...]:
    """Return dy/dFZ at each block of one file from its neighbours in load.

    Parameters
    ----------
    FZ : (blocks,) mean loads [N]; y : (blocks,) mean force or moment

    Returns
    -------
    one entry a block; None where the file has one load only. Inside: the slope of the parabola through
    the block and both neighbours; at an end the same parabola's slope there; with five blocks or more that of
    the cubic through one block more. The uncertainty is that of a rectangle (GUM 4.3.7) as wide to either
    side as what the polynomial of the next order would change, with three blocks one between the two
    secants; with two blocks it is half the secant itself.

    Examples
    --------
    >>> [round(s.value, 9) for s in slopes(np.array([1.0, 2.0, 4.0]), np.array([1.0, 4.0, 16.0]))]
    [2.0, 4.0, 8.0]
    """
    n = len(FZ)
    order = np.argsort(FZ, kind="stable")
    slopes_found: list[Slope | None] = [None] * n
    if n < 2 or np.min(np.diff(FZ[order])) <= 0:
        return tuple(slopes_found)
    x, values = FZ[order], y[order]
    secants = np.diff(values) / np.diff(x)
    if n == 2:
        slope = Slope(value=float(secants[0]), u=float(abs(secants[0])) / 2)
        return (slope, slope)
    for place, block in enumerate(order):
        middle = min(max(place, 1), n - 2)
        terms = _terms(x, values, _nodes(x, place, middle))
        # The parabola ends with the second term, the cubic with the third.
        last = 3 if n >= 5 else 2
        u = abs(terms[last]) if n > 3 else abs(secants[middle] - secants[middle - 1]) / 2
        slopes_found[block] = Slope(value=float(sum(terms[:last])), u=float(u) / np.sqrt(3))
    return tuple(slopes_found)


def _nodes(x: Array, place: int, middle: int) -> list[int]:
    """Return up to five blocks in the order in which a polynomial at one of them takes them up."""
    nodes = [place, *(i for i in (middle - 1, middle, middle + 1) if i != place)]
    outer = sorted(set(range(len(x))) - set(nodes), key=lambda i: abs(x[i] - x[place]))
    return nodes + outer[:2]


def _terms(x: Array, y: Array, nodes: Sequence[int]) -> list[float]:
    """Return what each order of Newton's polynomial adds to the slope at its first node."""
    at, table = x[nodes], y[nodes]
    terms, product = [], 1.0
    for order in range(1, len(nodes)):
        table = (table[1:] - table[:-1]) / (at[order:] - at[:-order])
        terms.append(float(table[0]) * product)
        product *= float(at[0] - at[order])
    return terms


def carry(value: float, u: float, *, slope: Slope | None, delta_FZ: float) -> tuple[float, float]:
    """Return (value, u) at a load that differs by ``delta_FZ`` [N]; without a slope nothing is carried."""
    if slope is None:
        return value, u
    return value + slope.value * delta_FZ, float(np.hypot(u, slope.u * delta_FZ))
