"""What only tells runs apart: a zero and a gain of each, one independent value a run.

What stands still within a run explains its zero and its gain alone, as does an effect of one run. Runs of the
same thing differ a little, and any signal that has another level in every run (a load, a temperature)
follows such differences as well as the few runs let it. Hundreds of rows are then no evidence: of a run's
zero there is one value a run. What mends nothing beside zeros and gains of runs has to be significant among
the runs alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import LAWS

if TYPE_CHECKING:
    from toolkit.arrays import Array


def tells_runs_apart_alone(
    runs: Sequence[tuple[Array, Array, Array]], *, cost: int, tests: int,
    alpha: float = LAWS.alpha, of_some: bool = False,
) -> bool:  # fmt: skip
    """Tell whether something takes only what differs from run to run, and no more of it than chance gives.

    Parameters
    ----------
    runs : of every run what a run's own size would be in proportion to, (n,) or (n, k), and the errors of an
        output without it and with it
    cost : number of its parameters
    tests : how many were looked at
    of_some : it acts in some of the runs alone, and what all have alike is none of its own
    """
    from scipy.stats import chi2

    (within, among), (within_after, among_after) = (
        _parts([(simulated, errors[k]) for simulated, *errors in runs], of_some=of_some) for k in (0, 1)
    )
    if within_after < (1 - LAWS.share) * within:
        return False
    gain = len(runs) * math.log(max(among, 1e-300) / max(among_after, 1e-300))
    return float(chi2.sf(max(gain, 0.0), cost)) * tests >= alpha


def _parts(runs: Sequence[tuple[Array, Array]], *, of_some: bool) -> tuple[float, float]:
    """Return the mean squares of errors less what zeros and gains of runs take, and of what these take.

    A zero and a gain that all runs have alike are none of a run's own: something that acts in all of them may
    take these, something that acts in some (``of_some``) may not.
    """
    designs = [np.column_stack([np.ones(len(simulated)), simulated]) for simulated, _ in runs]
    stacked = np.concatenate([error for _, error in runs])
    common = np.linalg.lstsq(np.vstack(designs), stacked, rcond=None)[0]
    own = [
        np.linalg.lstsq(design, error, rcond=None)[0]
        for design, (_, error) in zip(designs, runs, strict=True)
    ]
    of_a_run = np.concatenate([design @ (size - common) for design, size in zip(designs, own, strict=True)])
    shared = np.vstack(designs) @ common if of_some else 0.0
    return float(np.mean((stacked - of_a_run - shared) ** 2)), float(np.mean(of_a_run**2))
