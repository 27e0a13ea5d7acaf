"""Laws of an equation that its prediction errors propose, from row to row along the recording.

Where something large is missing, a refit has driven the parameters off, and the free simulation is elsewhere
than the plant: a limit of what it can no longer reach does not show there. Along the recording it does.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.law.ranking import at_coefficients, p_value, pattern_of
from toolkit.diagnosis.law.trial import amplitudes
from toolkit.diagnosis.policy import FOLLOWING, LAWS, PRIORS
from toolkit.diagnosis.search.prediction_errors import errors_along

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.trial import Trial
    from toolkit.diagnosis.search.prediction_errors import PredictionErrors


def shown_from_row_to_row(
    problem: Problem, base: Fit, trials: Sequence[Trial], weight: float
) -> list[tuple[Trial, tuple[float, ...]]]:
    """Return laws that take a good part of the prediction errors, the best first, and the parameters there.

    Parameters
    ----------
    trials : laws at their starts; those that have no memory and enter an equation are asked
    weight : what a parameter costs of the log-likelihood
    """
    asked = [trial for trial in trials if trial.acts == "enters" and trial.form == "static"]
    errors = errors_along(problem, base, 1.0) if asked else None
    if errors is None:
        return []

    def worth(trial: Trial) -> float:
        return trial.gain - 2 * weight * trial.cost

    best: dict[object, tuple[Trial, tuple[float, ...]]] = {}
    for trial, answers in _answered(errors, asked, LAWS.columns // max(problem.rows, 1)):
        gain, sizes = errors.gain(answers)
        made = replace(at_coefficients(trial, sizes.tolist()), gain=gain)
        if trial.place in best and worth(made) <= worth(best[trial.place][0]):
            continue
        p = errors.parameters(answers @ sizes)
        if np.all(np.abs(problem.off_priors(p)) <= PRIORS.far):  # else it and a parameter undo each other
            best[trial.place] = made, p
    shown = [
        entry
        for entry in best.values()
        if errors.share(entry[0].gain) > FOLLOWING.least and p_value(entry[0], len(trials)) < LAWS.alpha
    ]
    return sorted(shown, key=lambda entry: -worth(entry[0]))


def _answered(errors: PredictionErrors, trials: Sequence[Trial], limit: int) -> Iterator[tuple[Trial, Array]]:
    """Give laws with the answers to their amplitudes, as many columns at once as may be held."""
    for channel in dict.fromkeys(trial.applied.channel for trial in trials):
        own = [trial for trial in trials if trial.applied.channel == channel]
        size = max(limit // 2, 1)
        for part in (own[i : i + size] for i in range(0, len(own), size)):
            answers, at = errors.answers_to(str(channel), pattern_of(part)), 0
            for trial in part:
                width = len(amplitudes(trial.applied))
                yield trial, answers[:, at : at + width]
                at += width
