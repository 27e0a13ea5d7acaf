"""Rows keep their mounts together, go up and then down, and answer little to a drift."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from toolkit.planning.fixtures import FeasibleLoads
from toolkit.planning.session_plan import in_order, visits


def hanging(amounts: list[float], mounts: list[str]) -> FeasibleLoads:
    return FeasibleLoads(
        source="a test", loads=np.array(amounts)[:, None], mount=tuple(mounts), label=tuple(mounts),
        amount=np.array(amounts), minutes=None, setup_minutes=None, run_minutes=None,
    )  # fmt: skip


def test_a_mount_is_loaded_up_and_then_down() -> None:
    feasible = hanging([0, 1, 2, 3, 1], ["", "a", "a", "a", "b"])
    chosen = np.array([2, 4, 1, 3, 2, 1])
    up = np.array([True, True, True, True, False, False])
    groups = visits(np.arange(6), chosen, feasible, up)
    assert [rows.tolist() for rows in groups] == [[2, 0, 3, 4, 5], [1]]


def test_every_row_comes_once_and_drift_is_balanced() -> None:
    """Four mounts of one row each with weights 3, 1, -1, -3: some order leaves little."""
    weights = np.array([[3.0, 1.0, -1.0, -3.0]])
    runs = [[np.array([row]) for row in range(4)]]
    order, answers = in_order(runs, weights, np.zeros((1, 4)), np.random.default_rng(0))
    assert sorted(order.tolist()) == [0, 1, 2, 3]
    rising = abs(float(weights[0] @ np.linspace(-0.5, 0.5, 4)))
    assert answers[0, 0] < 0.15 * rising
    assert answers[0, 1] == 0


def test_creep_is_the_change_from_the_load_before() -> None:
    """One row after nothing: the whole of its load is new."""
    order, answers = in_order(
        [[np.array([0])]], np.array([[2.0]]), np.array([[0.5]]), np.random.default_rng(0)
    )
    assert order.tolist() == [0]
    assert answers[0].tolist() == [0.0, 1.0]


@pytest.mark.parametrize("seed", range(6))
def test_of_few_mounts_the_order_is_the_best_of_all(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, 5)
    groups = np.split(np.arange(sizes.sum()), np.cumsum(sizes)[:-1])
    weights, relative = rng.normal(size=(2, 3, sizes.sum()))
    _, answers = in_order([groups], weights, relative, np.random.default_rng(seed))
    least = min(
        (in_order([[np.concatenate([groups[at] for at in order])]], weights, relative, rng)[1] ** 2).sum()
        for order in itertools.permutations(range(5))
    )
    assert (answers**2).sum() == pytest.approx(least, rel=1e-9)
