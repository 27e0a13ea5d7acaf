"""All rows at once of what turns: the motion, and its derivatives, of a stiff solver.

The reference integrates Dahl's equation as a third state by an implicit method (LSODA); derivatives are
central differences of its solutions.
"""

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

REACH = 2e-3
SIMULATOR = """
def rhs(t, x, u, p):
    return [x[1], u["F"] - p["k"] * x[0] - 0.5 * x[1]]
def outputs(x, u, p):
    return {"X": x[0]}
def initial(p, run):
    return [run["x0"], p["v0"]]
"""
CASE = case_text(
    "ode", states=["x", "v"], force_terms={"v": "N/kg"},
    parameters={"k": (9.0, "1/s^2", 0.5), "v0": (0.3, "m/s", 0.1)}, inputs={"F": "N/kg"}, outputs={"X": "m"},
)  # fmt: skip
STARTS = (0.0, 0.4)
T = np.arange(0, 4, 0.05)
FORCE = 6.0 * np.sin(3.0 * T)
BASE = {"k": 9.0, "v0": 0.3, "coulomb": 1.5}


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    frames, text = {}, CASE
    for i, x0 in enumerate(STARTS):
        frames[f"r{i}__csv"] = pd.DataFrame({"t": T, "F": FORCE, "X": x0 * np.cos(T)})
        text += f'[[recording.run]]\nfile = "r{i}.csv"\nx0 = {x0}\n'
    return read_case(write_case(tmp_path_factory.mktemp("case"), text, simulator=SIMULATOR, **frames))


def point(values):
    dry = AppliedEffect(
        effect=effects()["coulomb_friction"], channel="v",
        values={"coulomb": values["coulomb"], "presliding": REACH},
    )  # fmt: skip
    return {"k": values["k"], "v0": values["v0"]}, (dry,)


def exact(values):
    def rate(t, x):
        pull = np.interp(t, T, FORCE) - values["k"] * x[0] - 0.5 * x[1] - values["coulomb"] * x[2]
        return [x[1], pull, (x[1] - abs(x[1]) * x[2]) / REACH]

    return np.concatenate(
        [
            solve_ivp(
                rate, (0, T[-1]), [x0, values["v0"], 0.0], method="LSODA", t_eval=T, rtol=1e-10, atol=1e-12,
                max_step=0.05,
            ).y[0]
            for x0 in STARTS
        ]
    )  # fmt: skip


def shown(model, case, values):
    return np.concatenate([model.simulate(run, *point(values))["X"] for run in case.runs])


class Counted:
    """The model's right-hand side, which counts its calls with columns and with one state."""

    def __init__(self, model):
        self._columns, self._rhs = model.equation.columns, model.equation.rhs
        self.at_once, self.alone = 0, 0
        model.equation.columns, model.equation.rhs = self.columns, self.rhs

    def columns(self, *asked):
        self.at_once += 1
        return self._columns(*asked)

    def rhs(self, *asked):
        self.alone += 1
        return self._rhs(*asked)


@pytest.mark.parametrize("moved", [{"coulomb": 1.4}, {"k": 9.3}, {"coulomb": 1.7, "v0": 0.35}])
def test_from_a_known_motion_all_rows_come_to_that_of_a_stiff_solver(case, moved):
    model = model_of(case, None)
    model.capability.together(case.runs, [point(BASE)])
    counted = Counted(model)
    model.capability.together(case.runs, [point(BASE | moved)])
    # the local tolerance is 1e-6 of a state; over eighty rows it may add up
    np.testing.assert_allclose(shown(model, case, BASE | moved), exact(BASE | moved), atol=2e-5)
    assert counted.alone == 0


def test_derivatives_are_those_of_a_stiff_solver(case):
    model = model_of(case, None)
    steps = {"k": 1e-4, "v0": 1e-5, "coulomb": 1e-4}
    sets = [BASE, *(BASE | {name: BASE[name] + step} for name, step in steps.items())]
    model.capability.together(case.runs, [point(values) for values in sets])
    base = shown(model, case, BASE)
    for values, (name, step) in zip(sets[1:], steps.items(), strict=True):
        slope = (shown(model, case, values) - base) / step
        wide = 30 * step
        there, back = (exact(BASE | {name: BASE[name] + by}) for by in (wide, -wide))
        expected = (there - back) / (2 * wide)
        # a step of one hundredth of a percent: what each simulation's own steps leave would be a tenth of it
        np.testing.assert_allclose(slope, expected, atol=5e-3 * np.abs(expected).max())


def test_what_turns_otherwise_is_simulated_as_well(case):
    model = model_of(case, None)
    p, (dry,) = point(BASE)
    other = AppliedEffect(effect=effects()["viscous_damping"], channel="v", values={"viscous": 0.2})
    model.capability.together(case.runs, [(p, (dry,)), (p, (dry, other)), (p, ())])
    fresh = model_of(case, None)
    for active in ((dry, other), ()):
        for run in case.runs:
            np.testing.assert_allclose(
                model.simulate(run, p, active)["X"], fresh.simulate(run, p, active)["X"], atol=2e-5
            )


def test_derivatives_ask_no_more_often_than_one_motion_has_turns(case):
    model = model_of(case, None)
    model.capability.together(case.runs, [point(BASE)])
    counted = Counted(model)
    sets = [BASE, BASE | {"k": 9.00001}, BASE | {"v0": 0.300001}, BASE | {"coulomb": 1.50001}]
    model.capability.together(case.runs, [point(values) for values in sets])
    # Two runs of eighty rows, four sets: a step each are already six calls times six hundred.
    assert counted.alone == 0
    assert counted.at_once < 600
