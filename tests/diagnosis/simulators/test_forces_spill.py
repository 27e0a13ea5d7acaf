"""What runs over in one place and arrives in the next: none is lost, and no equation invents a next place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.forces import Forces
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effect

HEAD = """schema = 1
title = "Tanks"
[simulation]
kind = "ode"
path = "sim.py"
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
u = { unit = "m/s", role = "input" }
y = { unit = "m", role = "output", sd = 0.004 }
"""
PARAMETER = """[simulation.parameters.{name}]
value = {value}
unit = "m^0.5/s"
sd = {sd}
bounds = [0.001, 0.2]
"""
RUNS = "".join(f'[[recording.run]]\nfile = "r{k}.csv"\n' for k in range(2))
CASCADE = """
import math
def initial(p):
    return [0.3, 0.3]
def rhs(t, x, u, p):
    between = p["between"] * math.sqrt(max(x[0], 0.0))
    return [u["u"] - between, between - p["outlet"] * math.sqrt(max(x[1], 0.0))]
def outputs(x, u, p):
    return {"y": x[1]}
"""
BETWEEN, OUTLET, LEVEL, SHARE = 0.02, 0.021, 0.62, 0.65


def _parameters(*, off: float = 1.0, sd: float = 0.002) -> str:
    return "".join(
        PARAMETER.format(name=name, value=off * value, sd=sd)
        for name, value in (("between", BETWEEN), ("outlet", OUTLET))
    )


def _tanks(seed: int, share: float) -> pd.DataFrame:
    """Return a level recorded each 5 s; small Euler steps with a hard rim, no code of the toolkit's."""
    rng = np.random.default_rng(seed)
    t = 5.0 * np.arange(150)
    u = np.interp(t, t[::20], rng.uniform(0.006, 0.024, 8))
    upper = lower = 0.3
    step, levels = 0.05, []
    for k, poured in enumerate(np.interp(np.arange(0.0, 5.0 * len(t), step), t, u).tolist()):
        if k % 100 == 0:
            levels.append(lower)
        between = BETWEEN * upper**0.5
        raised = upper + step * (poured - between)
        upper = min(raised, LEVEL)
        lower += step * (between - OUTLET * lower**0.5) + share * (raised - upper)
    return pd.DataFrame({"t": t, "u": u, "y": np.array(levels) + rng.normal(0, 0.004, len(t))})


def _model(folder: Path, simulator: str, toml: str = HEAD + _parameters() + RUNS):
    runs = {f"r{k}__csv": _tanks(k, SHARE) for k in range(2)}
    return model_of(read_case(write_case(folder, toml, simulator=simulator, **runs)), None)


def test_what_is_held_back_arrives_or_is_lost_as_the_share_says():
    for share, lost in ((1.0, 0.0), (0.25, 0.75), (0.0, 1.0)):
        spilling = AppliedEffect(
            effect=effect("overflow"), channel="a", values={"level": 0.5, "share": share}
        )
        forces = Forces.of([spilling], ("a", "b"), {}, {"a": (1.0, 1.0), "b": (1.0, 1.0)}, feeds={0: 1})
        x, rate = np.array([[0.4, 0.6, 0.6], [0.2, 0.2, 0.2]]), np.array([[0.3, 0.3, -0.3], [0.1, 0.1, 0.1]])
        before = rate.sum(axis=0)
        forces.add(x, rate, 2, {})
        # Below the rim and while it falls nothing is changed; above it both together lack the loss.
        assert before - rate.sum(axis=0) == pytest.approx([0.0, 0.3 * lost, 0.0], abs=1e-15)


def test_a_model_file_of_before_has_no_share_and_loses_what_runs_over():
    plain = AppliedEffect(effect=effect("overflow"), channel="a", values={"level": 0.5})
    forces = Forces.of([plain], ("a", "b"), {}, {"a": (1.0, 1.0), "b": (1.0, 1.0)}, feeds={0: 1})
    rate = np.array([0.3, 0.1])
    forces.add(np.array([0.6, 0.2]), rate, 2, {})
    assert rate == pytest.approx([0.0, 0.1])


@pytest.mark.parametrize(
    ("rates", "feeds"),
    [
        ("[u['u'] - a, a - b]", "x1"),
        ("[u['u'] - (a - b), (a - b) - b]", "x1"),  # two tanks joined below: each feels the other
        ("[u['u'] - a, -b]", None),  # nothing of the first comes to the second
        ("[x[1], -x[0] - x[1]]", None),  # a spring: a place whose loss is no force
    ],
)
def test_the_next_state_is_read_from_the_equation(tmp_path, rates, feeds):
    simulator = f"""
def initial(p):
    return [0.3, 0.3]
def rhs(t, x, u, p):
    a, b = p["between"] * x[0], p["outlet"] * x[1]
    return {rates}
def outputs(x, u, p):
    return {{"y": x[1]}}
"""
    model = _model(tmp_path, simulator)
    assert model.capability.motion.sizes("x0", lambda _: 1.0).feeds == feeds


@pytest.mark.campaign("a whole diagnosis: what spills and where it arrives is held in every run")
def test_an_overflow_into_the_next_tank_is_named_with_its_share(tmp_path):
    runs = {f"r{k}__csv": _tanks(k, SHARE) for k in range(2)}
    toml = HEAD + _parameters(off=1.03) + RUNS
    answer = diagnose(read_case(write_case(tmp_path, toml, simulator=CASCADE, **runs)), None).diagnosis
    (found,) = answer.effects
    assert found.name == "overflow"
    values = {parameter.name: parameter for parameter in found.parameters}
    assert values["level"].value == pytest.approx(LEVEL, abs=0.02)
    assert values["share"].ci95[0] <= SHARE <= values["share"].ci95[1]
    assert values["share"].value == pytest.approx(SHARE, abs=0.1)
