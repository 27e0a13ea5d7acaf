"""A tone whose phase goes on from run to run: it is met on its own hill, and foretells runs that follow."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.trial import trials_of, unlocked_tone
from toolkit.diagnosis.search.unexplained import strongest_line
from toolkit.diagnosis.simulators.build_simulator import model_of


def head(runs: int) -> str:
    """Return a load cell's case."""
    return case_text(
        "python", parameters={"gain": (1.0, "1", 0.005)}, inputs={"L": "N"}, outputs={"F": "N"}, runs=runs
    )


RUN_S, PAUSE_S = 36.0, 3.0


@pytest.mark.parametrize("frequency", [2.1234, 2.7735, 3.9871])
def test_a_tone_of_a_session_starts_within_a_line_of_the_session(tmp_path, frequency):
    """One run is six times shorter than the session: its line is as much wider, with hills in it."""
    rng, runs = np.random.default_rng(7), {}
    for k in range(6):
        t = k * (RUN_S + PAUSE_S) + np.arange(0, RUN_S, 0.05)
        L = 10 * np.sin(0.7 * t + k)
        tone = 0.2 * np.sin(2 * math.pi * frequency * t + 0.4)
        runs[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": L, "F": L + tone + rng.normal(0, 0.2, len(t))})
    case = read_case(write_case(tmp_path, head(6), simulator=CELL, **runs))
    problem = problem_of(case, model_of(case, None))
    tones = [trial for trial in trials_of(problem, fit(problem, plain=True), ("F",)) if trial.form == "tone"]
    session_line = 1 / (6 * RUN_S + 5 * PAUSE_S)
    off = [abs(dict(trial.applied.values)["frequency"] - frequency) for trial in tones]
    assert min(off) < session_line / 4


def test_what_swings_as_an_input_does_is_no_tone(tmp_path):
    """A bend answers to a swing by three times its frequency: of another swing a tone foretells nothing."""
    rng, runs = np.random.default_rng(7), {}
    for k in range(2):
        t = np.arange(0, 30, 0.02)
        L = 10 * np.sin(2 * math.pi * 1.05 * t + k)
        runs[f"r{k}__csv"] = pd.DataFrame(
            {"t": t, "L": L, "F": L + 2e-4 * L**3 + rng.normal(0, 0.01, len(t))}
        )
    case = read_case(write_case(tmp_path, head(2), simulator=CELL, **runs))
    problem = problem_of(case, model_of(case, None))
    base = fit(problem, plain=True)
    assert strongest_line(problem, "F", base.residual["F"]).frequency == pytest.approx(3.15, abs=0.02)
    assert not [trial for trial in trials_of(problem, base, ("F",)) if trial.form == "tone"]
    assert unlocked_tone(problem, base, "F") is None
