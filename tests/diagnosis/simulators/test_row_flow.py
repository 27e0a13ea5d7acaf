"""Steps within an interval go side by side: nodes between the rows, each a step from the next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pytest

from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.simulators.forces import Forces, ForcesTogether
from toolkit.diagnosis.simulators.row_flow import RowFlow, Rows
from toolkit.diagnosis.simulators.trajectory import Path, trajectories

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.simulators.columnwise import Columnwise


def run_of(t: Array, **columns: Array) -> Run:
    return Run(name=f"{len(t)}.csv", t=t, columns=columns, conditions={}, declared={}, simulated={})


def flow_of(rhs: Columnwise, runs: Sequence[Run], p: Mapping[str, Array], *, states: int) -> RowFlow:
    sets = len(next(iter(p.values())))
    together = ForcesTogether([Forces((), 0)] * sets, states, runs)
    return RowFlow(rhs, Rows(runs, ("u",)), p, together, np.full((states, sets), 1e-9))


def test_nodes_part_the_intervals_of_each_run_and_none_between_two() -> None:
    runs = [
        run_of(np.array([0.0, 1.0, 3.0]), u=np.array([0.0, 4.0, 2.0])),
        run_of(np.array([7.0, 9.0]), u=np.ones(2)),
    ]
    nodes = Rows(runs, ("u",)).parted(np.array([4, 2, 8, 1]))
    assert nodes.t.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 2.0, 3.0, 7.0, 9.0]
    assert nodes.u["u"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0, 1.0]
    assert nodes.at.tolist() == [0, 4, 6, 7, 8]
    assert nodes.place.tolist() == [0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0]
    assert nodes.slices == (slice(0, 7), slice(7, 9))
    assert nodes.last.tolist() == [6, 8]
    assert nodes.run.tolist() == [0] * 7 + [1] * 2


def test_from_node_to_node_a_state_comes_where_steps_one_after_the_other_lead() -> None:
    def rhs(t: Array, x: Array, u: Mapping[str, Array], p: Mapping[str, Array]) -> Array:
        return np.stack([x[1], u["u"] - p["k"] * np.sin(x[0])])

    t = np.array([0.0, 0.3, 0.5, 1.1])
    flow = flow_of(rhs, [run_of(t, u=t**2)], {"k": np.array([1.0, 3.0])}, states=2)
    x = np.random.default_rng(3).normal(size=(2, 2, 4))
    steps, sets = np.array([2, 1, 4]), np.arange(2)
    ends, errors = flow(x, steps, sets)
    nodes = flow.parted(steps)
    for row in range(3):
        y = np.zeros((2, 2, len(nodes.rows.t)))
        first, last = nodes.rows.at[row], nodes.rows.at[row + 1]
        y[:, :, first] = x[:, :, row]
        worst = np.zeros(2)
        for k in range(first, last):
            on, share = nodes.on(y, sets)
            y[:, :, k + 1], worst = on[:, :, k], np.maximum(worst, share[:, k])
        np.testing.assert_allclose(y[:, :, last], ends[:, :, row], rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(worst, errors[:, row], rtol=1e-6)


@pytest.mark.parametrize("quick", [1.0, 10.0])
def test_a_motion_that_is_quick_in_places_asks_no_more_often(quick: float) -> None:
    asked: list[int] = []

    def rhs(t: Array, x: Array, u: Mapping[str, Array], p: Mapping[str, Array]) -> Array:
        asked.append(x.shape[1])
        return np.array([p["k"] * u["u"] * np.cos(u["u"] * t)])

    t = np.arange(0.0, 10.0, 0.1)
    # An input of one row: sin(u t) goes through several turns beside it.
    u = np.where(np.arange(len(t)) == 50, quick, 1.0)
    flow = flow_of(rhs, [run_of(t, u=u)], {"k": np.ones(1)}, states=1)
    guess = Path(np.zeros((1, 1, len(t))), np.ones(len(t) - 1, dtype=np.intp), None)
    path, reached = trajectories(flow, guess, np.ones(1), np.ones(1, dtype=bool))
    assert reached.all()
    assert (int(path.steps.max()) > 8) is (quick > 1)
    begun = path.x[0, 0, :51]
    np.testing.assert_allclose(begun[:50], np.sin(t[:50]), atol=1e-6)
    # Fifteen times all rows at once: as often as steps are made finer, not as often as there are steps.
    assert len(asked) <= 7 * 15
