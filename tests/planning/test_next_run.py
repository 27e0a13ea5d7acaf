"""The run that parts a class: faster where late and lagging are alike, and then the true one is ahead."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.planning.class_factory import T, found, problem, with_run, write_case
from tests.planning.test_run_changes import steady_slide
from toolkit.diagnosis.policy import VERDICT
from toolkit.planning import next_run
from toolkit.planning.drives import Drive, fastest
from toolkit.planning.members import members_of
from toolkit.planning.next_run import RunSearch, power_of
from toolkit.planning.run_changes import Change, RunLimits

EFFECT = found("channel_delay", "filter_lag")


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> RunSearch:
    posed = problem(write_case(tmp_path_factory.mktemp("class")))
    members = members_of(posed, (EFFECT,), EFFECT)
    return RunSearch(problem=posed, members=members, limits=RunLimits())


def anew(search: RunSearch, **other: Any) -> RunSearch:
    return dataclasses.replace(search, judged={}, runs={}, dense={}, _alike={}, **other)


def test_the_proposed_run_is_faster_and_names_the_true_member(search: RunSearch, tmp_path: Path) -> None:
    change = search.best()
    chosen, repeat = search.judge(change), search.judge(Change(run=change.run))
    assert chosen is not None
    assert repeat is not None
    assert fastest(T, chosen.run.columns["u"]) > 2 * fastest(T, repeat.run.columns["u"])
    assert chosen.power > max(repeat.power, 0.9)
    assert chosen.together == ()
    more = with_run(tmp_path, chosen.run.columns["u"], seed=9)
    first, second = members_of(more, (EFFECT,), EFFECT)
    assert first.label == "channel_delay on F"
    assert first.fit.log_posterior - second.fit.log_posterior > 3


def test_what_is_shorter_than_a_row_is_parted_by_denser_rows(tmp_path: Path) -> None:
    """A delay of a fifth of a row against a lag: no run in rows of 20 ms parts them, one of 5 ms does."""
    delay = 0.004
    posed = problem(write_case(tmp_path / "before", delay=delay))
    members = members_of(posed, (EFFECT,), EFFECT)
    as_recorded = RunSearch(problem=posed, members=members, limits=RunLimits())
    blind = as_recorded.judge(as_recorded.best())
    assert blind is not None
    assert blind.change.rows == 1
    assert blind.together != ()
    search = anew(as_recorded, limits=RunLimits(step_s=0.0025))
    chosen = search.judge(search.best())
    assert chosen is not None
    assert chosen.together == ()
    assert chosen.power > 0.9
    assert chosen.run.t[1] - chosen.run.t[0] >= 0.0025 * (1 - 1e-9)
    assert f"rows {chosen.change.rows} times as dense" in " ".join(chosen.change.words())
    more = with_run(tmp_path / "after", chosen.run.columns["u"], seed=9, t=chosen.run.t, delay=delay)
    first, second = members_of(more, (EFFECT,), EFFECT)
    assert first.label == "channel_delay on F"
    assert first.fit.log_posterior - second.fit.log_posterior > 3


def test_a_run_that_is_too_short_is_as_long_as_is_said_to_be_needed(tmp_path: Path) -> None:
    """So slow that late and lagging hardly differ: what one run does not part some of it do, made as one.

    And no row differs by more than the responses to a ramp do, whose difference is the integral of that of
    the steps: of a delay d and a lag g it is at most d - g (1 - e) + g e with e = exp(-d / g), for each unit
    of the rate, beside the difference of both gains.
    """
    posed = problem(write_case(tmp_path, delay=0.02))
    members = members_of(posed, (EFFECT,), EFFECT)
    recorded = max(fastest(run.t, run.columns["u"]) for run in posed.runs)
    limits = RunLimits(rates={"u": 0.06 * recorded})
    search = RunSearch(problem=posed, members=members, limits=limits)
    short = search.judge(search.best())
    assert short is not None
    assert not short.parts
    needed = search.repeated(short)
    assert needed is not None
    times = needed.times
    assert 1 < times < 16
    assert needed.seconds == pytest.approx(times * np.ptp(T))
    assert needed.power > short.power
    sure = search.repeated(short, power=0.95)
    assert sure is not None
    assert sure.power >= 0.95 > needed.power
    assert sure.times > times

    longer = anew(search, limits=dataclasses.replace(limits, longest_s=2.0 * times * float(np.ptp(T))))
    chosen = longer.judge(longer.best())
    assert chosen is not None
    assert chosen.parts
    assert 1 < chosen.change.length <= 2 * times
    assert np.ptp(chosen.run.t) == pytest.approx(chosen.change.length * np.ptp(T), rel=1e-2)
    assert fastest(chosen.run.t, chosen.run.columns["u"]) <= 0.06 * recorded * (1 + 1e-9)
    assert "times as long" in " ".join(chosen.change.words())

    delay, lag = (
        next(iter(m.fit.active[-1].values.values())) for m in sorted(members, key=lambda member: member.label)
    )
    gains = sorted(float(member.fit.p[0]) for member in members)
    tried = [run for run in search.runs.values() if run in search.judged]
    rate = max(float(np.max(np.abs(np.diff(run.columns["u"]) / np.diff(run.t)))) for run in tried)
    reach = max(float(np.max(np.abs(run.columns["u"]))) for run in tried)
    later = float(np.exp(-delay / lag))
    apart = gains[1] * rate * (delay - lag * (1 - later) + lag * later) + (gains[1] - gains[0]) * reach
    sd = max(member.fit.noise["F"].sd for member in members)
    assert search.farthest * 0.02 <= 0.5 * (apart / sd) ** 2 * (1 + 1e-6)
    assert VERDICT.close / search.farthest < times * np.ptp(T)  # the least time is less than one that does


def test_a_run_that_parts_nothing_is_made_as_often_as_its_time_holds(tmp_path: Path) -> None:
    """No oftener than it takes to be sure, and never where the time holds too few to part anything."""
    posed = problem(write_case(tmp_path, delay=0.02))
    members = members_of(posed, (EFFECT,), EFFECT)
    limits = RunLimits(rates={"u": 0.06 * max(fastest(run.t, run.columns["u"]) for run in posed.runs)})
    search = RunSearch(problem=posed, members=members, limits=limits)
    short = search.judge(search.best())
    assert short is not None
    assert search.made_again(short) is None
    least, sure = search.repeated(short), search.repeated(short, power=0.95)
    assert least is not None
    assert sure is not None

    def within(times: float) -> next_run.NextRun | None:
        longer = dataclasses.replace(limits, longest_s=times * float(np.ptp(T)))
        return anew(search, limits=longer).made_again(short)

    assert within(least.times - 0.5) is None
    made = [within(least.times), within(sure.times - 0.5), within(10.0 * sure.times)]
    assert [run and run.times for run in made] == [least.times, sure.times - 1, sure.times]


def test_the_power_is_that_of_the_nearest_of_the_others() -> None:
    near = power_of([("a", "b", 3.0), ("a", "c", 300.0), ("b", "a", 300.0), ("c", "a", 300.0)])
    assert near == pytest.approx((0.5 + 1 + 1) / 3, abs=1e-6)
    assert power_of([("a", "b", 0.0), ("b", "a", -1e-9)]) == 0.0


def test_the_budget_ends_the_search(tmp_path: Path) -> None:
    posed = problem(write_case(tmp_path))
    members = members_of(posed, (EFFECT,), EFFECT)
    spent = RunSearch(problem=posed, members=members, limits=RunLimits(), until=lambda: False)
    assert spent.best() == Change(run="r0.csv")
    assert len(T) == posed.runs[0].rows


def test_where_every_recording_is_too_fast_an_input_gets_a_course_that_is_not(search: RunSearch) -> None:
    recorded = max(fastest(run.t, run.columns["u"]) for run in search.problem.runs)
    limits = RunLimits(rates={"u": 0.2 * recorded})
    slow = RunSearch(problem=search.problem, members=search.members, limits=limits)
    chosen = slow.judge(slow.best())
    assert chosen is not None
    assert [name for name, _ in chosen.change.drives] == ["u"]
    assert 0.15 * recorded < fastest(T, chosen.run.columns["u"]) <= 0.2 * recorded * (1 + 1e-9)


def test_nothing_is_searched_beyond_certainty(search: RunSearch) -> None:
    again = RunSearch(problem=search.problem, members=search.members, limits=RunLimits())
    best = again.best()
    factors = again.factors(best)
    assert len(again.judged) < sum(map(len, factors))
    assert again._alternatives(best, 0).losses.tolist() == [-again.judged[again.runs[best]]]


def test_what_rows_leave_open_is_asked_of_a_run_that_may_be_better_alone(
    search: RunSearch, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The others are no better with it either: the answer is that of asking for every run."""
    asked = []
    completed = next_run.completed

    def counted(*given: Any) -> Any:
        asked.append(given[2])
        return completed(*given)

    monkeypatch.setattr(next_run, "completed", counted)
    # So slow that no run is certain: the first that were would end the search.
    limits = RunLimits(rates={"u": 0.2 * fastest(T, search.problem.runs[0].columns["u"])})
    lazy = anew(search, limits=limits)
    best = lazy.best()
    assert max(lazy.judged.values()) < next_run._ENOUGH
    assert len({*asked}) < 0.75 * len(lazy.judged)
    monkeypatch.setattr(next_run, "is_less", lambda *_: True)
    every = anew(lazy)
    assert every.best() == best
    assert every.judged[every.runs[best]] == lazy.judged[lazy.runs[best]]


