"""Whether the runs disagree about a parameter of the simulation: a value of its own fits each, no common one.

What is wrong is then a statement about the runs' conditions, and no physics that the equation lacks. It is
told where own values take nearly all that is above the sensor's noise, are further apart than their standard
errors let them be by chance, and leave far less than all that was found.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.run_scatter import run_parameter
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.policy import EVEN, SCATTER, SCREENING
from toolkit.diagnosis.search.screen import trust_of
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.folds import HeldOut
    from toolkit.diagnosis.fit.run_scatter import RunParameter
    from toolkit.diagnosis.search.search import Search


def with_disagreement(search: Search, held_out: HeldOut, budget: TimeBudget) -> Search:
    """Return a search with the parameter that its runs disagree about, as it was where there is none.

    Parameters
    ----------
    held_out : unseen rows by all that was found
    """
    problem, base = search.problem, search.refitted
    parts = {name: noise_parts(problem, base, name) for name in problem.names if problem.kept[name].any()}
    if search.skipped or all(part.process_sd <= part.sensor_sd for part in parts.values()):
        return search
    with contextlib.suppress(BudgetSpentError, FitError):
        budget.check("whether the runs agree")
        own = run_parameter(problem, base, least=SCATTER.halved)
        if own is None or not _is_apart(own, len(problem.free)):
            return search
        for name, part in parts.items():
            before, left, sensor = part.total_sd**2, own.left[name], part.sensor_sd**2
            error = (problem.observed[name] - held_out.simulated[name])[problem.kept[name]]
            takes = before - left > SCATTER.nearly * (before - sensor) > 0
            if takes and left < SCATTER.halved * float(np.mean(error**2)):
                return replace(search, disagreed=own)
    return search


def _is_apart(own: RunParameter, tests: int) -> bool:
    """Tell whether values of runs scatter by more than chance lets them (Cochran's test of homogeneity)."""
    from scipy.stats import chi2

    values = np.array([value for _, value, _ in own.values])
    weights = 1 / np.maximum([sd for _, _, sd in own.values], 1e-300) ** 2
    mean = float(weights @ values) / float(weights.sum())
    statistic = float(weights @ (values - mean) ** 2) * _trust(own)
    return tests * float(chi2.sf(statistic, len(values) - 1)) < SCREENING.alpha


def _trust(own: RunParameter) -> float:
    """Return the share of a squared distance that runs leave each of which shows its noise's colour alone."""
    return trust_of(own.worth / EVEN.cautious) / EVEN.cautious


def errors_apart(own: RunParameter) -> float:
    """Return how far the smallest and the largest value are apart, in standard errors of their difference."""
    (_, low, first), (_, high, last) = own.ends
    return (high - low) * math.sqrt(_trust(own)) / max(math.hypot(first, last), 1e-300)
