"""What is changed of a run stays within its limits, and the rate of change of a channel stays that."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.planning.class_factory import T, problem, write_case
from toolkit.diagnosis.fit.problem import Problem
from toolkit.planning.drives import Drive, fastest
from toolkit.planning.run_changes import Change, RunLimits, changed, lengths, movable, nearest_limits, reach


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Problem:
    return problem(write_case(tmp_path_factory.mktemp("class")))


def test_inputs_stay_within_what_was_recorded_or_the_limits(late: Problem) -> None:
    low, high = reach(late, "u")
    twice = Change(run="r0.csv", sizes=(("u", 2.0),))
    assert changed(late, twice, RunLimits()) is None
    run = changed(late, twice, RunLimits(values={"u": (2 * low, 2 * high)}))
    assert run is not None
    assert np.ptp(run.columns["u"]) == pytest.approx(2 * np.ptp(late.runs[0].columns["u"]), rel=1e-3)


def test_an_input_is_moved_to_an_end_of_its_limits(late: Problem) -> None:
    run = changed(late, Change(run="r1.csv", levels=(("u", "high"),)), RunLimits(values={"u": (-5.0, 9.0)}))
    assert run is not None
    recorded = late.runs[1].columns["u"]
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


def test_a_change_of_nothing_is_a_repeat(late: Problem) -> None:
    run = changed(late, Change(run="r1.csv"), RunLimits())
    assert run is not None
    np.testing.assert_allclose(run.columns["u"], late.runs[1].columns["u"], atol=1e-12)
    np.testing.assert_array_equal(run.t, late.runs[1].t)  # each run has a clock of its own here


def test_a_longer_run_goes_back_and_forth_and_what_only_grows_goes_on(tmp_path: Path) -> None:
    case = write_case(tmp_path)
    for path in tmp_path.glob("r*.csv"):
        run = pd.read_csv(path)
        run.assign(angle=run["t"] + 0.01 * run["t"] ** 2).to_csv(path, index=False)
    channels = 'angle = { unit = "rad", role = "covariate" }\n[[rec'
    case.write_text(case.read_text(encoding="utf-8").replace("[[rec", channels, 1), encoding="utf-8")
    posed = problem(case)
    run = changed(posed, Change(run="r0.csv", length=2.5), RunLimits())
    assert run is not None
    recorded = posed.runs[0].columns
    np.testing.assert_allclose(np.diff(run.t), 0.02, rtol=1e-9)
    assert run.rows == round(2.5 * 499) + 1
    np.testing.assert_array_equal(run.columns["t"], run.t)
    np.testing.assert_allclose(run.columns["u"][499:999], recorded["u"][::-1], atol=1e-9)
    np.testing.assert_allclose(run.columns["u"][998:], recorded["u"][:251], atol=1e-9)
    assert (np.diff(run.columns["angle"]) > 0).all()
    # The angle's rate is that of the shaft, which goes back to what it was.
    rate = np.diff(run.columns["angle"])
    np.testing.assert_allclose(rate[499:998], rate[:499][::-1], rtol=1e-6)


@pytest.mark.parametrize(
    ("longest", "rows", "most"), [(0.0, 1, 1.0), (25.0, 1, 2.505), (1e6, 1, 16.0), (1e6, 16, 4.0)]
)
def test_lengths_are_doublings_and_the_longest(late: Problem, longest: float, rows: int, most: float) -> None:
    found = lengths(late.runs[0], rows, RunLimits(longest_s=longest))
    assert found[0] == 1.0
    assert found[-1] == pytest.approx(most, rel=1e-3)
    assert list(found) == sorted(found)


def test_faster_inputs_come_again_there_and_back(late: Problem) -> None:
    run = changed(late, Change(run="r0.csv", rate=2.0), RunLimits())
    assert run is not None
    recorded = late.runs[0].columns["u"]
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


def test_the_operator_is_told_what_to_do() -> None:
    change = Change(
        run="r0.csv", rate=4.0, sizes=(("u", 0.0), ("v", 1.0)), conditions=(("mounting", "turned"),)
    )
    assert change.words() == (
        "drive the inputs of r0.csv", "4 times as fast", "u held at its middle", "mounting: turned",
    )  # fmt: skip


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
    assert Change(run="r0.csv", mirrored=("u",)).words()[1] == "u with its sign turned"


def test_a_course_uses_what_is_stated_beyond_what_was_recorded(late: Problem) -> None:
    change = Change(run="r0.csv", drives=(("u", Drive(cycles=0.5, levels=5)),))
    low, high = reach(late, "u")
    within = changed(late, change, RunLimits())
    assert within is not None
    assert (within.columns["u"].min(), within.columns["u"].max()) == pytest.approx((low, high), rel=1e-6)
    wide = changed(late, change, RunLimits(values={"u": (-7.0, 11.0)}, rates={"u": 1e3}))
    assert wide is not None
    held = np.unique(np.round(wide.columns["u"], 9), return_counts=True)
    np.testing.assert_allclose(held[0][held[1] > 20], [-7.0, -2.5, 2.0, 6.5, 11.0])
    assert wide.columns["u"][0] == late.runs[0].columns["u"][0]
    slow = changed(late, change, RunLimits(values={"u": (-7.0, 11.0)}, rates={"u": 0.5}))
    assert slow is not None
    assert 0.4 < fastest(T, slow.columns["u"]) <= 0.5


def test_a_part_of_a_course_lies_at_an_end_or_about_the_middle(late: Problem) -> None:
    limits = RunLimits(values={"u": (-2.0, 6.0)}, rates={"u": 1e3})
    course = Change(run="r0.csv", drives=(("u", Drive(cycles=2.0, levels=2)),), sizes=(("u", 0.25),))
    for level, ends in ((None, (1.0, 3.0)), ("low", (-2.0, 0.0)), ("high", (4.0, 6.0))):
        levels = () if level is None else (("u", level),)
        run = changed(
            late, Change(run="r0.csv", drives=course.drives, sizes=course.sizes, levels=levels), limits
        )
        assert run is not None
        settled = run.columns["u"][200:]
        assert (settled.min(), settled.max()) == pytest.approx(ends, abs=1e-6)


def test_a_rate_that_is_stated_holds_for_what_was_recorded_too(late: Problem) -> None:
    recorded = max(fastest(run.t, run.columns["u"]) for run in late.runs)
    faster = Change(run="r1.csv", rate=2.0)
    assert changed(late, faster, RunLimits(rates={"u": 3 * recorded})) is not None
    assert changed(late, faster, RunLimits(rates={"u": recorded})) is None
    run, nearest = nearest_limits(late, RunLimits(rates={"u": 0.1 * recorded}))
    assert run == "r1.csv"
    assert changed(late, Change(run=run), nearest) is not None


def test_the_rate_of_a_course_is_its_channel_and_keeps_its_limits(tmp_path: Path) -> None:
    posed = problem(steady_slide(tmp_path))
    limits = RunLimits(values={"u": (-2.0, 2.0), "a": (-1.0, 1.5)})
    run = changed(posed, Change(run="r0.csv", drives=(("u", Drive(cycles=0.5, levels=5)),)), limits)
    assert run is not None
    assert run.columns["u"].min() == pytest.approx(-2.0)
    assert run.columns["u"].max() == pytest.approx(2.0)
    assert -1.0 <= run.columns["a"].min() < run.columns["a"].max() <= 1.0 + 1e-9
    np.testing.assert_allclose(run.columns["a"], np.gradient(run.columns["u"], run.t), rtol=0.01, atol=1e-9)


def test_a_course_begins_within_the_limits_and_only_where_something_was_recorded(tmp_path: Path) -> None:
    posed = problem(steady_slide(tmp_path))
    change = Change(run="r0.csv", drives=(("u", Drive(cycles=0.5)),))
    # The recordings begin at 1 mm/s, and go from 0.5 to 1.5.
    run = changed(posed, change, RunLimits(values={"u": (-2.0, 0.9), "a": (-2.0, 2.0)}))
    assert run is not None
    assert run.columns["u"][0] == 0.9
    assert run.columns["u"].min() == pytest.approx(-2.0)
    beyond = RunLimits(values={"u": (1.6, 3.0), "a": (-2.0, 2.0)})
    for leaves in (change, Change(run="r0.csv", levels=(("u", "low"),))):
        assert changed(posed, leaves, beyond) is None
    # An acceleration that never is zero leaves no course at all.
    assert changed(posed, change, RunLimits(values={"u": (1.0, 2.0), "a": (0.5, 1.0)})) is None


@pytest.mark.parametrize(
    "drive", [Drive(cycles=60.0, levels=2), Drive(cycles=12.0, levels=2, swept=True)], ids=str
)
def test_rows_tell_what_a_course_does_between_them(late: Problem, drive: Drive) -> None:
    """As fast as may be, a course is known between rows by a straight line, to a hundredth of its span."""
    run = changed(
        late,
        Change(run="r0.csv", drives=(("u", drive),)),
        RunLimits(values={"u": (-3.0, 3.0)}, rates={"u": 1e6}),
    )
    assert run is not None
    column, t = run.columns["u"], run.t
    assert np.ptp(column) > 0
    between = np.interp(t[1::2][:-1], t[::2], column[::2])  # every other row left out: four times as far off
    assert np.abs(between - column[1::2][: len(between)]).max() < 4 * 0.01 * 6.0
