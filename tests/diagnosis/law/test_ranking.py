"""Laws ranked beside the first good one: the simulation is then where the plant was."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.ranking import ranked, ranked_in_place
from toolkit.diagnosis.law.terms import terms_of
from toolkit.diagnosis.search.forward_step import joint_fit
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.simulators.build_simulator import model_of

TANK = case_text(
    "ode", title="A tank that empties", states=["h"], force_terms={"h": "m/s"},
    parameters={"g": (0.02, "m/L", 0.002), "c": (0.03, "1/s", 0.01)}, inputs={"q": "L/s"}, outputs={"h": "m"},
)  # fmt: skip
EMPTIES = """
def rhs(t, x, u, p):
    return [p["g"] * u["q"] - p["c"] * x[0]]
def outputs(x, u, p):
    return {"h": x[0]}
def initial(p, run):
    return [run["h"]]
"""


def tank(folder: Path, *, rows: int = 300) -> Case:
    """Return a tank that empties by the root of its level (Torricelli), 0.045 m^0.5/s, noise 0.01 m."""
    files, text = {}, TANK
    for k in range(4):
        rng, t = np.random.default_rng(200 + k), np.arange(rows) * 4.0
        stairs = 0.5 + rng.uniform(0.0, 3.0, 8)
        q = stairs[np.minimum((8 * np.arange(rows)) // rows, 7)]

        def rate(s: float, x: np.ndarray, t: np.ndarray = t, q: np.ndarray = q) -> list[float]:
            return [0.02 * np.interp(s, t, q) - 0.045 * np.sqrt(max(x[0], 0.0))]

        h = solve_ivp(rate, (0, t[-1]), [1 + 0.3 * k], t_eval=t, rtol=1e-7, max_step=2.0).y[0]
        files[f"r{k}__csv"] = pd.DataFrame({"t": t, "q": q, "h": h + rng.normal(0, 0.01, rows)})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, text, simulator=EMPTIES, **files))


def test_beside_a_law_that_comes_near_the_right_one_is_ranked_first(tmp_path: Path) -> None:
    """From a refit that is far off the root is behind a parabola, from beside the parabola before all."""
    case = tank(tmp_path, rows=150)
    problem = problem_of(case, model_of(case, None))
    base, weight = fit(problem), 0.5 * math.log(problem.values)
    trials = list(terms_of(problem))
    first = ranked(problem, base, LinearisedFit.of(problem, base), trials, weight)
    near = next(trial for trial in first if trial.shape.text == "a1*{x} + a2*{x}**2")
    refit = joint_fit(problem, base, near.together)
    assert refit is not None
    in_place = ranked_in_place(problem, refit, near, trials, weight)
    assert first[0].shape.text != in_place[0].shape.text == "a*sqrt(abs({x}))"
    (again,) = (joint_fit(problem, base, in_place[0].together, begin=refit.p),)
    assert dict(again.active[-1].values)["a"] == pytest.approx(0.045, rel=0.03)


@pytest.mark.campaign(
    "a whole diagnosis of 1 200 rows; what is ranked in a law's place is shown in every run"
)
def test_names_that_imitate_a_root_go_for_it(tmp_path: Path) -> None:
    """A steady force and a cubic stiffness, of which a tank has neither, take 94 % of it."""
    answer = diagnose(tank(tmp_path), None).diagnosis
    assert answer.effects == ()
    assert [law.formula for law in answer.laws] == ["a*sqrt(abs(h))"]
