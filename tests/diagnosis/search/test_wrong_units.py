"""A wrong unit of an input or an output is found by the ratio of the units, before any law of a factor."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of

PISTON = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": inputs["P"] * 0.1 * p["area"] + 0.0 * inputs["x"]})
"""
HEAD = case_text(
    "python", parameters={"area": (500.0, "mm^2", 5.0)}, inputs={"x": "mm", "P": "bar"},
    outputs={"F": "N"}, runs=2,
)  # fmt: skip
ROTOR = """
def initial(p):
    return [0.0]
def rhs(t, x, u, p):
    return [(p["gain"] * u["M"] - x[0]) / 0.5]
def outputs(x, u, p):
    return {"w": x[0]}
"""


def piston(seed: int, *, pressure: float = 1.0, force: float = 1.0) -> pd.DataFrame:
    """Return a piston of 503 mm^2 with its columns in other units than bar and N by these factors."""
    rng = np.random.default_rng(seed)
    t = np.arange(60) * 0.1
    bar = 4.0 + seed + 2.0 * np.sin(0.9 * t + seed)
    F = 50.3 * bar + rng.normal(0, 1.0, len(t))
    return pd.DataFrame({"t": t, "x": np.cos(t), "P": bar * pressure, "F": F * force})


ANOTHER = pytest.mark.campaign("another pair of units: one is named in every run")


@pytest.mark.parametrize(
    ("columns", "channel", "factor", "told"),
    [
        ({"pressure": 100.0}, "P", 100.0, "kPa read as bar"),
        pytest.param({"pressure": 14.503774}, "P", 14.503774, "psi read as bar", marks=ANOTHER),
    ],
)
def test_an_input_in_another_unit_is_named_with_both_units(tmp_path, columns, channel, factor, told):
    runs = {f"r{seed}__csv": piston(seed, **columns) for seed in (0, 1)}
    answer = diagnose(read_case(write_case(tmp_path, HEAD, simulator=PISTON, **runs)), None).diagnosis
    names = [effect for effect in answer.effects if effect.name == "unit_error"]
    assert len(names) == 1
    both = {channel, "F"}  # of a force in proportion to one pressure, the other number may be wrong as well
    assert names[0].key.channel in both
    (parameter,) = (each for each in names[0].parameters if each.name == "factor")
    assert parameter.value == pytest.approx(factor, rel=1e-3) or names[0].key.channel == "F"
    assert told in names[0].statement


@pytest.mark.campaign("an equation in place of a function: the inputs of a function are asked in every run")
def test_the_inputs_of_an_equation_are_asked_for_their_units(tmp_path):
    rng = np.random.default_rng(3)
    t = np.arange(120) * 0.05
    moment = 2.0 + np.sin(1.3 * t)
    w = np.zeros(len(t))
    for i in range(1, len(t)):
        w[i] = w[i - 1] + 0.05 * (3.0 * moment[i - 1] - w[i - 1]) / 0.5
    run = pd.DataFrame({"t": t, "M": moment / (4.4482216 * 0.3048), "w": w + rng.normal(0, 0.02, len(t))})
    head = case_text(
        "ode",
        parameters={"gain": (3.0, "1/(N*m*s)", 0.1)},
        inputs={"M": "N*m"},
        outputs={"w": "rad/s"},
        runs=1,
        states=["w"],
    )
    path = write_case(tmp_path, head, simulator=ROTOR, r0__csv=run, r1__csv=None)
    answer = diagnose(read_case(path), None).diagnosis
    (effect,) = answer.effects
    assert (effect.name, effect.key.channel) == ("unit_error", "M")
    assert "lbf*ft read as N*m" in effect.statement


def test_a_simulation_that_is_only_a_little_wrong_is_asked_for_no_unit(tmp_path):
    from toolkit.diagnosis.search.search import _as_declared
    from toolkit.diagnosis.search.wrong_units import wrong_units

    runs = {f"r{seed}__csv": piston(seed) for seed in (0, 1)}
    case = read_case(write_case(tmp_path, HEAD, simulator=PISTON, **runs))
    problem = problem_of(case, model_of(case, None, None))
    declared = _as_declared(problem)
    assert wrong_units(problem, (declared, declared)) == ()


def test_an_input_that_lost_its_sign_is_named_though_it_drives_little_of_the_output(tmp_path):
    simulator = PISTON.replace("0.0 * inputs", "8.0 * inputs")
    runs = {}
    for seed in (0, 1):
        frame = piston(seed)
        frame["F"] -= 8.0 * frame["x"]  # recorded against the way of the simulation
        runs[f"r{seed}__csv"] = frame
    answer = diagnose(read_case(write_case(tmp_path, HEAD, simulator=simulator, **runs)), None).diagnosis
    assert [(effect.name, effect.key.channel) for effect in answer.effects] == [("channel_sign", "x")]


