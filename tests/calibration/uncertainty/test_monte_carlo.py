"""Monte Carlo: agrees where the budget is linear, and says so where it is not."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from tests.calibration.uncertainty_factory import levels, record_of_table, table_of
from toolkit.calibration.uncertainty.budget import calibration_budget, predict
from toolkit.calibration.uncertainty.model import Budget, Component
from toolkit.calibration.uncertainty.monte_carlo import coverage_interval, monte_carlo
from toolkit.errors import SessionError


def cell(seed: int = 1, **settings: object):  # type: ignore[no-untyped-def]
    load, run, direction = levels(runs=4)
    rng = np.random.default_rng(seed)
    table = table_of((load + rng.normal(0, 0.1, len(load))) / 500, load, run=run, direction=direction)
    return record_of_table(table, **settings), table  # type: ignore[arg-type]


def only(budget: Budget, *parts: Component) -> Budget:
    """A budget of some parts alone, beside a curve that is certain."""
    fit = dataclasses.replace(budget.component("fit"), u=0.0)
    u = math.sqrt(sum(part.u**2 for part in parts))
    return dataclasses.replace(budget, components=(fit, *parts), u=u, U=1.96 * u, k=1.96, dof=math.inf)


def test_a_linear_calibration_is_validated() -> None:
    record, table = cell(
        reference={"uncertainty": {"F": {"U": 0.6, "k": 2, "unit": "N"}}}, cells={"S": {"resolution": 1e-4}}
    )
    budget = calibration_budget(record, table, None, "F")
    found = monte_carlo(record, table, budget, trials=200_000, seed=2)
    assert found.validated
    assert found.u == pytest.approx(budget.u, rel=0.01)


def test_trials_that_settle_by_themselves() -> None:
    record, table = cell(reference={"uncertainty": {"F": {"U": 0.6, "k": 2, "unit": "N"}}})
    budget = calibration_budget(record, table, None, "F")
    found = monte_carlo(record, table, budget, trials=None, seed=2)
    assert found.stable
    assert found.validated


def test_a_budget_at_the_bottom_of_a_parabola_is_not_validated() -> None:
    """F = 100 S^2 at S = 0: the slope is zero, the load is not. E(F) = 100 u^2, by hand."""
    s = np.tile(np.linspace(-2, 2, 9), 3)
    rng = np.random.default_rng(7)
    load = 100 * s**2
    table = table_of(s, load + rng.normal(0, 1e-3, len(s)))
    record = record_of_table(table, ("S", "S^2", "intercept"), cells={"S": {"u": 0.1}})
    budget = predict(record, table, None, "F", {"S": 0.0}).budget
    assert budget.component("indication").u < 1e-3
    found = monte_carlo(record, table, budget, trials=100_000, seed=3)
    assert not found.validated
    assert found.value == pytest.approx(100 * 0.1**2, rel=0.02)


def test_four_rectangular_parts_of_supplement_1() -> None:
    """JCGM 101, 9.2.3: four rectangular parts of u = 1; the interval is +-3.88, the budget +-3.92."""
    record, table = cell()
    budget = calibration_budget(record, table, None, "F", 500.0)
    parts = [dataclasses.replace(_amount(f"x{i}"), distribution="rectangular") for i in range(4)]
    found = monte_carlo(_certain(record), table, only(budget, *parts), trials=1_000_000, seed=5)
    assert found.high - found.value == pytest.approx(3.88, abs=0.01)
    assert found.u == pytest.approx(2.0, abs=0.005)
    assert found.budget_high - found.value == pytest.approx(3.92, abs=0.01)
    assert found.validated == (max(found.low_difference, found.high_difference) <= 0.05)


def test_four_normal_parts_of_supplement_1() -> None:
    """JCGM 101, 9.2.2: +-3.92."""
    record, table = cell()
    budget = calibration_budget(record, table, None, "F", 500.0)
    found = monte_carlo(
        _certain(record), table, only(budget, *(_amount(f"x{i}") for i in range(4))), trials=1_000_000, seed=5
    )
    assert found.high - found.value == pytest.approx(3.92, abs=0.01)


def test_refits_scatter_as_the_covariance_says() -> None:
    """The curve alone, with many degrees of freedom: the trials' u is J V J^T by the textbook's sum."""
    rng = np.random.default_rng(12)
    x = np.linspace(0.2, 2.0, 400)
    load = 500 * x
    table = table_of(x + rng.normal(0, 2e-4, 400), load)
    record = record_of_table(table)
    budget = calibration_budget(record, table, None, "F", 900.0)
    fit = budget.component("fit")
    bare = dataclasses.replace(budget, components=(fit,), u=fit.u, U=1.966 * fit.u)
    s, x = record.loads[0].residual_sd, table.column("S")
    assert s is not None
    textbook = s * math.sqrt(1 / 400 + (budget.indications[0] - x.mean()) ** 2 / np.sum((x - x.mean()) ** 2))
    found = monte_carlo(record, table, bare, trials=100_000, seed=1)
    # t of 398 degrees of freedom: variance 398/396.
    assert found.u == pytest.approx(textbook * math.sqrt(398 / 396), rel=0.01)


def test_the_same_seed_gives_the_same_result() -> None:
    record, table = cell()
    budget = calibration_budget(record, table, None, "F")
    one, other, third = (monte_carlo(record, table, budget, trials=10_000, seed=s) for s in (1, 1, 2))
    assert one == other
    assert one != third


def test_the_interval_leaves_the_same_on_both_sides() -> None:
    low, high = coverage_interval(np.random.default_rng(1).permutation(np.arange(1.0, 1001.0)), 0.95)
    assert (low, high) == (25.0, 975.0)


@pytest.mark.parametrize("trials", [0, 9_999, 10**9])
def test_a_number_of_trials_that_tells_nothing_is_refused(trials: int) -> None:
    record, table = cell()
    with pytest.raises(SessionError):
        monte_carlo(record, table, calibration_budget(record, table, None, "F"), trials=trials)


def _amount(name: str) -> Component:
    return Component(
        name=name, description="", type="B", distribution="normal", u=1.0, dof=math.inf, source="a test"
    )


def _certain(record):  # type: ignore[no-untyped-def]
    """The record with residuals of nothing: its refits do not move."""
    one = dataclasses.replace(record.loads[0], residual_sd=0.0)
    return dataclasses.replace(record, loads=(one,))
