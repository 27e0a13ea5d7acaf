"""A state that cannot rise beyond a level: a tank that runs over, into the next one or beside it."""

from __future__ import annotations

from typing import Any

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.surroundings import Surroundings

_WIDTH = 1e-3  # of the state's spread, over which the rate falls to nothing


def _stopped(state: Any, spread: float, values: Values) -> Any:
    # In place of `clip`, which takes ten times as long of the one number that a step asks for.
    return np.minimum(np.maximum((values["level"] - state) / (_WIDTH * spread), 0.0), 1.0)


def _highest(case: Surroundings) -> float:
    return case.motion.level


def _feeds_none(case: Surroundings) -> bool:
    return case.motion.feeds is None


EFFECT = Effect(
    name="overflow",
    stage="dynamics",
    rank=7,
    in_time=False,
    statement="The state runs over: beyond a level it cannot rise.",
    equation="x' = min(x', 0) where x >= level; share of what is held back is added to the next state's rate",
    reference="mass balance of an open tank",
    signature="flat tops while the input goes on",
    separates="a run that stays below the level",
    parameters=(
        EffectParameter(
            name="level",
            unit="{position}",
            text="that the state cannot pass",
            typical=(0.5, 0.98),
            off=float("inf"),
            scale=_highest,
            starts=(0.4, 0.5, 0.6, 0.68, 0.76, 0.84, 0.9, 0.95),
        ),
        EffectParameter(
            name="share",
            unit="1",
            text="of what runs over that arrives in the state that this one feeds",
            typical=(0.0, 1.0),
            off=None,
            bounds=(0.0, 1.0),
            starts=(0.0, 0.7),
            absent=0.0,
            ends_count=True,
            needless=_feeds_none,
            equation_without="x' = min(x', 0) where x >= level",
        ),
    ),
    term=Term(of="state", limit=_stopped, spill="share", shares=(1.0,)),
    reshapes=True,
)
