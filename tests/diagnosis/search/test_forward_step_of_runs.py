"""An effect of some runs alone has a value a run as its evidence, and not its rows."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

GAINS = (-0.011, -0.004, 0.002, 0.008, -0.006, 0.005, 0.006)  # of seven mountings; the eighth is the test's


def mountings(folder, *, last):
    """Return readings of a propeller on eight motors, the last with a gain of its own."""
    (folder / "sim.py").write_text(
        "import pandas as pd\n"
        "def simulate(inputs, p):\n"
        "    return pd.DataFrame({'thrust': p['k'] * (inputs['speed'] / 1000) ** 2})\n"
    )
    text = case_text(
        "python", function="simulate", time=None, parameters={"k": (1.1, "N", 0.15)},
        inputs={"speed": "rpm"}, outputs={"thrust": "N"},
    )  # fmt: skip
    rng = np.random.default_rng(4)
    for i, gain in enumerate((*GAINS, last)):
        speed = np.linspace(5000, 18000, 27) + rng.normal(0, 30, 27)
        thrust = 1.13 * (1 + gain) * (speed / 1000) ** 2 + rng.normal(0, 1.5) + rng.normal(0, 1.0, 27)
        pd.DataFrame({"speed": speed, "thrust": thrust}).to_csv(folder / f"r{i}.csv", index=False)
        text += f'[[recording.run]]\nfile = "r{i}.csv"\nmotor = "{"abcdefgh"[i]}"\n'
    (folder / "case.toml").write_text(text)
    return read_case(folder / "case.toml")


@pytest.mark.parametrize(("last", "runs"), [(0.026, None), (-0.3, ("r7.csv",))])
def test_a_gain_that_any_mounting_may_have_is_no_effect_of_one_and_a_far_one_is(tmp_path, last, runs):
    effects = diagnose(mountings(tmp_path, last=last), None).diagnosis.effects
    if runs is None:
        assert not effects
    else:
        (effect,) = effects
        assert effect.name == "sensitivity_error"
        assert all(parameter.runs == runs for parameter in effect.parameters)
