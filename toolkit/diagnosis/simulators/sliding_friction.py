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
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array

    Mask = NDArray[np.bool_]


class TurnedError(Exception):
    """A body turns within a step: its bristle cannot be known from the way alone.

    ``slide`` is its bristle; ``after`` the time from the step's beginning by which it has turned [s], and
    ``speed`` its velocity then.
    """

    def __init__(self, slide: Slide, after: float, speed: float) -> None:
        super().__init__()
        self.slide, self.after, self.speed = slide, after, speed


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide:
    """One bristle: places of its bend and its body's velocity and way among all states; reach as the way."""

    bend: int
    velocity: int
    way: int
    reach: float


# (state, time since the step's beginning, body that may go over its turn): sets the bends of a state
Hold = Callable[[list[float], float, "Slide | None"], None]


def held(
    slides: Sequence[Slide], before: list[float], rates: list[float], turned: Slide | None
) -> Hold | None:
    """Return what sets the bends of a later state within a step, None where a body stands at its beginning.

    It raises TurnedError for a state in which a body has turned.

    Parameters
    ----------
    before, rates : the state at the step's beginning, and its rates
    turned : the body that turns there: it goes on as it is accelerated, however slow it still is
    """
    known = []
    for slide in slides:
        speed, slack = before[slide.velocity], 0.0
        if slide is turned or not speed:
            speed, slack = rates[slide.velocity], abs(speed)
        if not speed:
            return None
        way = math.copysign(1.0, speed)
        known.append(
            (
                slide,
                slide.bend,
                slide.velocity,
                slide.way,
                way,
                slack,
                before[slide.bend] - way,
                before[slide.way],
                slide.reach,
            )
        )

    def hold(y: list[float], after: float, over: Slide | None) -> None:
        for slide, bend, velocity, place, way, slack, off, begun, reach in known:
            if y[velocity] * way <= -slack and slide is not over:
                raise TurnedError(slide, after, y[velocity])
            y[bend] = way + off * math.exp(-max(way * (y[place] - begun), 0.0) / reach)

    return hold


def until_turn(speed: float, rate: float, after: float, later: float) -> float:
    """Return the time to a turn: velocity and its rate now, and the velocity of the other sign ``after``."""
    bend = (later - speed - rate * after) / after**2
    root = math.sqrt(max(rate * rate - 4 * bend * speed, 0.0))
    return 2 * speed / (math.copysign(root, speed) - rate)


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
        self.slides = slides

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self.slides)

    def held(
        self, begun: Array, rates: Array, free: Mask, turned: Mask | None = None, beside: int = 1
    ) -> Held:
        """Return the bends of a step, known from the ways wherever a body moves.

        Parameters
        ----------
        begun, rates : states at its beginning and their rates, (states, columns)
        free : columns in which no bend is known, (columns,)
        turned : columns in which a body is at its turn: it goes on as it is accelerated, (columns,)
        beside : columns that go together, the first of them for all
        """
        return Held([HeldSlide(slide, begun, rates, free, turned, beside) for slide in self.slides])


class Held:
    """The bends of all bristles within one step."""

    def __init__(self, slides: Sequence[HeldSlide]) -> None:
        self.slides = slides

    def set(self, y: Array, after: Array) -> None:
        """Set the bends of a later state, and note where a body has turned by then, in place.

        Parameters
        ----------
        after : time since the step's beginning [s], (columns,)
        """
        for slide in self.slides:
            slide.set(y, after)

    def known(self, error: Array) -> None:
        """Set the errors of the bends that are known to zero, in place; ``error`` (states, columns)."""
        for slide in self.slides:
            bend, at = slide.of.bend, slide.of.at
            error[bend, at] = np.where(slide.moving, 0.0, error[bend, at])


class HeldSlide:
    """One bristle within one step: in which of its columns its bend is known, and where a body has turned.

    Of columns that go together the first says it; ``leads`` are their places. ``turned``, the time since the
    step's beginning by which it has, ``after`` [s], and its velocity then, ``speed``, are those of the first.
    """

    def __init__(
        self, slide: SlideColumns, begun: Array, rates: Array, free: Mask, turned: Mask | None, beside: int
    ) -> None:
        self.of, self._beside = slide, beside
        self._first = first = slide.at[::beside]
        self.leads, self.reach = first // beside, slide.reach[::beside]
        speed, self._slack = begun[slide.velocity, first], np.zeros(len(first))
        stands = speed == 0 if turned is None else (speed == 0) | turned[first]
        if stands.any():
            self._slack = np.where(stands, np.abs(speed), 0.0)
            speed = np.where(stands, rates[slide.velocity, first], speed)
        self._way = np.sign(speed)
        self._moving = (speed != 0) & ~free[first]
        self.moving, self._ways = self._each(self._moving), self._each(self._way)
        self._begun, self._off = begun[slide.way, slide.at], begun[slide.bend, slide.at] - self._ways
        self.turned = np.zeros(len(first), dtype=bool)
        self.after, self.speed = np.zeros(len(first)), np.zeros(len(first))

    def _each(self, values: Any) -> Any:
        return values if self._beside == 1 else np.repeat(values, self._beside)

    def set(self, y: Array, after: Array) -> None:
        """Set the bends of a later state, and note where the body has turned by then, in place."""
        of, first = self.of, self._first
        speed = y[of.velocity, first]
        turns = self._moving & (speed * self._way <= -self._slack) & ~self.turned
        if turns.any():
            self.turned |= turns
            self.after[turns], self.speed[turns] = after[first][turns], speed[turns]
        travelled = np.maximum(self._ways * (y[of.way, of.at] - self._begun), 0.0)
        bent = self._ways + self._off * np.exp(-travelled / of.reach)
        y[of.bend, of.at] = np.where(self.moving, bent, y[of.bend, of.at])


def until_turns(speed: Array, rate: Array, after: Array, later: Array) -> Array:
    """Return the times to turns as `until_turn` does, (columns,) all."""
    bend = (later - speed - rate * after) / after**2
    root = np.sqrt(np.maximum(rate * rate - 4 * bend * speed, 0.0))
    return np.asarray(2 * speed / (np.copysign(root, speed) - rate))
