"""What small forces would do to the motion of an equation, and what terms in it may read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.channels import slopes
from toolkit.diagnosis.simulators.equation import failed
from toolkit.diagnosis.simulators.linear_response import propagated
from toolkit.diagnosis.simulators.user_code import silenced
from toolkit.effects.law import ITSELF, POSITION, TIME

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.ode import OdeModel
    from toolkit.diagnosis.simulators.simulator import Pattern
    from toolkit.effects.applied import AppliedEffect


def pushed(
    model: OdeModel,
    run: Run,
    p: Mapping[str, float],
    active: Sequence[AppliedEffect],
    channel: str | None,
    pattern: Pattern,
) -> dict[str, NDArray[np.float64]]:
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
        raise failed(model.case, run, f"rhs: {type(error).__name__}: {error}") from error
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


def _signals(model: OdeModel, run: Run, fine: NDArray[np.float64], at: int) -> dict[str, NDArray[np.float64]]:
    """Return what a term in the equation of a state may read, between the rows too."""
    finer = model.finer(run)
    inputs = {name: finer.columns[name] for name in model.drivers}
    return {
        **inputs, **dict(zip(model.states, fine, strict=False)), TIME: finer.t,
        ITSELF: fine[at], POSITION: fine[model.derivative_of.get(at, at)],
    }  # fmt: skip
