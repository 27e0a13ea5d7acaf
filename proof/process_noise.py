"""Process noise: the states of a plant are pushed at random, another way in every run.

It is no effect: nothing that was recorded tells it, and nothing of it comes again in what is to be predicted.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from proof import size as sizing
from proof.model import Array, Params, Run, Scenario

MEMORY_ROWS = 4.0


def stirred(
    s: Scenario,
    p: Params,
    effects: dict[str, dict[str, Any]],
    wanted: float,
    rng: np.random.Generator,
    still: sizing.Signals,
) -> tuple[Scenario, float, sizing.Signals]:
    """Return the scenario with pushes in its recorded runs, what they add to an output, in noise sd, and the
    outputs with them.

    They are scaled so that they add about `wanted` to the output that shows them most; `still` are the
    outputs without them.
    """
    pushes = [_push(run, rng) for run in s.runs]

    def at(scale: float) -> tuple[Scenario, float, sizing.Signals]:
        runs = tuple(
            dataclasses.replace(run, fine={**run.fine, "push": scale * push})
            for run, push in zip(s.runs, pushes, strict=True)
        )
        pushed = sizing.truth_of(s, runs, p, effects)
        added = sizing.difference(pushed, still)
        sizes = [
            float(np.sqrt(np.mean(np.concatenate([row[k] for row in added]) ** 2))) / s.noise[k].sd
            for k in s.outputs
        ]
        return dataclasses.replace(s, runs=runs), max(sizes), pushed

    scale = 1e-3
    for _ in range(3):
        scale *= wanted / max(at(scale)[1], 1e-12)
    return at(scale)


def _push(run: Run, rng: np.random.Generator) -> Array:
    """Return an Ornstein-Uhlenbeck process of unit variance on the fine grid."""
    t = run.fine["t"]
    step = float(run.rows[1] - run.rows[0])
    keeps = float(np.exp(-(t[1] - t[0]) / (MEMORY_ROWS * step)))
    push = rng.standard_normal(t.size)
    for i in range(1, t.size):
        push[i] = keeps * push[i - 1] + np.sqrt(1 - keeps**2) * push[i]
    return push
