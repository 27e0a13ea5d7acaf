"""A loop follows the way that a signal went: its rows need an order, and no time."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd

from tests.diagnosis.case_text import case_text
from tests.diagnosis.law.test_learn import estimates
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

HEIGHT, REACH = 0.15, 0.006  # of the loop [1], and the way over which it turns round, to either side [m]


def _bent(seed: int) -> pd.DataFrame:
    """Return a column bent to and fro, each time farther: a spring beside friction that yields."""
    rng = np.random.default_rng(seed)
    ends = np.concatenate([[0.0], *[[size, -size] for size in (0.01, 0.02, 0.03, 0.04)]])
    x = np.concatenate([np.linspace(a, b, 60, endpoint=False) for a, b in itertools.pairwise(ends)])
    held, loop = 0.0, []
    for step in np.diff(x, prepend=x[0]):  # a stop: elastic to its limit, and there it slides
        held = float(np.clip(held + step / REACH, -1, 1))
        loop.append(held)
    noise = rng.normal(0, 1e-3, len(x))
    return pd.DataFrame({"x": x, "load": 12 * x + HEIGHT * np.array(loop) + noise})


def test_a_loop_is_learned_of_readings_in_the_order_in_which_they_were_taken(tmp_path):
    (tmp_path / "sim.py").write_text(
        "import pandas as pd\n"
        "def simulate(inputs, p):\n"
        "    return pd.DataFrame({'load': p['stiffness'] * inputs['x']})\n"
    )
    (tmp_path / "case.toml").write_text(
        case_text(
            "python", function="simulate", time=None, parameters={"stiffness": (20.0, "1/m", 20.0)},
            inputs={"x": "m"}, outputs={"load": "1"}, runs=1,
        )
    )  # fmt: skip
    _bent(1).to_csv(tmp_path / "r0.csv", index=False)
    answer = json_value(diagnose(read_case(tmp_path / "case.toml"), None).diagnosis)
    (law,) = [law for law in answer["laws"] if law["form"] == "loop"]
    sizes = estimates(law)
    assert law["variables"] in (["x"], ["load"])  # the simulation is in proportion: its way is that of x
    assert abs(sizes["a"][0] / HEIGHT - 1) < 0.1
    (errors,) = answer["fit"]["held_out"]
    assert errors["with_laws_rmse"] < 0.3 * errors["refitted_rmse"]
