"""Designs by exchange of points: a multiset of candidates that makes a criterion small.

The modified exchange of Cook and Nachtsheim (Technometrics 22 (1980) 315) over a finite list of candidates:
points are dropped or added until the size is right, then each in turn is replaced by the candidate that does
best. The criterion is any function of a design, here the budget of a curve's reading.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

Points = tuple[int, ...]
Criterion = Callable[[Points], float]
_PASSES = 20
_GAIN = 1e-9  # an exchange that gains less, as a part of the criterion, is rounding


class Exchange:
    """The search of one criterion; a design that was judged before is not judged again.

    Parameters
    ----------
    criterion : of a design, ascending indices of candidates, repeats allowed; infinite where it cannot serve
    candidates : how many there are
    """

    def __init__(self, criterion: Criterion, candidates: int) -> None:
        self._criterion, self.candidates = criterion, candidates
        self._judged: dict[Points, float] = {}

    def value(self, design: Sequence[int]) -> float:
        """Return the criterion of a design, in whatever order its points stand."""
        key = tuple(sorted(design))
        if key not in self._judged:
            self._judged[key] = self._criterion(key)
        return self._judged[key]

    def resized(self, start: Sequence[int], size: int) -> Points:
        """Return a design of a size: point by point what harms least to drop, or helps most to add."""
        design = tuple(sorted(start))
        while len(design) > size:
            design = min(
                (_without(design, place) for place in range(len(design))), key=lambda d: (self.value(d), d)
            )
        while len(design) < size:
            design = min(
                (tuple(sorted((*design, point))) for point in range(self.candidates)),
                key=lambda d: (self.value(d), d),
            )
        return design

    def improved(self, start: Sequence[int]) -> Points:
        """Return a design that no exchange of one point makes better."""
        design = tuple(sorted(start))
        for _ in range(_PASSES):
            before = self.value(design)
            for point in dict.fromkeys(design):
                kept = _without(design, design.index(point)) if point in design else None
                if kept is None:
                    continue
                best = min(
                    (tuple(sorted((*kept, other))) for other in range(self.candidates)),
                    key=lambda d: (self.value(d), d),
                )
                if self.value(best) < self.value(design) * (1 - _GAIN) or math.isinf(self.value(design)):
                    design = best
            if not self.value(design) < before * (1 - _GAIN):
                break
        return design


def _without(design: Points, place: int) -> Points:
    return (*design[:place], *design[place + 1 :])
