"""A budget ends a search, and a simulator's call; outputs that stand still need no search."""

import math
import time
from types import SimpleNamespace

import pytest

from tests.diagnosis.cases import HEAD, ONE, SIMULATOR, TWO, carriage, write_case
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.policy import BUDGET
from toolkit.diagnosis.search import time_budget
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.diagnosis.simulators.case_code import CaseCode
from toolkit.worker.worker import LateError

pytestmark = pytest.mark.usefixtures("case_worker")  # a worker that is late is ended

WAITS = SIMULATOR.replace("import pandas as pd", "import pandas as pd, time\n    WAIT")
DRIVEN = """
import numpy as np
def rhs(t, x, u, p):
    return [(u["a"] - p["c"] * x[0]) / p["mass"]]
def outputs(x, u, p):
    return {"F": x[0]}
def initial(p):
    return [0.0]
"""
PREDICT = '[[recording.predict]]\nfile = "more.csv"\n'


def test_a_call_is_ended_where_it_stands_even_if_it_catches_everything():
    def stubborn():
        try:
            time.sleep(600)
        except Exception:  # noqa: BLE001
            return 0

    with pytest.raises(BudgetSpentError):
        TimeBudget(0.2, lambda _: None).guarded(stubborn)()


def test_a_call_in_time_returns_and_leaves_no_alarm():
    budget = TimeBudget(0.3, lambda _: None)
    assert budget.guarded(lambda a, b: a - b)(5, b=3) == 2
    time.sleep(0.4)
    with pytest.raises(BudgetSpentError, match="declared"):
        budget.guarded(lambda: None)()


def test_a_step_that_others_wait_for_leaves_them_a_part_of_the_time(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(time_budget, "time", SimpleNamespace(monotonic=lambda: now[0]))
    budget = TimeBudget(600.0, lambda _: None, alarm=False)
    now[0] = 0.5 * 600
    budget.check("pairs", reserve=BUDGET.laws)
    now[0] = 0.8 * 600
    with pytest.raises(BudgetSpentError, match="pairs"):
        budget.check("pairs", reserve=BUDGET.laws)
    budget.check("laws")


def test_a_simulator_of_ten_minutes_gives_a_partial_answer(tmp_path):
    slow = WAITS.replace("WAIT", "time.sleep(600)")
    case = read_case(write_case(tmp_path, HEAD + TWO + PREDICT, simulator=slow, more__csv=carriage(seed=4)))
    result = diagnose(case, None, budget_s=5.0)  # loading on a busy machine takes two
    made = json_value(result.diagnosis)
    assert made["complete"] is False
    assert made["verdict"] == "untestable"
    assert made["skipped"][0] == "the simulation as declared"
    assert {"screening of the effects", "predictions"} <= set(made["skipped"])
    assert made["effects"] == made["fit"]["held_out"] == []
    assert made["not_found"]
    assert not any(one["observable"] for one in made["not_found"])
    assert result.search is None


def test_a_simulator_that_does_not_even_load_in_time_gives_a_partial_answer(tmp_path):
    case = read_case(write_case(tmp_path, simulator="import time\ntime.sleep(600)\n" + SIMULATOR))
    made = diagnose(case, None, budget_s=0.5).diagnosis
    assert not made.complete
    assert [one.name for one in made.nominal_parameters] == ["mass", "c"]


def test_a_budget_that_ends_in_the_refit_still_tells_the_error_as_declared(tmp_path):
    case = read_case(write_case(tmp_path, simulator=WAITS.replace("WAIT", "time.sleep(0.2)")))
    made = diagnose(case, None, budget_s=5.0).diagnosis
    assert not made.complete
    # 20 N of dry friction, and parameters off by 1 kg and 10 N s/m: about 20 N
    assert made.fit.held_out[0].nominal_rmse == pytest.approx(20.0, abs=3.0)
    assert math.isnan(made.fit.held_out[0].noise_floor)


@pytest.mark.parametrize("rows", [1, 2, 30])
def test_outputs_that_stand_still_are_untestable(tmp_path, rows):
    still = carriage(rows=rows).assign(F=3.0)
    made = diagnose(read_case(write_case(tmp_path, r0__csv=still, r1__csv=still)), None).diagnosis
    assert (made.verdict, made.complete, made.effects) == ("untestable", True, ())
    assert json_value(made)["fit"]["held_out"][0]["noise_floor"] is None


def test_an_output_without_a_single_sample_is_untestable(tmp_path):
    none = carriage(rows=20).assign(F=math.nan)
    made = diagnose(read_case(write_case(tmp_path, HEAD + ONE, r0__csv=none)), None).diagnosis
    assert (made.verdict, made.fit.held_out) == ("untestable", ())


def test_a_search_that_is_cut_off_never_says_that_nothing_is_missing(tmp_path):
    frames = {f"r{i}__csv": carriage(seed=i, coulomb=0.0) for i in range(2)}
    case = read_case(write_case(tmp_path, **frames))
    assert diagnose(case, None).diagnosis.verdict == "nothing"

    def late(step):
        if step.startswith("step 1: structure"):
            raise BudgetSpentError(step)

    made = diagnose(case, None, tell=late).diagnosis
    assert (made.verdict, made.remaining, made.complete) == ("untestable", "unknown", False)
    assert made.skipped[0].startswith("step 1: structure")
    assert made.fit.held_out[0].refitted_rmse > 0


LATER = pytest.mark.campaign("a later step: a worker that is late at the first is answered for in every run")


@pytest.mark.parametrize("step", ["refit of the nominal", pytest.param("step 1: structure", marks=LATER)])
def test_an_equation_whose_worker_is_late_is_still_answered(tmp_path, monkeypatch, step):
    equation = HEAD.replace('kind = "python"', 'kind = "ode"').replace('function = "simulate"\n', "")
    case = read_case(write_case(tmp_path, equation + TWO, simulator=DRIVEN))

    def spent(*_):
        raise LateError

    def late(told):
        if told.startswith(step):
            monkeypatch.setattr(CaseCode, "_asked", spent)
            raise BudgetSpentError(told)

    made = diagnose(case, None, tell=late).diagnosis
    assert not made.complete
    assert made.skipped[0].startswith(step)
    assert made.fit.held_out[0].nominal_rmse > 0
    assert {one.unit for one in made.not_found if one.name == "coulomb_friction"} <= {"N/s", ""}
