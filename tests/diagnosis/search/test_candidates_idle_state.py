"""An idle state changes nothing: dry friction needs a rate, and no position behind it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.search.candidates import CandidateEffect, Start, candidates
from toolkit.diagnosis.search.proposals import proposals
from toolkit.diagnosis.search.screen_step import look
from toolkit.diagnosis.simulators.build_simulator import model_of

BARE = """
def rhs(t, x, u, p):
    return [-p["viscous"] * x[0]]
def outputs(x, u, p):
    return {"w": x[0]}
def initial(p, run):
    return [run["w"]]
"""
WITH_AN_ANGLE = """
def rhs(t, x, u, p):
    return [x[1], -p["viscous"] * x[1]]
def outputs(x, u, p):
    return {"w": x[1]}
def initial(p, run):
    return [0.0, run["w"]]
"""
FRICTIONS = ("constant_force", "coulomb_friction", "viscous_damping", "quadratic_drag")


def wheel(folder: Path, simulator: str, states: list[str]) -> tuple[Problem, Fit]:
    """Return a wheel that coasts to rest in three runs under dry friction, which its equation lacks."""
    text = case_text(
        "ode", parameters={"viscous": (0.1, "1/s", 0.1)}, outputs={"w": "rad/s"}, runs=3, states=states,
        force_terms={"w": "1/s^2"},
    )  # fmt: skip
    t = np.arange(150) * 0.05
    frames = {}
    for k, begin in enumerate((40.0, 55.0, 30.0)):
        # dw/dt = -c w - f: w = (w0 + f/c) exp(-c t) - f/c, until it stands
        w = np.maximum((begin + 60.0) * np.exp(-0.1 * t) - 60.0, 0.0)
        noise = np.random.default_rng(k).normal(0, 0.2, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "w": w + noise})
    case = read_case(write_case(folder, text, simulator=simulator, **frames))
    problem = problem_of(case, model_of(case, None, None))
    return problem, fit(problem)


def values_of(start: Start) -> dict[str, float]:
    return start.reached((), {})


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Problem, Fit, list[CandidateEffect]]]:
    folder = tmp_path_factory.mktemp("wheels")
    made = [
        wheel(folder / "bare", BARE, ["w"]),
        wheel(folder / "angle", WITH_AN_ANGLE, ["angle", "w"]),
    ]
    return [
        (problem, base, [each for each in candidates(problem) if each.name in FRICTIONS])
        for problem, base in made
    ]


def test_places_starts_and_bounds_of_frictions_are_those_without_the_idle_state(wheels):
    bare, beside = ({each.name: each for each in listed} for _, _, listed in wheels)
    assert set(bare) == set(beside) == set(FRICTIONS)
    for name in FRICTIONS:
        assert bare[name].key == beside[name].key
        for one, other in zip(bare[name].starts, beside[name].starts, strict=True):
            assert values_of(one) == pytest.approx(values_of(other), rel=1e-6)
        # the integral by trapezia, against that of the solver
        bounds = [
            [end for parameter in each.active.effect.parameters for end in parameter.bounds]
            for each in (bare[name], beside[name])
        ]
        assert bounds[0] == pytest.approx(bounds[1], rel=1e-3)


def test_what_the_screen_and_the_prediction_errors_show_is_that_without_the_idle_state(wheels):
    seen, proposed = [], []
    for problem, base, listed in wheels:
        view = look(problem, base, listed, turn=0, seed=1)
        seen.append(
            {
                (trial.candidate.name, trial.candidate.starts.index(trial.start)): trial.gain
                for trial in view.scored
            }
        )
        found = proposals(problem, base)
        proposed.append({each.candidate.name: each.gain for each in found.scored})
        assert not any(key[0] == "coulomb_friction" for key in found.hopeless)
    assert seen[0] == pytest.approx(seen[1], rel=1e-3, abs=1e-2)
    assert "coulomb_friction" in proposed[0]
    assert proposed[0]["coulomb_friction"] == pytest.approx(proposed[1]["coulomb_friction"], rel=1e-3)


def test_a_turning_rate_is_no_level_that_runs_over(wheels):
    problem = wheels[0][0]
    assert "overflow" not in {each.name for each in candidates(problem)}
