"""A parameter of the simulation that is an effect: nothing is missing, only its form may be another."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.folds import folds_of, hold_out
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.forward_step import Step, joint_fit
from toolkit.diagnosis.search.own_terms import without_own_terms
from toolkit.diagnosis.simulators.build_simulator import model_of

JOINT = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"current": p["b"] * inputs["w"] + p["fc"] * np.tanh(inputs["w"] / 0.1)})
"""


@pytest.mark.parametrize(
    ("off_sd", "unit", "stays"),
    [
        (-0.5, "A", False),  # the simulation has it, and its prior believes what the refit needs
        (-3.5, "A", True),  # its prior does not
        (-0.5, "N", True),  # it is another thing
    ],
)
def test_friction_that_the_simulation_has_is_not_missing(
    tmp_path: Path, off_sd: float, unit: str, stays: bool
) -> None:
    """Dry friction of 1.3 A that jumps where the simulation's turns softly."""
    t, frames = np.arange(0.0, 20.0, 0.05), {}
    for k in range(3):
        w = 0.5 * np.sin((0.5 + 0.2 * k) * t + k) + 0.2 * np.sin(1.7 * t)
        noise = np.random.default_rng(k).normal(0, 0.05, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "w": w, "current": 2.2 * w + 1.3 * np.sign(w) + noise})
    toml = case_text(
        "python", parameters={"b": (2.2, "A*s/rad", 0.05), "fc": (1.4, unit, 0.4)},
        inputs={"w": "rad/s"}, outputs={"current": "A"}, runs=3,
    )  # fmt: skip
    case = read_case(write_case(tmp_path, toml, simulator=JOINT, **frames))
    problem = problem_of(case, model_of(case, None, None))
    refitted = fit(problem)
    (friction,) = (each for each in candidates(problem) if each.name == "coulomb_friction")
    start = replace(friction.active, values=dict(friction.starts[0].values))
    made = joint_fit(problem, refitted, (start,))
    assert made is not None
    folds = folds_of(problem, refitted)
    step = Step(active=made.active[0], p_value=0.0, held_out_gain=1.0, gain=1.0, rivals=())
    refit = replace(refitted, p=(refitted.p[0], 1.4 + 0.4 * off_sd))
    unseen = hold_out(problem, folds, made.active, made)
    _, _, left = without_own_terms(problem, folds, refit, made, unseen, [step])
    assert bool(left) is stays
