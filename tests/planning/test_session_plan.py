"""A plan keeps what it was asked for, is the shorter the less is asked, and says what is out of reach."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.planning.test_fixtures import made
from toolkit.errors import ConfigError
from toolkit.planning import session_search
from toolkit.planning.fixtures import FeasibleLoads
from toolkit.planning.knowledge import Knowledge
from toolkit.planning.row_exchange import Criterion
from toolkit.planning.session_plan import SessionPlan, plan_session
from toolkit.planning.session_search import Demand

FIXTURES = """schema = 1
instrument = "m15-virtual"
run_minutes = 5
[[fixture]]
name = "lateral pull"
per_newton = { FY = 1.0 }
weights = { value = [2000, 4000, 6200], unit = "N" }
minutes = 2
setup_minutes = 8
[[fixture]]
name = "turning couple"
per_newton = { MZ = 0.5 }
weights = { value = [130, 260, 400], unit = "N" }
minutes = 2
setup_minutes = 10
[[fixture]]
name = "tilting couple"
per_newton = { MX = 0.8 }
weights = { value = [800, 1600, 2370], unit = "N" }
minutes = 3
setup_minutes = 10
"""


@pytest.fixture(scope="module")
def fixtures(tmp_path_factory: pytest.TempPathFactory, knowledge: Knowledge) -> FeasibleLoads:
    return made(tmp_path_factory.mktemp("fixtures"), knowledge, FIXTURES)


@pytest.fixture
def few_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sessions of three or four runs: those of more, up to ten, are searched in the same way."""
    monkeypatch.setattr(session_search, "MOST_RUNS", 4)


@pytest.fixture(scope="module")
def fewest(knowledge: Knowledge, feasible: FeasibleLoads) -> SessionPlan:
    return plan_session(knowledge, feasible, Demand(simulated=8))


def test_a_fifth_of_the_loads_keeps_u_within_a_twentieth(fewest: SessionPlan) -> None:
    assert len(fewest.rows) <= fewest.rows_today / 5
    assert fewest.runs >= 3
    for load in fewest.outlook:
        assert load.U <= 1.05 * load.U_repeated * (1 + 1e-9)
        assert load.floor < load.U_expected < load.U < load.U_in_nine_of_ten


def test_every_sign_is_verified_and_no_check_load_is_a_row(fewest: SessionPlan) -> None:
    assert all(entry.verified for entry in fewest.verification)
    assert not {row.loads for row in fewest.check} & {row.loads for row in fewest.rows}
    assert fewest.findings == ()


def test_rows_go_up_and_down_at_several_levels_in_every_run(fewest: SessionPlan) -> None:
    assert {row.direction for row in fewest.rows} == {"up", "down"}
    levels = {round(abs(row.loads[0]) / 1393.8, 1) for row in fewest.rows}
    assert len(levels - {0.0}) >= 2  # a line through its ends alone shows no lack of fit
    assert fewest.replicates > 0
    for run in range(1, fewest.runs + 1):
        keys = [(row.mount, row.label, row.direction) for row in fewest.rows if row.run == run]
        assert len(keys) == len(set(keys))


def test_the_same_seed_gives_the_same_plan(
    knowledge: Knowledge, feasible: FeasibleLoads, fewest: SessionPlan
) -> None:
    again = plan_session(knowledge, feasible, Demand(simulated=8))
    assert again.rows == fewest.rows
    assert again.outlook == fewest.outlook


@pytest.mark.campaign(
    "one more search: an uncertainty that cannot be had names the nearest plan in every run"
)
@pytest.mark.usefixtures("few_runs")
def test_less_uncertainty_takes_more_loads(
    knowledge: Knowledge, feasible: FeasibleLoads, fewest: SessionPlan
) -> None:
    asked = 0.5 * (fewest.outlook[0].U + fewest.outlook[0].U_repeated)
    plan = plan_session(knowledge, feasible, Demand(U=(("FY", asked),), simulated=8))
    assert plan.outlook[0].U <= asked * (1 + 1e-9)
    assert len(plan.rows) > len(fewest.rows)
    assert plan.outlook[1].U_asked is None


def test_an_uncertainty_below_the_floor_names_the_nearest_plan(
    knowledge: Knowledge, feasible: FeasibleLoads
) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, feasible, Demand(U=(("FY", 0.1),), simulated=8))
    assert refused.value.rule == "plan-infeasible"
    assert "nearest: FY 0.2" in str(refused.value.expected)
    assert "reference" in str(refused.value.next_step)


@pytest.mark.usefixtures("few_runs")
def test_time_is_kept_with_mounts_runs_and_check_loads(knowledge: Knowledge, fixtures: FeasibleLoads) -> None:
    plan = plan_session(knowledge, fixtures, Demand(minutes=330, simulated=8))
    assert plan.minutes is not None
    assert plan.minutes <= 330
    assert fixtures.minutes is not None
    setup = fixtures.setup_minutes or {}
    by_hand = plan.runs * 5.0
    for rows in (plan.rows, plan.check):
        by_hand += sum(setup[mount] for _, mount in {(row.run, row.mount) for row in rows} if mount)
        for row in rows:
            at = int(np.flatnonzero((fixtures.loads == row.loads).all(axis=1))[0])
            by_hand += float(fixtures.minutes[at])
    assert plan.minutes == pytest.approx(by_hand)


