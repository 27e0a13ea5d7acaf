"""A law that is a known effect in other words is told to be like it; any other is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.resembling import resembling
from toolkit.diagnosis.law.shapes import ONE, REMEMBERING
from toolkit.diagnosis.law.trial import signals_of, trial_at
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.simulators.build_simulator import model_of

HEAD = case_text(
    "python", parameters={"gain": (1.0, "1", 0.005)}, inputs={"L": "N"}, outputs={"F": "N"},
    others={"T": {"unit": "degC", "role": "covariate"}}, runs=2,
)  # fmt: skip


def loaded(seed: int) -> pd.DataFrame:
    """Return a cell loaded up and down over parts of its range, its temperature by itself."""
    rng = np.random.default_rng(seed)
    t = np.arange(240) * 0.5
    L = 100 * np.sin(0.11 * t + seed) * np.sin(0.031 * t)
    T = 23 + 4 * np.sin(0.05 * t + 2 * seed)
    return pd.DataFrame({"t": t, "L": L, "T": T, "F": L + rng.normal(0, 0.01, 240)})


@pytest.mark.parametrize(
    ("signal", "text", "values", "like"),
    [
        ("T", "a*{x}", {"a": 0.4}, "thermal_drift"),  # counted from another temperature, of no use to anybody
        ("L", "a*loop({x}, reach)", {"a": -0.05, "reach": 20.0}, "hysteresis"),
        ("L", "a*loop({x}, reach)", {"a": 0.05, "reach": 20.0}, "hysteresis"),  # turned round
        ("L", "a*{x}**2", {"a": 2e-3}, "nonlinearity"),
        ("T", "a*sin(2*pi*{x}/period)", {"a": 2.0, "period": 0.9}, None),
    ],
)
def test_a_law_is_told_to_be_like_the_effect_that_does_the_same(tmp_path, signal, text, values, like):
    runs = {f"r{seed}__csv": loaded(seed) for seed in (0, 1)}
    case = read_case(write_case(tmp_path, HEAD, simulator=CELL, **runs))
    problem = problem_of(case, model_of(case, None))
    base = fit(problem)
    screen = LinearisedFit.of(problem, base)
    scored = [score for each in candidates(problem) for score in screen.score(each)]
    shapes = {shape.text: shape for shape in (*ONE, *REMEMBERING)}
    shape = shapes.get(text) or replace(
        next(iter(shapes.values())), text=text, units=dict.fromkeys(values, "1")
    )
    by = next(each for each in signals_of(problem, base, "F") if each.written == f"[{signal}]")
    law = trial_at(problem, shape, (by,), "adds", "F", values).applied
    simulated = problem.simulate(base.p, (law,))
    made = replace(base, active=(law,), simulated=simulated)
    near = resembling(problem, screen, scored, made, law)
    assert (near[0][0] if near else None) == like
    assert all(0 <= distance < 0.5 for _, distance in near)
    if like is not None:
        assert near[0][1] < 0.2  # one operator for a loop, where the effect has several side by side
