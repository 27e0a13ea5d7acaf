"""Laws that only tell runs apart: what stands still within a run explains its zero and its gain alone.

Runs of the same thing differ a little, and any signal that has another level in every run (a load, a
temperature) follows such differences as well as the few runs let it. Hundreds of rows are then no evidence:
of a run's zero there is one value a run. A law that mends nothing beside zeros and gains of runs has to be
significant among the runs alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import LAWS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.law.trial import Trial

    Array = NDArray[np.float64]


def tells_runs_apart_alone(trial: Trial, looked: int, runs: Sequence[tuple[Array, Array, Array]]) -> bool:
    """Tell whether a law takes only what differs from run to run, and no more of it than chance gives.

    Parameters
    ----------
    looked : laws that were looked at
    runs : of every run the simulated output, and its held-out errors without and with the law
    """
    from scipy.stats import chi2

    (within, among), (within_after, among_after) = (
        _parts([(simulated, errors[k]) for simulated, *errors in runs]) for k in (0, 1)
    )
    if within_after < (1 - LAWS.share) * within:
        return False
    gain = len(runs) * math.log(max(among, 1e-300) / max(among_after, 1e-300))
    return float(chi2.sf(max(gain, 0.0), trial.cost)) * max(looked, 1) * trial.looked >= LAWS.alpha


def _parts(runs: Sequence[tuple[Array, Array]]) -> tuple[float, float]:
    """Return the mean squares of errors less what zeros and gains of runs take, and of what these take.

    A zero and a gain that all runs have alike are none of a run's own.
    """
    designs = [np.column_stack([np.ones(len(simulated)), simulated]) for simulated, _ in runs]
    stacked = np.concatenate([error for _, error in runs])
    common = np.linalg.lstsq(np.vstack(designs), stacked, rcond=None)[0]
    own = np.concatenate(
        [
            design @ (np.linalg.lstsq(design, error, rcond=None)[0] - common)
            for design, (_, error) in zip(designs, runs, strict=True)
        ]
    )
    return float(np.mean((stacked - own) ** 2)), float(np.mean(own**2))