def test_too_little_time_names_the_shortest_plan(knowledge: Knowledge, fixtures: FeasibleLoads) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, fixtures, Demand(minutes=60, simulated=8))
    assert refused.value.rule == "plan-infeasible"
    assert "nearest: 3" in str(refused.value.expected)


def test_minutes_need_fixtures_that_state_them(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, feasible, Demand(minutes=60, simulated=8))
    assert refused.value.rule == "plan-fixtures"


@pytest.mark.usefixtures("few_runs")
def test_contradictory_demands_name_both_ways_out(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, feasible, Demand(U=(("FY", 0.262),), loads=30, simulated=8))
    assert refused.value.rule == "plan-infeasible"
    assert "for this U; or 30 loads" in str(refused.value.expected)


@pytest.mark.campaign("one more search: time, uncertainty and loads are each kept by a plan in every run")
@pytest.mark.usefixtures("few_runs")
def test_more_loads_than_serve_are_no_plan_of_their_own(
    knowledge: Knowledge, feasible: FeasibleLoads, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_search, "MOST_ROWS", 48)
    plan = plan_session(knowledge, feasible, Demand(loads=10**9, simulated=2))
    assert 36 <= len(plan.rows) <= 48


def test_fewer_loads_than_the_standard_asks_for_are_refused(
    knowledge: Knowledge, feasible: FeasibleLoads
) -> None:
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, feasible, Demand(loads=29, simulated=8))
    assert "--loads 30" in str(refused.value.next_step)


def test_a_load_that_nothing_makes_is_named(knowledge: Knowledge, feasible: FeasibleLoads) -> None:
    loads = feasible.loads.copy()
    loads[:, 1] = 0.0
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, dataclasses.replace(feasible, loads=loads), Demand(simulated=8))
    assert refused.value.rule == "plan-fixtures"
    assert "MZ" in str(refused.value)


def with_one_weight(text: str) -> str:
    """Return fixtures of one weight each that pull one way."""
    for weights, weight in (
        ("2000, 4000, 6200", "6200"),
        ("130, 260, 400", "400"),
        ("800, 1600, 2370", "2370"),
    ):
        text = text.replace(f"[{weights}]", f"[{weight}]")
    return text.replace("minutes = 2\n", "minutes = 2\nboth = false\n").replace(
        "= 3\n", "= 3\nboth = false\n"
    )


def test_loads_of_two_levels_are_refused_unless_that_is_asked_for(
    tmp_path: Path, knowledge: Knowledge
) -> None:
    two = made(tmp_path, knowledge, with_one_weight(FIXTURES))
    with pytest.raises(ConfigError) as refused:
        plan_session(knowledge, two, Demand(loads=36, simulated=2))
    assert refused.value.rule == "plan-infeasible"
    assert "--two-levels" in str(refused.value.next_step)
    plan = plan_session(knowledge, two, Demand(loads=36, simulated=2, two_levels=True))
    assert any("can be seen" in text for text in plan.gives_up)


OTHER = pytest.mark.campaign("another criterion: that of the whole covariance plans in every run")


@pytest.mark.parametrize("by", ["D", *(pytest.param(name, marks=OTHER) for name in ("I", "G"))])
def test_a_plan_has_three_levels_of_each_load_and_repeats(
    knowledge: Knowledge, fixtures: FeasibleLoads, by: Criterion
) -> None:
    """A line needs its two ends alone, and says nothing of how crooked it is."""
    plan = plan_session(knowledge, fixtures, Demand(loads=30, criterion=by, simulated=2))
    assert len(plan.rows) == 30
    assert np.isfinite(plan.criterion_value)
    for column in np.array([row.loads for row in plan.rows]).T:
        assert len(np.unique(column)) >= 3
    keys = {(row.loads, row.direction) for row in plan.rows}
    assert len(plan.rows) - len(keys) == plan.replicates >= 3
    assert all(load.visible_misfit is not None for load in plan.outlook)


def test_weights_are_named_in_the_unit_of_their_file(tmp_path: Path, knowledge: Knowledge) -> None:
    text = FIXTURES.replace('[2000, 4000, 6200], unit = "N"', '[0.5, 1, 1.25], unit = "kN"')
    known = made(tmp_path, knowledge, text)
    assert "1.25 kN" in known.label
    assert known.loads[:, 0].max() == pytest.approx(1250 / 4.4482216152605)


def test_fixtures_file_is_read_as_it_is_written(tmp_path: Path, knowledge: Knowledge) -> None:
    assert made(tmp_path, knowledge, FIXTURES).run_minutes == 5
