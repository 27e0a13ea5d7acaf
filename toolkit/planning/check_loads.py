"""Check loads that verify every coefficient: full rank, and each term moved by five tolerances.

They are what an approval asks for (`registry.gates.unverifiable`): with fewer a flipped sign passes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.registry.gates import VERIFIED
from toolkit.calibration.terms import INTERCEPT
from toolkit.declared import Entry
from toolkit.planning.exchange import Points, grown, shrunk

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.planning.knowledge import Knowledge

MARGIN = 1.2
"""Of a planned movement over the five tolerances: readings differ from what was planned."""
_INDEPENDENT = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """Whether check loads show a term: ``movement`` is how many tolerances a load moves by it.

    The intercept moves all of them alike: it is told from the slopes by the rank of the check loads alone.
    """

    load: Annotated[str, Entry("symbol of the load")]
    term: Annotated[str, Entry("of its equation")]
    movement: Annotated[
        float | None,
        Entry("tolerances by which check loads move the load by the term; null of the intercept"),
    ]
    verified: Annotated[
        bool, Entry("whether that is five or more; of the intercept, whether the rank is full")
    ]


def choose_check_loads(
    knowledge: Knowledge, loads: Array, avoid: frozenset[int]
) -> tuple[NDArray[np.intp], tuple[Verification, ...]]:
    """Return the fewest check loads found among feasible ones (candidates, loads), and what they verify.

    Each step adds the load that verifies most, then those without which as much is verified are taken out.
    Loads to ``avoid`` are those of the fit; they are taken where nothing else verifies a term.
    """

    def lacking(points: Points) -> float:
        return -_value(knowledge, loads, list(points))

    every = range(len(loads))
    points: Points = ()
    for pool in ([at for at in every if at not in avoid], every):
        points = grown(points, pool, lacking)
    order = np.array(shrunk(points, lacking), dtype=np.intp)
    return order, verification(knowledge, loads[order])


def verification(knowledge: Knowledge, check: Array) -> tuple[Verification, ...]:
    """Return of every term of every load whether check loads (rows, loads) verify it."""
    results = []
    for fit in knowledge.record.loads:
        terms = knowledge.terms(fit, check)
        tolerance = fit.tolerance or 1e-3 * fit.largest
        full = _rank(terms) == len(fit.terms)
        moved = (
            np.abs(fit.coefficients) * np.ptp(terms, axis=0) / tolerance
            if len(check)
            else np.zeros(len(fit.terms))
        )
        results += [
            Verification(
                load=fit.load, term=term, movement=None if term == INTERCEPT else float(size),
                verified=full and (term == INTERCEPT or float(size) > VERIFIED),
            )
            for term, size in zip(fit.terms, moved, strict=True)
        ]  # fmt: skip
    return tuple(results)


def _value(knowledge: Knowledge, loads: Array, points: list[int]) -> float:
    """Return how far check loads are on their way: rank, and each term's movement up to what is needed."""
    total = 0.0
    for fit in knowledge.record.loads:
        if not points:
            continue
        terms = knowledge.terms(fit, loads[points])
        needed = MARGIN * VERIFIED * (fit.tolerance or 1e-3 * fit.largest)
        moved = np.abs(fit.coefficients) * np.ptp(terms, axis=0) / needed
        slopes = [size for term, size in zip(fit.terms, moved.tolist(), strict=True) if term != INTERCEPT]
        total += _rank(terms) + sum(min(size, 1.0) for size in slopes)
    return total


def _rank(terms: Array) -> int:
    if not len(terms):
        return 0
    length = np.sqrt(np.einsum("ij,ij->j", terms, terms))
    values = np.linalg.svd(terms / np.where(length > 0, length, 1.0), compute_uv=False)
    return int(np.count_nonzero(values > _INDEPENDENT * values[0])) if values[0] > 0 else 0
