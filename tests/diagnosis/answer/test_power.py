"""What is said of effects that were not found: nothing that the search does not keep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.answer import power
from toolkit.diagnosis.answer.power import not_found
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.search import Search, search
from toolkit.diagnosis.search.time_budget import TimeBudget
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect

RUNS = '[[recording.run]]\nfile = "r0.csv"\n[[recording.run]]\nfile = "r1.csv"\n'


def _searched(folder, *, has_time: bool = True) -> Search:
    frames = {}
    for k in range(2):
        L = 20 + 10 * np.sin(0.09 * np.arange(80) + k)
        F = L + np.random.default_rng(k).normal(0, 0.5, 80)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": np.arange(80) * 0.1, "L": L, "F": F})
    text = cell_case(0.01) + RUNS
    if not has_time:
        text = text.replace('time = "t"\n', "").replace('t = { unit = "s", role = "time" }\n', "")
    case = read_case(write_case(folder, text, simulator=CELL, **frames))
    return search(
        problem_of(case, model_of(case, None, None)), seed=1, budget=TimeBudget(300, lambda _: None)
    )


@pytest.fixture(scope="module")
def searched(tmp_path_factory: pytest.TempPathFactory) -> Search:
    return _searched(tmp_path_factory.mktemp("cell"))


def _told(found: Search):
    return {each.name: each for each in not_found(found, set(), alpha=1e-4, units={})}


def test_only_what_the_model_has_no_place_for_is_said_to_have_none(searched: Search) -> None:
    told = _told(searched)
    without_place = {each.name for each in told.values() if each.why == power.NO_PLACE}
    assert {"relaxation", "steer_offset", "overflow"} <= without_place
    assert all(not searched.problem.model.places(effect(name)) for name in without_place)
    assert told["quantisation"].why == power.NO_STEPS
    assert told["nonlinearity"].minimum_detectable is not None


def test_what_the_last_step_left_out_has_its_place(searched: Search) -> None:
    without = replace(
        searched, scored=tuple(each for each in searched.scored if each.candidate.name != "channel_sign")
    )
    assert _told(without)["channel_sign"].why == power.NOT_TRIED


def test_what_takes_time_is_not_seen_without_it(tmp_path) -> None:
    told = _told(_searched(tmp_path, has_time=False))
    assert told["channel_delay"].why == told["creep"].why == power.NO_TIME


def test_an_effect_that_gave_way_was_found(searched: Search) -> None:
    given_up = AppliedEffect(effect=effect("hysteresis"), channel="F", values={"width": 1.0})
    base: Fit = replace(searched.screen.base, active=(given_up,))
    other = tuple(each for each in searched.scored if each.candidate.name != "hysteresis")
    told = _told(replace(searched, scored=other, screen=replace(searched.screen, base=base)))
    assert (told["hysteresis"].why, told["hysteresis"].observable) == (power.GIVEN_UP, True)


def test_no_size_is_promised_of_what_was_seen_and_not_confirmed(searched: Search) -> None:
    told = _told(replace(searched, undecided=frozenset({"nonlinearity"})))
    assert told["nonlinearity"].why == power.UNDECIDED
    assert told["nonlinearity"].minimum_detectable is None
    assert told["zero_offset"].minimum_detectable is not None


@pytest.mark.parametrize(("skipped", "promised"), [("step 1: joint fits", False), ("predictions", True)])
def test_no_size_is_promised_by_a_search_that_was_cut_short(searched, skipped, promised) -> None:
    told = _told(replace(searched, skipped=(skipped,)))
    assert (told["nonlinearity"].minimum_detectable is not None) is promised
    assert told["nonlinearity"].why == ("" if promised else power.CUT_SHORT)


@pytest.mark.parametrize(
    ("name", "run_s", "responds", "bounds", "is_told"),
    [
        ("channel_delay", 8.0, 1.0, None, True),
        ("channel_delay", 8e-3, 1.0, None, False),  # longer than the recording
        ("zero_offset", 8.0, 1.0, None, True),
        ("zero_offset", 8.0, 60.0, None, False),  # it would be half of all that the output moves
        ("zero_offset", 8.0, 1.0, (-1e-6, 1e-6), False),  # no zero is as far off as this
    ],
)
def test_a_size_beyond_what_the_case_allows_is_no_size(
    searched: Search, name: str, run_s: float, responds: float, bounds, *, is_told: bool
) -> None:
    trial = next(each for each in searched.scored if each.candidate.name == name)
    problem = searched.problem
    runs = tuple(replace(run, t=run.t * run_s / run.t[-1]) for run in problem.runs)
    directions = {output: column * 0 for output, column in trial.directions.items()}
    directions["F"][0, 0] = responds * 0.008 * np.ptp(problem.observed["F"])
    if bounds is not None:
        (size,) = trial.candidate.active.effect.parameters
        bounded = replace(trial.candidate.active.effect, parameters=(replace(size, bounds=bounds),))
        candidate = replace(trial.candidate, active=replace(trial.candidate.active, effect=bounded))
        trial = replace(trial, candidate=candidate)
    screen = replace(searched.screen, problem=replace(problem, runs=runs))
    moved = replace(trial, directions=directions)
    assert power._is_beyond(screen, moved, 0.02, 1.0) is not is_told


def test_no_size_is_promised_beside_a_rest_that_no_noise_is(tmp_path) -> None:
    """A bend of half the range, weighed as a coloured noise, hides what that noise alone would not."""
    told = {each.name: each for each in not_found(_bent(tmp_path), set(), alpha=1e-4, units={})}
    assert {each.why for each in told.values() if each.observable} == {power.HIDDEN, power.NO_STEPS}
    assert all(each.minimum_detectable is None for each in told.values())


def _bent(folder) -> Search:
    """Return the search of a loop and a gap of one long, slow sweep there and back, half of its range."""
    load = np.concatenate([np.linspace(-40, 40, 300), np.linspace(40, -40, 300)])
    way = np.concatenate([np.linspace(-1, 1, 300), np.linspace(1, -1, 300)])
    gap = np.where(np.abs(load) < 15, 0.0, load - 15 * np.sign(load))
    loop = np.concatenate([np.full(300, -6.0), np.full(300, 6.0)]) * (1 - way**4)
    force = gap + loop + np.random.default_rng(1).normal(0, 0.1, 600)
    text = (cell_case(0.01) + '[[recording.run]]\nfile = "r0.csv"\n').replace('time = "t"\n', "")
    text = text.replace('t = { unit = "s", role = "time" }\n', "")
    frames = {"r0__csv": pd.DataFrame({"L": load, "F": force}), "r1__csv": None}
    case = read_case(write_case(folder, text, simulator=CELL, **frames))
    return search(
        problem_of(case, model_of(case, None, None)), seed=1, budget=TimeBudget(300, lambda _: None)
    )
