"""Laws that only the errors from row to row show: the refit has driven the simulation away from them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.ranking import ranked
from toolkit.diagnosis.law.row_to_row import shown_from_row_to_row
from toolkit.diagnosis.law.terms import terms_of
from toolkit.diagnosis.policy import LAWS
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.simulators.build_simulator import model_of

SERVO = case_text(
    "ode", title="A servo follows commanded angles", states=["th"], force_terms={"th": "rad/s"},
    parameters={"K": {"value": 8.0, "unit": "1/s", "sd": 4.0, "bounds": [0.5, 60.0]}},
    inputs={"a": "rad"}, outputs={"th": "rad"},
)  # fmt: skip
FOLLOWS = """
def rhs(t, x, u, p):
    return [p["K"] * (u["a"] - x[0])]
def outputs(x, u, p):
    return {"th": x[0]}
def initial(p, run):
    return [run["th"]]
"""


def commanded(k: int, t: np.ndarray) -> np.ndarray:
    """Return stairs of commanded angles [rad]: each run has its own."""
    rng = np.random.default_rng(k)
    stairs = rng.uniform(-1.0, 1.0, 12) * (0.3 + 0.2 * k)
    return stairs[np.minimum((t / 0.6).astype(int), 11)]


def servo(folder: Path, *, runs: int = 6, rows: int = 240) -> Case:
    """Return a servo that turns at most 1.5 rad/s, and 50 ms late, in steps of a tenth of a row."""
    files, t = {}, np.arange(rows) * 0.02
    fine = np.arange(10 * (rows - 1) + 1) * 0.002
    for k in range(runs):
        asked, th = commanded(k, np.maximum(fine - 0.05, 0.0)), np.zeros(len(fine))
        for i in range(len(fine) - 1):
            th[i + 1] = th[i] + 0.002 * 1.5 * np.tanh(8.0 * (asked[i] - th[i]) / 1.5)
        noise = np.random.default_rng(50 + k).normal(0, 0.001, len(t))
        frame = {"t": t, "a": commanded(k, t), "th": np.interp(t, fine, th) + noise}
        files[f"r{k}__csv"] = pd.DataFrame(frame)
    text = SERVO + "".join(f'[[recording.run]]\nfile = "r{k}.csv"\n' for k in range(runs))
    return read_case(write_case(folder, text, simulator=FOLLOWS, **files))


def test_a_limit_that_no_free_simulation_shows_is_shown_from_row_to_row(tmp_path: Path) -> None:
    """The refit is so slow that nothing limits it; along the recording the angle follows only so fast."""
    case = servo(tmp_path, runs=3, rows=150)
    problem = problem_of(case, model_of(case, None))
    base, weight = fit(problem), 0.5 * math.log(problem.values)
    assert base.p[0] < 4.0  # 1/s, of 8
    trials = list(terms_of(problem))
    shown = [trial for trial, _ in shown_from_row_to_row(problem, base, trials, weight)]
    limits = [
        trial
        for trial in shown
        if {signal.name for signal in trial.signals} == {"a", "th"} and "tanh" in trial.shape.text
    ]
    assert shown.index(limits[0]) < LAWS.along
    assert dict(limits[0].applied.values)["a"] > 0  # it pulls the angle to where it is asked to be
    ranks = [trial.place for trial in ranked(problem, base, LinearisedFit.of(problem, base), trials, weight)]
    assert limits[0].place not in ranks[: LAWS.fitted]


@pytest.mark.campaign("a whole diagnosis of 1 440 rows, by rows and by size; the law is shown in every run")
def test_a_servo_that_turns_only_so_fast_has_a_law_and_no_name(tmp_path: Path) -> None:
    answer = diagnose(servo(tmp_path), None).diagnosis
    assert (answer.verdict, answer.effects) == ("unknown", ())
    limits = [law for law in answer.laws if set(law.variables) == {"a", "th"}]
    assert [(law.place.kind, law.place.channel) for law in limits] == [("state", "th")]
    (output,) = answer.fit.held_out
    assert output.with_laws_rmse < 0.4 * output.refitted_rmse
