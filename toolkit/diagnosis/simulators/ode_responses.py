"""What small forces would do to the motion of an equation, and what terms in it may read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from toolkit.diagnosis.simulators.channels import slopes
from toolkit.diagnosis.simulators.linear_response import propagated
from toolkit.diagnosis.simulators.user_code import silenced
from toolkit.effects.law import ITSELF, POSITION, TIME

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.simulators.equation import Equation
    from toolkit.diagnosis.simulators.forces import Forces
    from toolkit.diagnosis.simulators.simulator import Output, Pattern
    from toolkit.effects.applied import AppliedEffect
    from toolkit.effects.signals import Setting


class IntegratedModel(Protocol):
    """An equation as what is asked of it beside its simulations needs it.

    ``scale`` has of every state the size of its rate and its spread; ``derivative_of`` leads from the place
    of a rate to that of the state whose rate it is; ``force_units`` has the states that a term may enter.
    """

    case: Case
    equation: Equation
    states: tuple[str, ...]
    outputs: tuple[Output, ...]
    drivers: tuple[str, ...]
    scale: dict[str, tuple[float, float]]
    derivative_of: dict[int, int]
    force_units: dict[str, str]

    def forces(self, active: Sequence[AppliedEffect]) -> Forces:
        """Return effects as forces on the equation's states."""
        ...

    def recorded(self, run: Run) -> Run:
        """Return a run with its inputs as they were recorded."""
        ...

    def tolerance(self, start: Array, acting: Forces, added: int) -> Array:
        """Return the absolute tolerance of every state, ``added`` ones among them."""
        ...

    def integrated(self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect]) -> Array:
        """Return the states of a run, (states, rows)."""
        ...

    def between(self, run: Run, p: Mapping[str, float], forces: Sequence[AppliedEffect], x: Array) -> Array:
        """Return the states also between the rows."""
        ...

    def finer(self, run: Run) -> Run:
        """Return a run with rows between its rows."""
        ...

    def steps(self, runs: Sequence[Run]) -> NDArray[np.intp]:
        """Return the steps of every interval of runs behind one another."""
        ...

    def setting(self, run: Run) -> Setting:
        """Return a run's setting."""
        ...

    def observed(self, run: Run) -> dict[str, Array]:
        """Return what was recorded of every output."""
        ...


def pushed(
    model: IntegratedModel,
    run: Run,
    p: Mapping[str, float],
    active: Sequence[AppliedEffect],
    channel: str | None,
    pattern: Pattern,
) -> dict[str, Array]:
    """Return linear responses of every output to small forces along the motion, (rows, forces)."""
    at = model.states.index(str(channel))
    forces = [applied for applied in active if applied.effect.stage == "dynamics" and applied.acts_in(run)]
    acting, own_states = model.forces(forces), len(model.states)
    x = model.integrated(run, p, forces)
    if run.rows < 2:
        return {}
    fine = model.between(run, p, forces, x)
    finer = (fine.shape[1] - 1) // (run.rows - 1)
    rates_at = model.equation.rates_at(run, p, acting, len(model.states))
    sizes = np.array([*(model.scale[name][1] for name in model.states), *acting.sizes])
    try:
        with silenced():
            moved = propagated(
                rates_at, model.finer(run).t, fine,
                pattern(_signals(model, run, fine, at)), at=at, sizes=sizes,
            )[::finer]  # fmt: skip
    except (Exception, SystemExit) as error:
        raise model.equation.failure("rhs", error, run, p) from error
    outputs = model.equation.shown(run, p, x[:own_states])
    responses = {name: np.zeros((run.rows, moved.shape[2])) for name in outputs}
    for i in range(own_states):
        shifted = x[:own_states].copy()
        shifted[i] += 1e-6 * sizes[i]
        there = model.equation.shown(run, p, shifted)
        for name, column in responses.items():
            column += ((there[name] - outputs[name]) / (1e-6 * sizes[i]))[:, None] * moved[:, i]
    shown = slopes(outputs, active, run, model.setting(run), run.columns)
    return {name: shown[name][:, None] * column for name, column in responses.items()}


def _signals(model: IntegratedModel, run: Run, fine: Array, at: int) -> dict[str, Array]:
    """Return what a term in the equation of a state may read, between the rows too."""
    finer = model.finer(run)
    inputs = {name: finer.columns[name] for name in model.drivers}
    return {
        **inputs, **dict(zip(model.states, fine, strict=False)), TIME: finer.t,
        ITSELF: fine[at], POSITION: fine[model.derivative_of.get(at, at)],
    }  # fmt: skip
