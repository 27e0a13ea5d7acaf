"""Where a run of an equation starts, as a number of its own for each state and run.

``initial`` puts the states at a run's first row where a case says, and what it says is often read off one
noisy row, or a rate that nobody recorded. A free simulation carries that error through the whole run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from toolkit.arrays import Array

_AT_START = " at the start of "  # no parameter of a case has spaces in its name


@dataclass(frozen=True, slots=True, kw_only=True)
class RunStart:
    """How far off ``initial`` a state of a run starts, in the state's unit, as a parameter with a prior.

    ``run`` is the run's place among those of a problem; ``sd`` the spread of the state over all runs.
    """

    state: str
    at: int
    run: int
    run_name: str
    unit: str
    sd: float
    value: float = 0.0
    bounds: None = field(default=None, init=False)

    @property
    def name(self) -> str:
        """The name under which a simulation is handed its value."""
        return start_name(self.at, self.run_name)


def start_name(state: int, run: str) -> str:
    """Return the name of the start of a run's state, by the state's place among the states."""
    return f"{state}{_AT_START}{run}"


def in_columns(sets: Sequence[Mapping[str, float]]) -> dict[str, Array]:
    """Return what several sets have of every parameter that a case's own functions know, (sets,) each."""
    return {name: np.array([each[name] for each in sets], dtype=float) for name in without_starts(sets[0])}


def without_starts(p: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters that a case's own functions know."""
    return {name: value for name, value in p.items() if _AT_START not in name}
