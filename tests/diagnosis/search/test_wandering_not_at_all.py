"""A tank's gauge with a zero: beside it the sensor's noise is left, and nothing has wandered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

SENSOR, ZERO = 0.0007, 0.012  # m
CASE = case_text(
    "ode", title="A tank with an outlet", states=["h"],
    parameters={"area": (0.5, "m^2", 0.015), "outlet": (0.0024, "m^2.5/s", 7.2e-5)},
    inputs={"Q": "l/s"}, outputs={"H": ("m", SENSOR)}, runs=4,
)  # fmt: skip
TANK = """
import math
import numpy as np
def rhs(t, x, u, p):
    return np.array([(u["Q"] * 1e-3 - p["outlet"] * math.sqrt(max(x[0], 0.0))) / p["area"]])
def outputs(x, u, p):
    return {"H": x[0]}
def initial(p):
    return np.array([0.25])
"""


def tank(seed: int) -> pd.DataFrame:
    """Return a run of 600 s; the noise of the gauge is coloured, AR(1) of 0.9."""
    rng = np.random.default_rng(seed)
    t = np.arange(300) * 2.0
    flow = 1.1 + 0.25 * np.sin(2 * np.pi * t / 240 + seed) + 0.1 * np.sin(2 * np.pi * t / 91)

    def rate(at: float, h: np.ndarray) -> np.ndarray:
        return np.asarray((np.interp(at, t, flow) * 1e-3 - 0.00242 * np.sqrt(h)) / 0.505)

    level = solve_ivp(rate, (0.0, t[-1]), [0.25], t_eval=t, rtol=1e-9, max_step=2.0).y[0]
    noise = lfilter([np.sqrt(1 - 0.9**2)], [1, -0.9], rng.normal(0, SENSOR, t.size + 200))[200:]
    return pd.DataFrame({"t": t, "Q": flow, "H": level + ZERO + noise})


def test_a_zero_beside_which_the_sensors_noise_is_left_is_named(tmp_path: Path) -> None:
    files = {f"r{seed}__csv": tank(seed) for seed in range(4)}
    answer = diagnose(read_case(write_case(tmp_path, CASE, simulator=TANK, **files)), None).diagnosis
    (effect,) = answer.effects
    assert effect.name == "zero_offset"
    (offset,) = [parameter for parameter in effect.parameters if parameter.name == "offset"]
    assert offset.ci95 is not None
    assert offset.ci95[0] < ZERO < offset.ci95[1]
    assert answer.laws == ()