BASIN = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"h": p["k"] * inputs["q"] / (1 + 0.1 * inputs["q"])})
"""
INFLOW = case_text(
    "python", parameters={"k": (2.0, "cm*min/l", 0.01)}, inputs={"q": "l/min"}, outputs={"h": "cm"}, runs=3
)


def basin(seed: int, factor: float) -> pd.DataFrame:
    """Return the level over the inflow, which is recorded too large by a factor."""
    rng = np.random.default_rng(seed)
    t = np.arange(60) * 0.5
    q = rng.uniform(2.0, 12.0, 60)
    return pd.DataFrame({"t": t, "q": q * factor, "h": 2 * q / (1 + 0.1 * q) + rng.normal(0, 0.05, 60)})


@pytest.mark.campaign("one more factor: a unit, and a sign that was lost, are named in every run")
def test_a_factor_of_an_input_that_is_no_ratio_of_units_is_told_with_its_interval(tmp_path):
    """Pounds of water for litres: no list of volume flows has it, and the level meets a ratio near."""
    runs = {f"r{seed}__csv": basin(seed, 2.2046226) for seed in range(3)}
    answer = diagnose(read_case(write_case(tmp_path, INFLOW, simulator=BASIN, **runs)), None).diagnosis
    (effect,) = answer.effects
    assert (effect.name, effect.key.channel) == ("sensitivity_error", "q")
    (gain,) = effect.parameters
    low, high = gain.ci95
    assert low < 1.2046226 < high < low + 0.1
    assert any("off by a factor" in text for text in answer.next_measurements)


@pytest.mark.parametrize(
    ("noise", "left", "structured", "named"),
    [
        (0.05, 0.0, True, True),  # narrow, and nothing but the sensor's noise is left
        (0.05, 0.0, False, True),
        (5.0, 0.0, False, False),  # so wide that several ratios are in it
        (0.05, 1.0, True, False),  # structure is left: an exact factor would be a guess
    ],
)
def test_a_unit_is_named_where_its_factor_is_certain_and_nothing_else_is_left(
    tmp_path, noise, left, structured, named
):
    from toolkit.diagnosis.fit.fit import fit
    from toolkit.diagnosis.fit.folds import folds_of, hold_out
    from toolkit.diagnosis.fit.problem import problem_of
    from toolkit.diagnosis.search.channel_factors import factor_of, free_factor, with_units_judged
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.diagnosis.simulators.build_simulator import model_of
    from toolkit.effects.applied import AppliedEffect
    from toolkit.effects.catalogue import effects

    rng = np.random.default_rng(5)
    frames = {f"r{seed}__csv": basin(seed, 1000 / 60) for seed in range(3)}
    for frame in frames.values():
        frame["h"] += left * np.sin(0.3 * frame["t"]) + rng.normal(0, noise, len(frame))
    case = read_case(write_case(tmp_path, INFLOW, simulator=BASIN, **frames))
    problem = problem_of(case, model_of(case, None))
    place = AppliedEffect(effect=effects()["unit_error"], channel="q", values={"factor": 16.0})
    made = fit(problem, (free_factor(place, 16.0),))
    folds = folds_of(problem, made)
    step = Step(active=made.active[0], p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=())
    held = hold_out(problem, folds, made.active, made)
    _, _, (judged,) = with_units_judged(problem, folds, made, held, [step], structured=structured)
    assert judged.active.effect.name == ("unit_error" if named else "sensitivity_error")
    if named:
        assert factor_of(judged.active) == pytest.approx(1000 / 60, rel=1e-12)


def test_a_steep_bend_is_no_factor(tmp_path):
    """F = L + 0.008 L^2 up to 9 kN: a factor takes most of the error, and leaves 3 000 times the noise."""
    text = cell_case(0.001).replace('role = "output"', 'role = "output", sd = 0.4')
    frames = {}
    for k in range(2):
        t = np.arange(90) * 2.0
        L = 1000 * np.abs(np.sin(0.021 * t + k)) + 100 * (np.arange(90) // 15 % 3)
        noise = np.random.default_rng(k).normal(0, 0.4, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": L, "F": L + 0.008 * L**2 + noise})
        text += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    case = read_case(write_case(tmp_path, text, simulator=CELL, **frames))
    (effect,) = diagnose(case, None, limits=None).diagnosis.effects
    assert effect.name == "nonlinearity"
    (quadratic,) = [size for size in effect.parameters if size.name == "quadratic"]
    assert quadratic.ci95[0] < 0.008 < quadratic.ci95[1]


@pytest.mark.parametrize(("stated", "asked"), [("V", True), ("degC", False), ("degF", False)])
def test_a_sign_is_asked_of_what_has_a_direction(tmp_path, stated, asked):
    # A zero by convention parts no directions: a wall that stores heat was a thermometer with a lost sign.
    wall = case_text(
        "python", parameters={"U": (2.0, f"W/m^2/{'V' if asked else 'K'}", 1.0)},
        inputs={"inside": stated, "outside": stated}, outputs={"flow": "W/m^2"}, runs=2,
    )  # fmt: skip
    simulator = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"flow": p["U"] * (inputs["inside"] - inputs["outside"])})
"""
    t = np.arange(40) * 600.0
    frame = pd.DataFrame({"t": t, "inside": 19 + np.sin(t / 4000), "outside": 12 + np.cos(t / 7000)})
    runs = {f"r{k}__csv": frame.assign(flow=14.0 + k + np.sin(t / 900)) for k in (0, 1)}
    case = read_case(write_case(tmp_path, wall, simulator=simulator, **runs))
    places = [candidate.active.key for candidate in candidates(problem_of(case, model_of(case, None, None)))]
    signs = {place.channel for place in places if place.name == "channel_sign"}
    assert (signs >= {"inside", "outside"}) is asked
    assert "flow" in signs