def test_the_first_run_that_is_certain_ends_the_search(search: RunSearch) -> None:
    again = anew(search)
    best = again.best()
    assert again.judged[again.runs[best]] >= next_run._ENOUGH
    assert list(again.judged)[-1] is again.runs[best]


def test_changes_that_come_to_the_same_inputs_are_one_run(search: RunSearch) -> None:
    again = anew(search)
    course = Change(run="r0.csv", drives=(("u", Drive(cycles=0.5)),))
    twins = [dataclasses.replace(course, mirrored=("u",)), dataclasses.replace(course, rate=2.0), course]
    assert len({*map(again._run, twins)}) == 1
    assert again._run(dataclasses.replace(course, sizes=(("u", 0.5),))) is not again._run(course)


def test_of_runs_that_part_with_certainty_the_nearest_to_the_recording_counts(
    search: RunSearch, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Evidence grows with the pace, all of it beyond certainty: the most of it is at the fastest.
    monkeypatch.setattr(
        next_run, "expected_log_evidence", lambda run, *_, **_times: 1e3 * fastest(T, run.columns["u"]) ** 4
    )
    certain = RunSearch(problem=search.problem, members=search.members, limits=RunLimits())
    assert certain.best() == Change(run="r0.csv")


def test_every_factor_offers_something_and_a_sign_is_turned(tmp_path: Path) -> None:
    posed = problem(steady_slide(tmp_path))
    search = RunSearch(problem=posed, members=(), limits=RunLimits(values={"u": (-2.0, 2.0)}))
    start = Change(run="r0.csv")
    driven = Change(run="r0.csv", drives=(("u", Drive(cycles=2.0)),))
    assert all(factor for change in (start, driven) for factor in search.factors(change))
    assert Change(run="r0.csv", mirrored=("u",)) in [c for factor in search.factors(start) for c in factor]
    assert len(search.factors(start)) == len(search.factors(driven))
