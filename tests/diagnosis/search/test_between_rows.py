"""A lag of less than a row, which a delay imitates: what the output did between the rows is not recorded."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

FINE = 40  # steps to a row of 40 ms
SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["m"] * inputs["a"] + p["c"] * inputs["v"]})
"""


def _moved(seed: int, time_constant: float) -> pd.DataFrame:
    """A carriage with dry friction; the force lags as a continuous filter of first order has it."""
    rng = np.random.default_rng(seed)
    t = np.arange(350 * FINE) * (0.04 / FINE)
    waves = [(rng.uniform(0.05, 0.1), w, rng.uniform(0, 6)) for w in rng.uniform(0.6, 5.0, 5)]
    v = sum(a * np.sin(w * t + p) for a, w, p in waves)
    a = sum(a * w * np.cos(w * t + p) for a, w, p in waves)
    force = 95 * a + 205 * v + 6 * np.sign(v)
    late, keep = np.empty_like(force), np.exp(-0.04 / FINE / time_constant)
    late[0] = force[0]
    for i in range(1, len(force)):
        late[i] = keep * late[i - 1] + (1 - keep) * force[i]
    table = pd.DataFrame({"t": t, "v": v, "a": a, "F": late})[::FINE]
    table["F"] += rng.normal(0, 1.0, len(table))
    return table


@pytest.mark.parametrize(("time_constant", "told_apart"), [(0.016, False), (0.11, True)])
def test_what_the_rows_do_not_tell_apart_is_one_class(tmp_path, time_constant, told_apart):
    (tmp_path / "sim.py").write_text(SIMULATOR)
    (tmp_path / "case.toml").write_text(
        case_text(
            "python", function="simulate", parameters={"m": (95.0, "kg", 3.0), "c": (205.0, "N*s/m", 8.0)},
            inputs={"v": "m/s", "a": "m/s^2"}, outputs={"F": "N"}, runs=4,
        )
    )  # fmt: skip
    for i in range(4):
        _moved(i, time_constant).to_csv(tmp_path / f"r{i}.csv", index=False)
    answer = json_value(diagnose(read_case(tmp_path / "case.toml"), None).diagnosis)
    classes = [{each["name"], *each["equivalent_to"]} for each in answer["effects"]]
    assert {"coulomb_friction"} in classes
    assert ({"filter_lag"} if told_apart else {"filter_lag", "channel_delay"}) in classes
