"""Arrays stand for a DataFrame where a simulator gives the same with them, and nowhere else."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.python import UserFunction
from toolkit.errors import FitError

CASE = case_text(
    "python", parameters={"k": (2.0, "1", 1.0)}, inputs={"x": "1"}, outputs={"y": "1"}, runs=1,
)  # fmt: skip
X = np.array([0.5, -1.0, 2.0, 4.0])
HEAD = "import numpy as np\nimport pandas as pd\nSEEN = []\ndef simulate(inputs, p):\n"
HEAD += "    SEEN.append(type(inputs).__name__)\n"
# What a simulator asks of its inputs, and what comes out for k = 2.
ARRAYS_DO = {
    "columns": ('    y = p["k"] * np.abs(inputs["x"]) + inputs.x * 0', 2 * np.abs(X)),
    "numbers": ('    y = p["k"] * inputs["x"].to_numpy() + inputs["x"].values * 0', 2 * X),
    "names": ('    y = p["k"] * inputs["x"] * len(inputs) if "x" in inputs.columns else None', 8 * X),
    "labels": ('    y = pd.Series(p["k"] * inputs["x"], index=inputs.index)', 2 * X),
}
TABLE_ALONE = {
    "shifted": ('    y = p["k"] * inputs["x"].shift(1).fillna(0)', 2 * np.array([0, *X[:-1]])),
    # A Series divides by n - 1, an array by n.
    "sample": ('    y = p["k"] * inputs["x"] / inputs["x"].std()', 2 * X / np.std(X, ddof=1)),
    # An array taken from a table is the table's own, a Series is not.
    "in_place": (
        '    x = inputs["x"]\n    x -= 1.0\n    y = p["k"] * inputs["x"] + 0 * x', 2 * X,
    ),
}  # fmt: skip


def function(folder, body):
    simulator = f'{HEAD}{body}\n    return pd.DataFrame({{"y": y}})\n'
    table = pd.DataFrame({"t": np.arange(4.0), "x": X, "y": X})
    case = read_case(write_case(folder, CASE, simulator=simulator, r0__csv=table))
    return UserFunction(case), case.runs[0]


def seen(called):
    return called._function.__globals__["SEEN"]


@pytest.mark.parametrize(("body", "expected"), ARRAYS_DO.values(), ids=ARRAYS_DO)
def test_a_simulator_that_asks_for_columns_alone_gets_arrays(tmp_path, body, expected):
    called, run = function(tmp_path, body)
    for _ in range(9):
        np.testing.assert_array_equal(called.call(run, {"k": 2.0}, {})["y"], expected)
    # Tried beside a DataFrame on the first, second, fourth and eighth call.
    assert seen(called).count("DataFrame") == 4
    assert seen(called).count("ArrayTable") == 9


@pytest.mark.parametrize(("body", "expected"), TABLE_ALONE.values(), ids=TABLE_ALONE)
def test_a_simulator_that_asks_for_more_gets_a_table(tmp_path, body, expected):
    called, run = function(tmp_path, body)
    for _ in range(5):
        np.testing.assert_allclose(called.call(run, {"k": 2.0}, {})["y"], expected, rtol=1e-15)
    assert seen(called) == ["ArrayTable", *["DataFrame"] * 5]


def test_changed_inputs_reach_a_simulator_of_arrays(tmp_path):
    called, run = function(tmp_path, ARRAYS_DO["columns"][0])
    for _ in range(3):
        np.testing.assert_array_equal(called.call(run, {"k": 2.0}, {"x": -3 * X})["y"], 6 * np.abs(X))


def test_parameters_without_an_answer_leave_the_arrays_where_they_were(tmp_path):
    body = '    y = inputs["x"] / (0 if p["k"] < 0 else p["k"])\n    if p["k"] < 0: raise ValueError("k")'
    called, run = function(tmp_path, body)
    called.call(run, {"k": 2.0}, {})
    with pytest.raises(FitError, match="ValueError: k"):
        called.call(run, {"k": -1.0}, {})
    called.call(run, {"k": 4.0}, {})
    assert seen(called)[-1] == "ArrayTable"
