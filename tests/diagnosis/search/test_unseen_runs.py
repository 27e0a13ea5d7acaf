"""What is named by its free simulation of unseen runs, where coloured noise would take all of the rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.folds import HeldOut, folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.screen_step import look
from toolkit.diagnosis.search.unseen_runs import shown_on_unseen_runs
from toolkit.diagnosis.simulators.build_simulator import model_of

CASE = case_text(
    "ode", title="A wheel that coasts", states=["x", "v"], force_terms={"v": "N/kg"},
    parameters={"bearing": (0.02, "m/s^2", 0.01, [0.0, 0.5])}, outputs={"v": "m/s"},
)  # fmt: skip
SIMULATOR = """
import math
def initial(p, run):
    return [0.0, run["speed0"]]
def rhs(t, x, u, p):
    return [x[1], -p["bearing"] * math.tanh(x[1] / 0.05)]
def outputs(x, u, p):
    return {"v": x[1]}
"""


def coasting(folder: Path, *, drag: float, runs: int = 3) -> Case:
    """Return runs of a wheel with dry friction 0.02 m/s^2 and a drag [1/m], whose speeds wander a little."""
    toml, frames, t = CASE, {}, np.arange(50) * 4.0
    for k in range(runs):
        rng = np.random.default_rng(k)
        start = 20.0 + 2.0 * k
        if drag:
            # dv/dt = -b - d v^2 has a tangent for its solution
            rate, scale = np.sqrt(0.02 * drag), np.sqrt(0.02 / drag)
            v = scale * np.tan(np.maximum(np.arctan(start / scale) - rate * t, 0.0))
        else:
            v = start - 0.02 * t
        v = v + 0.02 * np.cumsum(rng.normal(0, 1, t.size)) * np.exp(-t / 100)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "v": v})
        toml += f'[[recording.run]]\nfile = "r{k}.csv"\nspeed0 = {start}\n'
    return read_case(write_case(folder, toml, simulator=SIMULATOR, **frames))


def asked(folder: Path, *, drag: float, runs: int) -> tuple[Fit, HeldOut, Step] | None:
    """Ask unseen runs of what the screen of a first step shows."""
    problem = problem_of(case := coasting(folder, drag=drag, runs=runs), model_of(case, None, None))
    base = fit(problem)
    folds = folds_of(problem, base)
    view = look(problem, base, candidates(problem), turn=0, seed=1)
    return shown_on_unseen_runs(problem, folds, base, hold_out(problem, folds, (), base), view)


def test_a_drag_is_what_foretells_whole_unseen_runs(tmp_path: Path) -> None:
    shown = asked(tmp_path, drag=2e-3, runs=3)
    assert shown is not None
    made, _, step = shown
    assert step.active.effect.name == "quadratic_drag"
    assert dict(made.active[-1].values)["drag"] == pytest.approx(2e-3, rel=0.1)


@pytest.mark.campaign(
    "a whole diagnosis: that unseen runs show the drag is held by their own step in every run"
)
def test_a_wheel_that_is_slowed_by_the_air_has_its_drag_named(tmp_path: Path) -> None:
    made = diagnose(coasting(tmp_path, drag=2e-3), None).diagnosis
    (effect,) = made.effects
    assert "quadratic_drag" in (effect.name, *effect.equivalent_to)
    assert effect.parameters[0].value == pytest.approx(2e-3, rel=0.1)
    assert made.fit.held_out[0].augmented_rmse < 0.1 * made.fit.held_out[0].refitted_rmse


@pytest.mark.parametrize(("drag", "runs"), [(0.0, 3), (2e-3, 2)])
def test_neither_noise_nor_two_runs_name_anything(tmp_path: Path, drag: float, runs: int) -> None:
    assert asked(tmp_path, drag=drag, runs=runs) is None
