"""An output that was recorded twice: its second record is what no law may read."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.trial import signals_of
from toolkit.diagnosis.simulators.build_simulator import model_of

SIMULATOR = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"w": p["k"] * inputs["U"]})
"""


@pytest.mark.parametrize(
    ("angle", "factor", "of_it", "read"),
    [
        ("rad", 1.0, 1.0, {"q", "U", "dU/dt", "w", "dw/dt", "time"}),
        ("deg", 180 / np.pi, 1.0, {"q", "U", "dU/dt", "w", "dw/dt", "time"}),
        ("rad", 1.0, 0.5, {"q", "dq/dt", "U", "dU/dt", "w", "dw/dt", "time"}),  # behind a gear, no record
    ],
)
def test_the_rate_of_a_recorded_angle_is_no_signal_of_a_law(tmp_path, angle, factor, of_it, read):
    (tmp_path / "sim.py").write_text(SIMULATOR)
    (tmp_path / "case.toml").write_text(
        case_text(
            "python", function="simulate", parameters={"k": (2.0, "rad/(s*V)", 0.1)}, inputs={"U": "V"},
            outputs={"w": "rad/s"}, others={"q": {"unit": angle, "role": "covariate"}}, runs=2,
        )
    )  # fmt: skip
    for number in range(2):
        t = np.arange(300) * 0.02
        u = 5 + 3 * np.sin(2 * t + number)
        turned = of_it * (10 * t - 3 * np.cos(2 * t + number))
        noise = np.random.default_rng(number).normal(0, 0.1, len(t))
        table = pd.DataFrame({"t": t, "U": u, "w": 2 * u + noise, "q": factor * turned})
        table.to_csv(tmp_path / f"r{number}.csv", index=False)
    case = read_case(tmp_path / "case.toml")
    problem = problem_of(case, model_of(case, None))
    signals = {signal.name: signal for signal in signals_of(problem, fit(problem), "w")}
    assert set(signals) == read
    # A lag's difference is a rate: what the angle was before is no signal either.
    assert signals["q"].remembered is ("dq/dt" in read)
    assert signals["U"].remembered


@pytest.mark.parametrize(
    ("copied", "read"), [(True, {"U", "w", "time"}), (False, {"U", "again", "w", "time"})]
)
def test_a_copy_of_an_output_is_no_signal_of_a_law(tmp_path, copied, read):
    """Another reading of the same, noise and all, may say something; a copy of the column does not."""
    (tmp_path / "sim.py").write_text(SIMULATOR)
    (tmp_path / "case.toml").write_text(
        case_text(
            "python", function="simulate", parameters={"k": (2.0, "rad/(s*V)", 0.1)}, inputs={"U": "V"},
            outputs={"w": "rad/s"}, others={"again": {"unit": "rad/s", "role": "covariate"}}, runs=1,
        )
    )  # fmt: skip
    rng = np.random.default_rng(1)
    t = np.arange(300) * 0.02
    u = 5 + 3 * np.sin(2 * t)
    w = 2 * u + rng.normal(0, 0.1, len(t))
    again = w if copied else w + rng.normal(0, 0.1, len(t))
    pd.DataFrame({"t": t, "U": u, "w": w, "again": again}).to_csv(tmp_path / "r0.csv", index=False)
    case = read_case(tmp_path / "case.toml")
    problem = problem_of(case, model_of(case, None))
    names = {signal.name for signal in signals_of(problem, fit(problem), "w")}
    assert names & {"U", "again", "w", "time"} == read
