"""Planned rows get the budget that they would get as a session, and a misfit is seen as often as is said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from toolkit.calibration.terms import term_matrix
from toolkit.planning.fixtures import FeasibleLoads
from toolkit.planning.knowledge import Knowledge


def test_the_budget_of_a_plan_of_the_same_rows_is_the_records_own(knowledge: Knowledge) -> None:
    """Components that the rows do not change are equal; that of the fit differs by its run effects alone."""
    for planned, own in zip(knowledge.repeated(), knowledge.today, strict=True):
        for name in ("reference", "repeatability", "resolution"):
            assert planned.component(name).u == pytest.approx(own.component(name).u)
        assert planned.component("fit").u >= own.component("fit").u * (1 - 1e-3)
        assert planned.component("fit").u == pytest.approx(own.component("fit").u, rel=0.5)


def test_the_fits_part_falls_as_the_root_of_repeated_sessions(knowledge: Knowledge) -> None:
    """Twice the runs of the same rows: the variance of the coefficients halves, whatever it is made of."""
    names = knowledge.names
    loads = knowledge.loads.matrix(names)
    run = np.asarray(knowledge.loads.run, dtype=np.intp) - 1
    up = np.asarray(knowledge.loads.up)
    once = knowledge.expected(knowledge.table(loads, run, up))
    twice = knowledge.expected(
        knowledge.table(np.tile(loads, (2, 1)), np.concatenate([run, run + 3]), np.tile(up, 2))
    )
    for single, double in zip(once, twice, strict=True):
        ratio = double.component("fit").u / single.component("fit").u
        assert ratio == pytest.approx(1 / np.sqrt(2), rel=1e-6)


def test_nothing_that_more_rows_can_do_goes_below_the_floor(knowledge: Knowledge) -> None:
    for at, budget in enumerate(knowledge.repeated()):
        assert knowledge.floor(at) < budget.U


def test_a_misfit_of_the_visible_size_is_seen_in_four_of_five_sessions(
    knowledge: Knowledge, feasible: FeasibleLoads
) -> None:
    """An F test of the parabola, simulated apart from the formula."""
    rng = np.random.default_rng(3)
    loads = np.tile(feasible.loads, (3, 1))
    run = np.repeat(np.arange(3), len(feasible.loads))
    table = knowledge.table(loads, run, np.ones(len(loads), dtype=bool))
    fit, own = knowledge.record.loads[0], knowledge.scatter[0].runs
    size = knowledge.visible_misfit(table)[0]
    assert size is not None
    parabola = (table.column(fit.load) / fit.largest) ** 2
    zeros = (run[:, None] == np.arange(3)).astype(float)
    X = np.column_stack([term_matrix(fit.terms, table.columns(knowledge.record.indications)), zeros[:, 1:]])
    full = np.column_stack([X, parabola])
    dof = len(loads) - full.shape[1]
    seen = 0
    for _ in range(2000):
        y = size * parabola + rng.normal(size=len(loads)) * own.within
        less, more = (np.sum((y - Z @ np.linalg.lstsq(Z, y, rcond=None)[0]) ** 2) for Z in (X, full))
        seen += (less - more) / (more / dof) > stats.f.ppf(0.95, 1, dof)
    assert seen / 2000 == pytest.approx(0.80, abs=0.03)


def test_two_levels_show_no_misfit(knowledge: Knowledge) -> None:
    loads = np.array([[0.0, 0.0, 0.0], [1000.0, 100.0, 1000.0]])[np.tile([0, 1], 15)]
    table = knowledge.table(loads, np.repeat(np.arange(3), 10), np.ones(30, dtype=bool))
    assert knowledge.visible_misfit(table) == (None, None, None)


def test_few_runs_are_not_taken_to_be_alike(knowledge: Knowledge) -> None:
    """The record's three runs show no difference; a plan allows for one."""
    for own, planned in zip(knowledge.scatter, knowledge.runs, strict=True):
        assert planned.within == own.runs.within
        assert planned.gain > own.runs.gain
        assert planned.zero > own.runs.zero or knowledge.record.zero == "run"
