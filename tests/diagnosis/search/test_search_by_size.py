"""A rest that is no noise: what takes most of it is found, though each row foretells the next without it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import write_case
from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

SENSOR = case_text(
    "python", title="A torque sensor beside a current", parameters={"kt": (0.109, "N*m/A", 0.005)},
    inputs={"i": "A"}, outputs={"T": "N*m"}, runs=4,
)  # fmt: skip
TORQUE = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"T": p["kt"] * inputs["i"]})
"""
DAMPER = case_text(
    "python", title="A damper on a press", parameters={"c": (2.5, "N*s/mm", 1.0)},
    inputs={"x": "mm", "v": "mm/s"}, outputs={"F": "N"}, runs=4,
)  # fmt: skip
FORCE = """
import pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": p["c"] * inputs["v"]})
"""


def answer(folder: Path, toml: str, simulator: str, frames: list[pd.DataFrame]) -> Diagnosis:
    """Diagnose a case of these runs."""
    files = {f"r{k}__csv": frame for k, frame in enumerate(frames)}
    return diagnose(read_case(write_case(folder, toml, simulator=simulator, **files)), None).diagnosis


def stairs(zeros: list[float], gains: list[float]) -> list[pd.DataFrame]:
    """Return stairs of current with a torque of these zeros [N m] and gains [N m/A], quiet sensor."""
    frames, t = [], np.arange(400) * 0.05
    for k, (zero, gain) in enumerate(zip(zeros, gains, strict=True)):
        current = np.round(8 * np.sin(2 * np.pi * t / 20 + k))
        noise = np.random.default_rng(k).normal(0, 0.002, t.size)
        frames.append(pd.DataFrame({"t": t, "i": current, "T": zero + gain * current + noise}))
    return frames


def test_zeros_of_all_runs_to_one_side_are_a_zero(tmp_path: Path) -> None:
    zeros = [-0.050, -0.046, -0.065, -0.092]
    made = answer(tmp_path, SENSOR, TORQUE, stairs(zeros, [0.1059, 0.1089, 0.1025, 0.1040]))
    (effect,) = made.effects
    assert "zero_offset" in (effect.name, *effect.equivalent_to)
    low, high = next(parameter.ci95 for parameter in effect.parameters if parameter.name == "offset")
    assert low < np.mean(zeros) < high
    assert (high - low) / 2 > np.std(zeros) / 2  # four values, and not sixteen hundred rows
    assert made.remaining == "unknown"  # each run has a zero of its own


def test_zeros_of_runs_to_both_sides_have_no_name(tmp_path: Path) -> None:
    made = answer(tmp_path, SENSOR, TORQUE, stairs([-0.08, 0.05, -0.06, 0.09], [0.108, 0.109, 0.110, 0.109]))
    assert not made.effects


def test_a_friction_is_found_beside_a_smooth_rest_that_foretells_itself(tmp_path: Path) -> None:
    # By rows an autoregression of the whole rest wins: friction makes corners in what is left.
    frames, t = [], np.arange(800) * 0.005
    for k, (frequency, stroke) in enumerate([(1.0, 12.0), (2.0, 8.0), (3.0, 4.0), (0.5, 20.0)]):
        phase = 2 * np.pi * frequency * t
        x, v = stroke * np.sin(phase), stroke * 2 * np.pi * frequency * np.cos(phase)
        smooth = 18 * np.sin(x / 5 + k) + 10 * np.sin(2 * np.pi * 0.31 * t + k)
        noise = np.random.default_rng(k).normal(0, 0.15, t.size)
        frames.append(
            pd.DataFrame({"t": t, "x": x, "v": v, "F": 2.2 * v + 60 * np.tanh(v / 2) + smooth + noise})
        )
    made = answer(tmp_path, DAMPER, FORCE, frames)
    names = {name for effect in made.effects for name in (effect.name, *effect.equivalent_to)}
    assert "coulomb_friction" in names
    friction = next(effect for effect in made.effects if effect.name == "coulomb_friction")
    assert friction.parameters[0].value == pytest.approx(60, rel=0.25)
    assert made.remaining == "unknown"
