"""A nominal parameter is uncertain by its prior, not free: what lies far beyond it is an effect."""

import numpy as np
import pandas as pd

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

SIMULATOR = """
def simulate(inputs, p):
    import pandas as pd
    return pd.DataFrame({"F": p["k"] * inputs["x"]})
"""
CASE = case_text(
    "python",
    title="A spring",
    parameters={"k": (100.0, "N/m", 5.0)},
    inputs={"x": "m"},
    outputs={"F": "N"},
    runs=2,
)


def spring(seed, sign):
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(160)
    x = np.sin(1.1 * t + seed) + 0.4 * np.sin(2.3 * t)
    return pd.DataFrame({"t": t, "x": x, "F": sign * 101.0 * x + rng.normal(0, 2.0, len(t))})


def test_a_channel_of_the_wrong_sign_is_no_stiffness_of_minus_a_hundred(tmp_path):
    runs = {f"r{i}__csv": spring(i, -1.0) for i in range(2)}
    case = write_case(tmp_path, CASE, simulator=SIMULATOR, **runs)
    made = diagnose(read_case(case), None).diagnosis
    assert [one.name for one in made.effects] == ["channel_sign"]
    (k,) = made.nominal_parameters
    # 320 rows of 2 N against 100 N/m times about 0.76 m: 0.15 N/m; three of them
    assert abs(k.after - 101.0) < 0.5


def test_a_stiffness_within_its_prior_is_found_and_nothing_is_named(tmp_path):
    runs = {f"r{i}__csv": spring(i, 1.0) for i in range(2)}
    case = write_case(tmp_path, CASE.replace("value = 100.0", "value = 110.0"), simulator=SIMULATOR, **runs)
    made = diagnose(read_case(case), None).diagnosis
    assert (made.verdict, made.effects) == ("nothing", ())
    (k,) = made.nominal_parameters
    assert abs(k.after - 101.0) < 0.5
