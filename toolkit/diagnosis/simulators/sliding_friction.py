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


@dataclass(frozen=True, slots=True, eq=False)
class SlideColumns:
    """The bristles of one force in columns of states: places as in `Slide`, the columns that have it."""

    bend: int
    velocity: int
    way: int
    reach: Array
    at: NDArray[np.intp]


class Bristles:
    """Bristles among columns of states; while a body keeps its direction, its bend follows from its way."""

    def __init__(self, slides: Sequence[SlideColumns]) -> None:
        self._slides = slides

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self._slides)

    @property
    def columns(self) -> list[NDArray[np.intp]]:
        """Columns of every bristle."""
        return [slide.at for slide in self._slides]

    def moving(self, y: Array) -> list[NDArray[np.bool_]]:
        """Return for every bristle in which of its columns the body moves."""
        return [y[slide.velocity, slide.at] != 0 for slide in self._slides]

    def hold(
        self, begun: Array, y: Array, on: Sequence[NDArray[np.bool_]], turned: Sequence[NDArray[np.bool_]]
    ) -> None:
        """Set the bends of a later state, and note in which columns a body has turned, in place.

        Parameters
        ----------
        begun : states at the beginning of a step, (states, columns)
        on : columns that are held, of every bristle
        """
        for slide, moving, turns in zip(self._slides, on, turned, strict=True):
            way = np.sign(begun[slide.velocity, slide.at])
            turns |= moving & (y[slide.velocity, slide.at] * way <= 0)
            travelled = np.maximum(way * (y[slide.way, slide.at] - begun[slide.way, slide.at]), 0.0)
            bent = way + (begun[slide.bend, slide.at] - way) * np.exp(-travelled / slide.reach)
            y[slide.bend, slide.at] = np.where(moving, bent, y[slide.bend, slide.at])

    def known(self, error: Array, on: Sequence[NDArray[np.bool_]]) -> None:
        """Set the errors of the bends that are held to zero, in place; ``error`` (states, columns)."""
        for slide, moving in zip(self._slides, on, strict=True):
            error[slide.bend, slide.at] = np.where(moving, 0.0, error[slide.bend, slide.at])
