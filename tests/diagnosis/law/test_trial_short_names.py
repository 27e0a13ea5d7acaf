"""A channel may have any name, also one that is a part of another: of the time, or of the law's own words."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from toolkit.declared import json_value
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.search import search


@pytest.mark.parametrize("name", ["i", "me", "self", "e"])
def test_a_law_of_it_and_of_the_time_is_learned(tmp_path, monkeypatch, name):
    monkeypatch.setattr(search, "candidates", lambda _: ())
    (tmp_path / "sim.py").write_text(
        "import pandas as pd\ndef simulate(inputs, p):\n"
        f'    return pd.DataFrame({{"F": p["k"] * inputs["{name}"]}})\n'
    )
    (tmp_path / "case.toml").write_text(
        case_text(
            "python", function="simulate", parameters={"k": (2.0, "N/A", 0.1)}, inputs={name: "mA"},
            outputs={"F": "mN"}, runs=3,
        )
    )  # fmt: skip
    for number in range(3):
        rng = np.random.default_rng(number)
        t = np.arange(200) * 0.1
        current = 10 * np.sin(1.3 * t + rng.uniform(0, 6)) + 5 * np.sin(0.7 * t + rng.uniform(0, 6))
        force = 2 * current + 0.05 * current**2 + rng.normal(0, 0.3, len(t))
        table = pd.DataFrame({"t": t, name: current, "F": force})
        table.to_csv(tmp_path / f"r{number}.csv", index=False)
    (law,) = json_value(diagnose(read_case(tmp_path / "case.toml"), None).diagnosis)["laws"]
    assert law["variables"] == [name]
    (a,) = law["parameters"]
    assert a["ci95"][0] < 0.05 < a["ci95"][1]  # mN/mA^2
