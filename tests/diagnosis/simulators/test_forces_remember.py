"""A law that remembers, in an equation: the states that it brings along are those of the body left out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.case_text import case_text
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import law_effect

T = np.arange(400) * 0.05
FORCE = 8 * np.sin(1.7 * T) + 5 * np.sin(4.1 * T + 1)


def _model(folder: Path, *, columns: bool = True):
    """A mass of 2 kg on a spring of 40 N/m that was pulled by 0.2 m; asked row by row or in columns."""
    rates = 'x[1], (u["F"] - p["k"] * x[0] - x[1]) / 2.0'
    made = f"np.array([{rates}])" if columns else f"np.array([float(each) for each in ({rates})])"
    (folder / "sim.py").write_text(
        f"import numpy as np\ndef rhs(t, x, u, p):\n    return {made}\n"
        'def outputs(x, u, p):\n    return {"X": x[0]}\ndef initial(p):\n    return np.array([0.2, 0.0])\n'
    )
    (folder / "case.toml").write_text(
        case_text(
            "ode", states=["x", "v"], parameters={"k": (40.0, "N/m", 1.0)}, inputs={"F": "N"},
            outputs={"X": "m"}, runs=1,
        )
    )  # fmt: skip
    pd.DataFrame({"t": T, "F": FORCE, "X": 0 * T}).to_csv(folder / "r0.csv", index=False)
    case = read_case(folder / "case.toml")
    return case, model_of(case, None)


def _solved(rates, start):
    return solve_ivp(rates, (0, T[-1]), start, t_eval=T, rtol=1e-10, atol=1e-12, max_step=0.05).y[0]


@pytest.mark.parametrize("columns", [True, False])
def test_a_mode_is_a_second_mass_that_hangs_on_the_first(tmp_path, columns):
    case, model = _model(tmp_path, columns=columns)
    own, frequency, damping = 6.0, 1.3, 0.08  # of the second mass: kg, Hz, 1
    w = 2 * np.pi * frequency

    def rates(t, y):
        x, v, z, vz = y
        spring = w * w * (z - x) + 2 * damping * w * vz  # its damper stands against the ground
        plain = (np.interp(t, T, FORCE) - 40 * x - v) / 2.0
        return [v, plain + own * w * w * (z - x) / 2.0, vz, -spring]

    law = law_effect("law enters: a*([position] - mode([position], frequency, damping))")
    values = {"a": own * w * w / 2.0, "frequency": frequency, "damping": damping}
    made = model.simulate(case.runs[0], {"k": 40.0}, [AppliedEffect(effect=law, channel="v", values=values)])
    np.testing.assert_allclose(made["X"], _solved(rates, [0.2, 0.0, 0.2, 0.0]), atol=2e-6)


@pytest.mark.parametrize("columns", [True, False])
def test_a_lag_is_a_body_that_follows(tmp_path, columns):
    case, model = _model(tmp_path, columns=columns)
    law = law_effect("law enters: a*lag([F], tau)")
    made = model.simulate(
        case.runs[0], {"k": 40.0},
        [AppliedEffect(effect=law, channel="v", values={"a": 0.3, "tau": 0.7})],
    )["X"]  # fmt: skip

    def rates(t, y):
        force = np.interp(t, T, FORCE)
        return [y[1], (force - 40 * y[0] - y[1]) / 2.0 - 0.3 * y[2], (force - y[2]) / 0.7]

    np.testing.assert_allclose(made, _solved(rates, [0.2, 0.0, FORCE[0]]), atol=2e-6)


def test_sets_with_and_without_it_are_simulated_side_by_side(tmp_path):
    case, model = _model(tmp_path)
    law = law_effect("law enters: a*([itself] - lag([itself], tau))")
    applied = [
        AppliedEffect(effect=law, channel="v", values={"a": a, "tau": tau})
        for a, tau in ((0.5, 0.4), (2.0, 1.5))
    ]
    points = [({"k": 40.0}, ()), *(({"k": 40.0}, (each,)) for each in applied)]
    model.capability.together(list(case.runs), points)
    side_by_side = [model.simulate(case.runs[0], p, active)["X"] for p, active in points]
    for (p, active), values in zip(points, side_by_side, strict=True):
        alone = model_of(case, None).simulate(case.runs[0], p, active)["X"]
        np.testing.assert_allclose(values, alone, atol=2e-7)
