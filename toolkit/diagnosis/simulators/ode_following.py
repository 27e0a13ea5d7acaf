"""An equation with its parameters and forces, led along the recording of its runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.channels import slopes, through_channels
from toolkit.diagnosis.simulators.following import Followed, Linear, follow
from toolkit.diagnosis.simulators.forces import ForcesTogether
from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows
from toolkit.diagnosis.simulators.run_starts import in_columns
from toolkit.diagnosis.simulators.trajectory import flow_slopes
from toolkit.diagnosis.simulators.user_code import silenced
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.simulators.ode_responses import IntegratedModel
    from toolkit.diagnosis.simulators.simulator import Following
    from toolkit.effects.applied import AppliedEffect


_STEP = 1e-6  # of a state's size, for differences
_TURNING_STEPS = 8  # of every interval, where a bristle turns
_FEWEST = 3  # rows of a run


def followed(
    model: IntegratedModel,
    runs: Sequence[Run],
    p: Mapping[str, float],
    active: Sequence[AppliedEffect],
    asked: Following,
) -> tuple[Followed, Array]:
    """Return an equation along the recording of runs, and how its prediction errors answer to parameters.

    The answers are those to one of ``asked.steps`` of each parameter, (rows, outputs, parameters).

    Raises
    ------
    FitError
        the equation takes no columns, or there is no following it
    """
    if model.equation.columns is None or min(run.rows for run in runs) < _FEWEST:
        raise _not_followed(model, "an equation that is asked row by row, or a run of two rows")
    names = [output.name for output in model.outputs]
    forces = [applied for applied in active if applied.effect.stage == "dynamics"]
    acting, rows = model.forces(forces), Rows(runs, model.drivers)
    spread = np.array([*(model.scale[name][1] for name in model.states), *acting.sizes])
    fastest = np.array([model.scale[name][0] if name in model.force_units else 0.0 for name in model.states])
    steps = np.maximum(model.steps(runs), _TURNING_STEPS if acting.slides(len(model.states)) else 1)
    recorded = np.stack([np.concatenate([_read(model, run, name) for run in runs]) for name in names])
    for k, name in enumerate(names):
        recorded[k, list(asked.unread.get(name, ()))] = np.nan

    def flow(sets: Sequence[Mapping[str, float]]) -> RowFlow:
        together = ForcesTogether([acting] * len(sets), len(model.states), runs)
        assert model.equation.columns is not None  # noqa: S101  asked above
        atol = _STEP * np.repeat(spread[:, None], len(sets), axis=1)
        return RowFlow(model.equation.columns, rows, in_columns(sets), together, atol)

    def shown(x: Array, values: Mapping[str, float]) -> Array:
        parts = []
        for run, at in zip(runs, rows.slices, strict=True):
            outputs = model.equation.shown(run, values, x[: len(model.states), at])
            through = through_channels(outputs, active, run, model.setting(run), run.columns)
            parts.append(np.stack([through[name] for name in names]))
        return np.concatenate(parts, axis=1)

    def shows(x: Array) -> Array:
        """Return d(shown)/d(state), (rows, outputs, states), what takes time to show it as if it did not."""
        made = np.zeros((x.shape[1], len(names), len(x)))
        for run, at in zip(runs, rows.slices, strict=True):
            plain = model.equation.shown(run, p, x[: len(model.states), at])
            through = slopes(plain, active, run, model.setting(run), run.columns)
            for i in range(len(model.states)):
                moved = x[: len(model.states), at].copy()
                moved[i] += _STEP * spread[i]
                there = model.equation.shown(run, p, moved)
                for k, name in enumerate(names):
                    made[at, k, i] = through[name] * (there[name] - plain[name]) / (_STEP * spread[i])
        return made

    one, alone = np.zeros(1, dtype=np.intp), flow([p])
    interval = np.diff(rows.t)

    def linear_about(x: Array) -> Linear:
        ends, _ = alone(x[:, None], steps, one)
        derivatives = flow_slopes(alone, x[:, None], ends, steps, one, spread)[:, 0]
        # A rate that is constant until the next row, carried on by the equation, to the second order.
        own = np.eye(len(x))[:, : len(model.states)]
        entry = 0.5 * interval[:, None, None] * (own + derivatives @ own)
        return Linear(ends[:, 0], derivatives, entry, shown(x, p), shows(x))

    try:
        with silenced(), np.errstate(all="ignore"):
            guess = np.concatenate([model.integrated(run, p, forces) for run in runs], axis=1)
            made = follow(
                linear_about, guess, recorded, rows.slices, spread=spread, fastest=fastest,
                sensor=np.array([asked.sensor[name] for name in names]), steadier=asked.steadier,
            )  # fmt: skip
            moved = [{**p, name: p[name] + step} for name, step in asked.steps.items()]
            answers = np.zeros((len(rows.t), len(names), len(moved)))
            if moved:
                there = np.repeat(made.states[:, None], len(moved), axis=1)
                every = np.arange(len(moved), dtype=np.intp)
                ends, _ = flow(moved)(there, steps, every)
                before = shown(made.states, p)
                outputs = np.stack([shown(made.states, values) - before for values in moved], axis=2)
                added = ends - alone(made.states[:, None], steps, one)[0]
                added[:, :, rows.last[:-1]] = 0.0
                answers = made.answers(added, outputs.transpose(1, 0, 2))
    except FitError:
        raise
    except (Exception, SystemExit) as error:
        raise _not_followed(model, f"{type(error).__name__}: {error}") from error
    if not np.isfinite(made.states).all() or not np.isfinite(answers).all():
        raise _not_followed(model, "states without bound")
    return made, answers


def _read(model: IntegratedModel, run: Run, name: str) -> Array:
    return np.asarray(model.observed(run).get(name, np.full(run.rows, np.nan)))


def _not_followed(model: IntegratedModel, got: str) -> FitError:
    return FitError(
        "the equation cannot be led along the recording", where=str(model.case.simulation.path), got=got,
        expected="an equation whose states follow what was recorded",
        next_step="none is needed: the search goes on by free simulations", rule="simulator",
    )  # fmt: skip
