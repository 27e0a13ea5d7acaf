"""Sliding bristles, known from the way: while a body keeps its direction, nothing is left to integrate.

A bristle's bend z follows dz/dt = (v - |v| z)/reach. Over the way s in one direction it is exactly
z = d + (z0 - d) exp(-|s - s0|/reach), d the direction, 1 or -1. As a state it would be stiff, the more so the
faster a body slides, and steps would be as short as the bristle; as a function of the way it costs nothing.
Where a body turns, it moves slowly and the bend is integrated as any state.

Source: Dahl's equation of `forces`, integrated over the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class TurnedError(Exception):
    """A body turns within a step: its bristle cannot be known from the way alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide:
    """One bristle: places of its bend and its body's velocity and way among all states; reach as the way."""

    bend: int
    velocity: int
    way: int
    reach: float


def held(slides: Sequence[Slide], before: list[float]) -> Callable[[list[float]], None] | None:
    """Return what sets the bends of a later state within a step, None where a body stands at its beginning.

    It raises TurnedError for a state in which a body has turned.
    """
    known = []
    for slide in slides:
        if before[slide.velocity] == 0:
            return None
        way = math.copysign(1.0, before[slide.velocity])
        known.append(
            (
                slide.bend,
                slide.velocity,
                slide.way,
                way,
                before[slide.bend] - way,
                before[slide.way],
                slide.reach,
            )
        )

    def hold(y: list[float]) -> None:
        for bend, velocity, place, way, off, begun, reach in known:
            if y[velocity] * way <= 0:
                raise TurnedError
            y[bend] = way + off * math.exp(-max(way * (y[place] - begun), 0.0) / reach)

    return hold


class HeldColumns:
    """The same for states in columns, shape (states, columns); a column that turns is left to integration."""

    def __init__(self, slides: Sequence[tuple[int, Slide]]) -> None:
        """Take pairs of column and slide."""
        listed = [slide for _, slide in slides]
        self._column = np.array([column for column, _ in slides], dtype=np.intp)
        self._bend, self._velocity, self._place = (
            np.array([getattr(slide, name) for slide in listed], dtype=np.intp)
            for name in ("bend", "velocity", "way")
        )
        self._reach = np.array([slide.reach for slide in listed])
        self._on = np.zeros(len(listed), dtype=bool)

    @property
    def turning(self) -> int:
        """Number of columns in which something slides: each turns at its own time."""
        return len(set(self._column.tolist()))

    def begin(self, x: Array) -> None:
        """Take the states at the beginning of a step."""
        v = x[self._velocity, self._column]
        self._on, self._way = v != 0, np.sign(v)
        self._off = x[self._bend, self._column] - self._way
        self._begun = x[self._place, self._column]

    def hold(self, y: Array) -> None:
        """Set the bends of a later state, in place.

        Raises
        ------
        TurnedError
            a body has turned; the next call leaves its column as it is
        """
        if not len(self._on):
            return
        turned = self._on & (y[self._velocity, self._column] * self._way <= 0)
        if turned.any():
            self._on &= ~turned
            raise TurnedError
        travelled = np.maximum(self._way * (y[self._place, self._column] - self._begun), 0.0)
        bent = self._way + self._off * np.exp(-travelled / self._reach)
        on = self._on
        y[self._bend[on], self._column[on]] = bent[on]

    def known(self, error: Array) -> None:
        """Set the errors of the bends that are held to zero, in place; ``error`` (states, columns)."""
        error[self._bend[self._on], self._column[self._on]] = 0.0
