"""The run that parts a class: faster where late and lagging are alike, and then the true one is ahead."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.planning.class_factory import T, answer, found, problem, with_run, write_case
from toolkit.planning.drives import fastest
from toolkit.planning.members import members_of
from toolkit.planning.next_run import RunSearch, power_of
from toolkit.planning.run_changes import Change, RunLimits, changed, movable, reach

EFFECT = found("channel_delay", "filter_lag")


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> RunSearch:
    posed = problem(write_case(tmp_path_factory.mktemp("class")))
    members = members_of(posed, answer(posed.case.sha256, EFFECT), EFFECT)
    return RunSearch(problem=posed, members=members, limits=RunLimits())


def test_the_proposed_run_is_faster_and_names_the_true_member(search: RunSearch, tmp_path: Path) -> None:
    change = search.best()
    chosen, repeat = search.judge(change), search.judge(Change(run=change.run))
    assert chosen is not None
    assert repeat is not None
    assert fastest(T, chosen.run.columns["u"]) > 2 * fastest(T, repeat.run.columns["u"])
    assert chosen.power > max(repeat.power, 0.9)
    assert chosen.together == ()
    more = with_run(tmp_path, chosen.run.columns["u"], seed=9)
    first, second = members_of(more, answer(more.case.sha256, EFFECT), EFFECT)
    assert first.label == "channel_delay on F"
    assert first.fit.log_posterior - second.fit.log_posterior > 3


def test_inputs_stay_within_what_was_recorded_or_the_limits(search: RunSearch) -> None:
    low, high = reach(search.problem, "u")
    twice = Change(run="r0.csv", sizes=(("u", 2.0),))
    assert changed(search.problem, twice, RunLimits()) is None
    run = changed(search.problem, twice, RunLimits(values={"u": (2 * low, 2 * high)}))
    assert run is not None
    assert np.ptp(run.columns["u"]) == pytest.approx(
        2 * np.ptp(search.problem.runs[0].columns["u"]), rel=1e-3
    )


def test_an_input_is_moved_to_an_end_of_its_limits(search: RunSearch) -> None:
    run = changed(
        search.problem, Change(run="r1.csv", levels=(("u", "high"),)), RunLimits(values={"u": (-5.0, 9.0)})
    )
    assert run is not None
    recorded = search.problem.runs[1].columns["u"]
    np.testing.assert_allclose(run.columns["u"], recorded + 9.0 - recorded.max())
    assert Change(run="r1.csv", levels=(("u", "low"),)).words()[1] == "u as low as its limits allow"


def test_the_next_run_comes_after_the_last_where_one_clock_goes_on(tmp_path: Path) -> None:
    case = write_case(tmp_path)
    for number, path in enumerate(sorted(tmp_path.glob("r*.csv"))):
        run = pd.read_csv(path)
        run.assign(t=run["t"] + 25.0 * number).to_csv(path, index=False)
    posed = problem(case)
    following = changed(posed, Change(run="r0.csv"), RunLimits())
    assert following is not None
    pause = posed.runs[1].t[0] - posed.runs[0].t[-1]
    assert following.t[0] == pytest.approx(posed.runs[1].t[-1] + pause)
    np.testing.assert_allclose(following.columns["t"], following.t)


def test_a_change_of_nothing_is_a_repeat(search: RunSearch) -> None:
    run = changed(search.problem, Change(run="r1.csv"), RunLimits())
    assert run is not None
    np.testing.assert_allclose(run.columns["u"], search.problem.runs[1].columns["u"], atol=1e-12)
    np.testing.assert_array_equal(run.t, search.problem.runs[1].t)  # each run has a clock of its own here


def test_faster_inputs_come_again_there_and_back(search: RunSearch) -> None:
    run = changed(search.problem, Change(run="r0.csv", rate=2.0), RunLimits())
    assert run is not None
    recorded = search.problem.runs[0].columns["u"]
    np.testing.assert_allclose(run.columns["u"][:250], recorded[::2], atol=1e-9)
    assert run.columns["u"][-1] == pytest.approx(recorded[0], abs=0.2)


def test_a_rate_of_change_stays_that_of_its_channel(tmp_path: Path) -> None:
    from tests.diagnosis.cases import carriage
    from tests.diagnosis.cases import write_case as carriage_case

    posed = problem(carriage_case(tmp_path, r0__csv=carriage(rows=400), r1__csv=carriage(seed=1, rows=400)))
    assert dict(movable(posed, RunLimits())) == {"v": None, "a": "v"}
    wide = RunLimits(values={"v": (-9.0, 9.0), "a": (-9.0, 9.0)})
    run = changed(posed, Change(run="r0.csv", rate=2.0, sizes=(("v", 0.5),)), wide)
    assert run is not None
    inner = slice(5, 180)  # before the way back
    rate = np.gradient(run.columns["v"], run.t)
    np.testing.assert_allclose(run.columns["a"][inner], rate[inner], atol=0.05)


def test_a_covariate_goes_on_as_it_was_recorded_unless_it_can_be_set(tmp_path: Path) -> None:
    case = write_case(tmp_path)
    for path in tmp_path.glob("r*.csv"):
        run = pd.read_csv(path)
        run.assign(T=20 + run["t"], W=np.sin(run["t"])).to_csv(path, index=False)
    channels = 'T = { unit = "degC", role = "covariate" }\nW = { unit = "degC", role = "covariate" }\n[[rec'
    case.write_text(case.read_text(encoding="utf-8").replace("[[rec", channels, 1), encoding="utf-8")
    posed = problem(case)
    assert dict(movable(posed, RunLimits())) == {"u": None}
    faster = changed(posed, Change(run="r0.csv", rate=2.0), RunLimits())
    assert faster is not None
    np.testing.assert_array_equal(faster.columns["W"], posed.runs[0].columns["W"])
    oven = RunLimits(values={"T": (20.0, 30.0)})
    assert dict(movable(posed, oven)) == {"u": None, "T": None}
    held = changed(posed, Change(run="r0.csv", sizes=(("T", 0.0),)), oven)
    assert held is not None
    np.testing.assert_allclose(held.columns["T"], np.median(posed.runs[0].columns["T"]))


def test_the_power_is_that_of_the_nearest_of_the_others() -> None:
    near = power_of([("a", "b", 3.0), ("a", "c", 300.0), ("b", "a", 300.0), ("c", "a", 300.0)])
    assert near == pytest.approx((0.5 + 1 + 1) / 3, abs=1e-6)
    assert power_of([("a", "b", 0.0), ("b", "a", -1e-9)]) == 0.0


def test_the_operator_is_told_what_to_do() -> None:
    change = Change(
        run="r0.csv", rate=4.0, sizes=(("u", 0.0), ("v", 1.0)), conditions=(("mounting", "turned"),)
    )
    assert change.words() == (
        "drive the inputs of r0.csv", "4 times as fast", "u held at its middle", "mounting: turned",
    )  # fmt: skip


def test_the_budget_ends_the_search(tmp_path: Path) -> None:
    posed = problem(write_case(tmp_path))
    members = members_of(posed, answer(posed.case.sha256, EFFECT), EFFECT)
    spent = RunSearch(problem=posed, members=members, limits=RunLimits(), until=lambda: False)
    assert spent.best() == Change(run="r0.csv")
    assert len(T) == posed.runs[0].rows


def steady_slide(folder: Path) -> Path:
    """Write a case whose speed never turns, with its acceleration: Coulomb friction is a constant."""
    v = 1.0 + 0.5 * np.sin(2 * np.pi * 0.5 * T)
    a = np.gradient(v, T)
    recorded = pd.DataFrame({"t": T, "u": v, "a": a, "F": 3.0 * v})
    case = write_case(folder)
    for name, gain in (("r0.csv", 3.0), ("r1.csv", 3.1)):
        (recorded * [1, 1, 1, gain / 3]).to_csv(folder / name, index=False)
    text = case.read_text().replace(
        'u = { unit = "mm", role = "input" }',
        'u = { unit = "mm/s", role = "input" }\na = { unit = "mm/s^2", role = "input" }',
    )
    case.write_text(text)
    return case


def test_an_input_with_its_rate_is_driven_through_zero(tmp_path: Path) -> None:
    posed = problem(steady_slide(tmp_path))
    limits = RunLimits(values={"u": (-2.0, 2.0), "a": (-2.0, 2.0)})
    # Of a sine the rate's rate is the sine again, its sign turned: only one of the two is the other's rate.
    assert dict(movable(posed, limits)) == {"u": None, "a": "u"}
    run = changed(posed, Change(run="r0.csv", mirrored=("u",)), limits)
    assert run is not None
    np.testing.assert_allclose(run.columns["u"], -posed.runs[0].columns["u"], atol=1e-9)
    np.testing.assert_allclose(run.columns["a"], -posed.runs[0].columns["a"], atol=1e-9)
    lower = changed(posed, Change(run="r0.csv", levels=(("u", "low"),)), limits)
    assert lower is not None
    assert lower.columns["u"].min() == pytest.approx(-2.0)
    np.testing.assert_allclose(lower.columns["a"], posed.runs[0].columns["a"], atol=1e-9)
    search = RunSearch(problem=posed, members=(), limits=limits)
    offered = [change for factor in search.factors(Change(run="r0.csv")) for change in factor]
    assert Change(run="r0.csv", mirrored=("u",)) in offered
    assert Change(run="r0.csv", mirrored=("u",)).words()[1] == "u with its sign turned"
