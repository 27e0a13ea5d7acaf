"""The one search of all plans: parts of a design are exchanged one by one until no exchange makes it better.

A design has parts (the rows of a session, the slip angles of a test, the factors of a run, the mounts of a
sequence), and each part has alternatives out of a finite list. In every sweep each part in turn takes the
alternative of least loss: Fedorov's exchange (Theory of Optimal Experiments, 1972) by parts, as Cook and
Nachtsheim have it (Technometrics 22 (1980) 315); with factors for parts it is the coordinate exchange of
Meyer and Nachtsheim (Technometrics 37 (1995) 60). It ends at a design that no single exchange makes better,
which need not be the best of all: `best_of` starts from several.

The losses of all alternatives of a part come together, so that a criterion may give them by an update formula
(`criteria`) in place of a matrix for each.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from toolkit.arrays import Array

Design = TypeVar("Design")
Points = tuple[int, ...]
"""A multiset of candidates by their numbers, ascending."""
SWEEPS = 30
_GAIN = 1e-9  # what is gained less is rounding; of the loss where that is beyond 1, else of 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alternatives(Generic[Design]):
    """What a part of a design may be: ``losses`` (alternatives,), infinite where one cannot serve.

    ``present`` is the alternative that the design has; ``design`` returns the design with another one.
    """

    losses: Array
    present: int
    design: Callable[[int], Design]


def exchanged(
    design: Design,
    alternatives: Callable[[Design, int], Alternatives[Design]],
    parts: Callable[[], Iterable[int]],
    *,
    sweeps: int = SWEEPS,
) -> Design:
    """Return a design that no exchange of one part makes better, or as far as so many sweeps come.

    Parameters
    ----------
    alternatives : of a part, by its number, in a design
    parts : the parts in the order of a sweep; asked anew for each, so that it may be drawn
    """
    for _ in range(sweeps):
        changed = False
        for part in parts():
            offered = alternatives(design, part)
            best = int(np.argmin(offered.losses))
            if is_less(float(offered.losses[best]), float(offered.losses[offered.present])):
                design, changed = offered.design(best), True
        if not changed:
            break
    return design


def best_of(
    starts: Iterable[Design], search: Callable[[Design], Design], loss: Callable[[Design], float]
) -> Design:
    """Return the best of the designs that a search ends at, from each start; the first of equals.

    Starts are drawn by whoever asks, from a seeded generator.
    """
    return min((search(start) for start in starts), key=loss)


def is_less(loss: float, other: float) -> bool:
    """Tell whether a loss is smaller than another one by more than rounding.

    >>> is_less(1.0, 2.0), is_less(1.0, 1.0 + 1e-12), is_less(1.0, float("inf")), is_less(1.0, 1.0)
    (True, False, True, False)
    """
    return loss < other - _GAIN * max(abs(loss), 1.0)


def grown(
    points: Sequence[int], pool: Collection[int], loss: Callable[[Points], float], *, size: int | None = None
) -> Points:
    """Return a design with points added, each time the one of least loss, the first of equals.

    Until it has a ``size``; without one, as long as each addition makes it better.
    """
    design = tuple(sorted(points))
    while pool and (size is None or len(design) < size):
        larger = min((tuple(sorted((*design, point))) for point in pool), key=lambda d: (loss(d), d))
        if size is None and not is_less(loss(larger), loss(design)):
            break
        design = larger
    return design


def shrunk(points: Sequence[int], loss: Callable[[Points], float], *, size: int | None = None) -> Points:
    """Return a design with points dropped, each time the one that harms least, the first of equals.

    Down to a ``size``; without one, as long as nothing is lost.
    """
    design = tuple(sorted(points))
    while design and (size is None or len(design) > size):
        smaller = min((_without(design, place) for place in range(len(design))), key=lambda d: (loss(d), d))
        if size is None and is_less(loss(design), loss(smaller)):
            break
        design = smaller
    return design


def _without(design: Points, place: int) -> Points:
    return (*design[:place], *design[place + 1 :])


class PointSearch:
    """The search of points for one criterion; a design that was judged before is not judged again.

    Parameters
    ----------
    criterion : (designs,) of designs of one size at once, each of ascending numbers of candidates, repeats
        allowed; infinite where one cannot serve
    candidates : how many there are
    """

    def __init__(self, criterion: Callable[[Sequence[Points]], Array], candidates: int) -> None:
        self._criterion, self.candidates = criterion, candidates
        self._judged: dict[Points, float] = {}

    def loss(self, design: Sequence[int]) -> float:
        """Return the criterion of a design, in whatever order its points stand."""
        return float(self.losses([tuple(sorted(design))])[0])

    def losses(self, designs: Sequence[Points]) -> Array:
        """Return the criterion (designs,) of ascending designs; those that are new are judged at once."""
        new = [design for design in dict.fromkeys(designs) if design not in self._judged]
        if new:
            self._judged |= zip(new, self._criterion(new).tolist(), strict=True)
        return np.array([self._judged[design] for design in designs])

    def resized(self, start: Sequence[int], size: int) -> Points:
        """Return a design of a size: point by point what harms least to drop, or helps most to add."""
        smaller = shrunk(start, self.loss, size=size) if len(start) > size else tuple(start)
        return grown(smaller, range(self.candidates), self.loss, size=size)

    def improved(self, start: Sequence[int]) -> Points:
        """Return a design that no exchange of one point makes better."""
        order = range(len(start))
        return exchanged(tuple(sorted(start)), self._alternatives, lambda: order)

    def best(self, starts: Iterable[Sequence[int]]) -> Points:
        """Return the best design that exchanges from several starts end at."""
        return best_of((tuple(sorted(start)) for start in starts), self.improved, self.loss)

    def nearest(self, size: int, count: int) -> tuple[Points, ...]:
        """Return the designs of a size that were judged and have the least loss, the least first."""
        judged = ((loss, design) for design, loss in self._judged.items() if len(design) == size)
        return tuple(design for _, design in sorted(judged)[:count])

    def _alternatives(self, design: Points, place: int) -> Alternatives[Points]:
        remaining = _without(design, place)

        def with_point(point: int) -> Points:
            return tuple(sorted((*remaining, point)))

        losses = self.losses([with_point(point) for point in range(self.candidates)])
        return Alternatives(losses=losses, present=design[place], design=with_point)
