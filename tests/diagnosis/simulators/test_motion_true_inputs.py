"""A force follows the motion as it was, and not what a sensor made of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect

DASHPOT = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    rate = inputs["v"] if "v" in inputs else np.gradient(inputs["x"], 0.01)
    return pd.DataFrame({"F": p["c"] * rate})
"""


@pytest.mark.parametrize(("channel", "unit"), [("v", "m/s"), ("x", "m")])
@pytest.mark.parametrize("force", ["coulomb_friction", "viscous_damping"])
def test_a_mirrored_sensor_leaves_a_force_as_it_is(
    tmp_path: Path, channel: str, unit: str, force: str
) -> None:
    """The motion is one, whether its sensor was mounted right or the wrong way round."""
    t = np.arange(300) * 0.01
    moved = np.sin(5.0 * t) + 0.3 * np.sin(13.0 * t)
    text = case_text(
        "python", parameters={"c": (2.0, "N*s/m", 0.5)}, inputs={channel: unit}, outputs={"F": "N"}, runs=2
    )
    right, mirrored = (pd.DataFrame({"t": t, channel: sign * moved, "F": np.zeros(300)}) for sign in (1, -1))
    case = read_case(write_case(tmp_path, text, simulator=DASHPOT, r0__csv=right, r1__csv=mirrored))
    model = model_of(case, None, None)
    listed = {
        (each.name, each.active.channel): each for each in reversed(candidates(problem_of(case, model)))
    }

    def at_start(name: str, place: str) -> AppliedEffect:
        candidate = listed[name, place]
        return replace(candidate.active, values=dict(candidate.starts[0].values))

    acting, sign = at_start(force, "F"), at_start("channel_sign", channel)
    as_mounted = model.simulate(case.runs[0], {"c": 2.0}, (acting,))["F"]
    without = model.simulate(case.runs[0], {"c": 2.0}, ())["F"]
    assert np.ptp(as_mounted - without) > 0.01
    turned_round = model.simulate(case.runs[1], {"c": 2.0}, (sign, acting))["F"]
    np.testing.assert_allclose(turned_round, as_mounted, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(
    ("unit", "has_a_place"), [("N", True), ("N*m", True), ("A", True), ("mA", True), ("V", False)]
)
def test_friction_is_missing_in_what_a_drive_exerts_or_takes_to_exert_it(
    tmp_path: Path, unit: str, has_a_place: bool
) -> None:
    """A motor's current is the commonest measure of its torque; a voltage may be anything's."""
    t = np.arange(300) * 0.01
    recorded = pd.DataFrame({"t": t, "v": np.sin(5.0 * t), "F": np.zeros(300)})
    text = case_text(
        "python",
        parameters={"c": (2.0, f"{unit}*s/m", 0.5)},
        inputs={"v": "m/s"},
        outputs={"F": unit},
        runs=1,
    )
    case = read_case(write_case(tmp_path, text, simulator=DASHPOT, r0__csv=recorded))
    listed = candidates(problem_of(case, model_of(case, None, None)))
    assert any(each.name == "coulomb_friction" for each in listed) is has_a_place
