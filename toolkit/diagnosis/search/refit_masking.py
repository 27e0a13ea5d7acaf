"""Physics that the refit of the nominal parameters has absorbed: candidates seen from the declared values.

Where a parameter left its prior far behind, it stands in for something that was left out. Seen from there
the true effect looks small, because what it explains is explained already, and another one that only mends
what the parameter could not do looks large. From the declared values the true effect is large; joint fits,
with the priors in their score, decide between the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.policy import PRIORS
from toolkit.diagnosis.search.candidates import Candidate
from toolkit.diagnosis.search.screen import Screen, best_of
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem


Key = tuple[str, str | None, str | None, frozenset[str] | None]


def absorbed(problem: Problem, base: Fit, left: Sequence[Candidate]) -> frozenset[Key]:
    """Return the candidates that explain most from the declared parameters; none where they hold.

    Parameters
    ----------
    base : the fit so far, its effects with their values
    left : candidates that may be added to it
    """
    moved = [
        abs(value - one.value) / one.sd
        for value, one in zip(base.p, problem.free, strict=True)
        if one.sd is not None
    ]
    if not moved or max(moved) < PRIORS.far:
        return frozenset()
    declared = tuple(one.value for one in problem.free)
    try:
        simulated = problem.simulate(declared, base.active)
    except FitError:  # from there, an effect that was found already is beyond what can be simulated
        return frozenset()
    residual = {name: problem.observed[name] - values for name, values in simulated.items()}
    screen = Screen.of(problem, replace(base, p=declared, simulated=simulated, residual=residual))
    ranked = best_of([one for each in left for one in screen.score(each)])
    return frozenset(one.candidate.key for one in ranked[: PRIORS.masked])
