"""What no instrument does is not named after one, and a sign that a parameter's bound forbids is found."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

NEWTON = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    fall = np.exp(-inputs["t"].to_numpy() / p["time_constant"])
    return pd.DataFrame({"T": p["room"] + p["excess"] * fall})
"""
MUG = case_text(
    "python",
    parameters={
        "room": (21.0, "degC", 3.0),
        "excess": (60.0, "K", 20.0),
        "time_constant": (2000.0, "s", 1000.0, [60.0, 36000.0]),
    },
    outputs={"T": "degC"},
    runs=1,
)
DASHPOT = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["c"] * inputs["v"]})
"""
DAMPER = case_text(
    "python", parameters={"c": (5.0, "N*s/m", 3.0, [0.0, 50.0])}, inputs={"v": "m/s"},
    outputs={"F": "N"},
)  # fmt: skip


@pytest.mark.campaign("an impossible size of an equation: that of a function is held in every run")
def test_a_mug_that_takes_up_heat_does_not_creep(tmp_path):
    """Water and mug are two thermal masses: two decays, in closed form, where Newton's law has one."""
    t = np.arange(220) * 30.0
    heat = 22.0 + 52.0 * np.exp(-t / 3200.0) + 22.0 * np.exp(-t / 420.0)
    shown = heat + np.random.default_rng(0).normal(0, 0.1, t.size)
    case = write_case(tmp_path, MUG, simulator=NEWTON, r0__csv=pd.DataFrame({"t": t, "T": shown}))
    answer = diagnose(read_case(case), None).diagnosis
    assert answer.verdict == "unknown"
    assert not answer.effects


ABSORPTION = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"y": p["source"] * np.exp(-p["absorption"] * inputs["x"])})
"""
BLOCKS = case_text(
    "python",
    time=None,
    parameters={"source": (100.0, "1", 50.0), "absorption": (0.5, "1", 0.3)},
    inputs={"x": "1"},
    outputs={"y": "1"},
    runs=1,
)


def test_a_beam_that_spreads_is_no_channel_that_bends_by_three_times_its_range(tmp_path):
    """Ultrasound through blocks, exp(-a x)/(b + c x), where exp(-a x) alone is simulated."""
    x = np.tile(np.linspace(0.5, 6.0, 22), 10)
    response = np.exp(-0.19 * x) / (0.0061 + 0.0105 * x)
    shown = response + np.random.default_rng(1).normal(0, 3.3, x.size)
    case = write_case(tmp_path, BLOCKS, simulator=ABSORPTION, r0__csv=pd.DataFrame({"x": x, "y": shown}))
    answer = diagnose(read_case(case), None).diagnosis
    assert answer.verdict == "unknown"
    assert not answer.effects


def test_a_wrong_sign_is_found_although_a_bound_forbids_it(tmp_path):
    """Refitted with c >= 0 the simulation stands still, and from there a sign changes nothing."""
    frames = {}
    for k in range(3):
        t = np.arange(200) * 0.05
        v = np.sin(1.3 * t + k) + 0.4 * np.sin(4.1 * t)
        noise = np.random.default_rng(k).normal(0, 0.3, t.size)
        frames[f"r{k}__csv"] = pd.DataFrame({"t": t, "v": v, "F": -6.0 * v + noise})
    toml = DAMPER + "".join(f'[[recording.run]]\nfile = "r{k}.csv"\n' for k in range(3))
    answer = diagnose(read_case(write_case(tmp_path, toml, simulator=DASHPOT, **frames)), None).diagnosis
    assert [effect.name for effect in answer.effects] == ["channel_sign"]
    assert answer.nominal_parameters[0].after == pytest.approx(6.0, abs=0.1)
