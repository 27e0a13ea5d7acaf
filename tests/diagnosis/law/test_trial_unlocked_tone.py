"""A tone with a phase of its own in every run: frequency and amplitude with intervals that hold the truth."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.law.trial import unlocked_tone
from toolkit.diagnosis.search.unexplained import own_swing, strongest_line
from toolkit.diagnosis.simulators.build_simulator import model_of

HEAD = case_text(
    "python", parameters={"gain": (1.0, "1", 0.005)}, inputs={"L": "N"}, outputs={"F": "N"}, runs=3
)
TRIES = 12


def ringing(rng: np.random.Generator, frequency: float) -> pd.DataFrame:
    """Return a loaded cell with a tone of 0.1 N in AR(1) noise of 0.1 N."""
    t = np.arange(200) * 0.1
    noise = lfilter([0.06], [1, -0.8], rng.normal(0, 1.0, 300))[100:]
    L = 10 * np.sin(0.7 * t + rng.uniform(0, 6))
    tone = 0.1 * np.sin(2 * math.pi * frequency * t + rng.uniform(0, 6))
    return pd.DataFrame({"t": t, "L": L, "F": L + tone + noise})


def test_intervals_of_a_tone_hold_it(tmp_path):
    off: dict[str, list[float]] = {"a": [], "frequency": []}
    for seed in range(TRIES):
        rng = np.random.default_rng(seed)
        true = {"a": 0.1, "frequency": rng.uniform(0.8, 1.6)}
        runs = {f"r{k}__csv": ringing(rng, true["frequency"]) for k in range(3)}
        case = read_case(write_case(tmp_path / str(seed), HEAD, simulator=CELL, **runs))
        problem = problem_of(case, model_of(case, None))
        tone = unlocked_tone(problem, fit(problem, plain=True), "F")
        assert tone is not None
        for name, departures in off.items():
            fitted = dict(tone.applied.values)
            departures.append((fitted[name] - true[name]) / tone.sds[name])
    # Fewer than so many hold the truth once in a thousand tries, where each does by 95 %.
    fewest = binom.ppf(0.001, TRIES, 0.95)
    for departures in off.values():
        assert sum(abs(each) < 1.96 for each in departures) >= fewest
        assert np.sqrt(np.mean(np.square(departures))) > 0.5  # nor are they far wider than they need be


@pytest.mark.parametrize(("measure", "turn"), [("deg", 360.0), ("rad", 2 * math.pi)])
def test_a_ripple_of_a_shaft_is_told_over_its_angle(tmp_path, measure, turn):
    """Twelve to a turn, each run from another angle; the amplitude is the mean of the runs'."""
    head = case_text(
        "python", parameters={"gain": (1.0, "1", 0.005)}, inputs={"L": "N", "angle": measure},
        outputs={"F": "N"}, runs=3,
    )  # fmt: skip
    rng, t, runs = np.random.default_rng(2), np.arange(200) * 0.1, {}
    for k, amplitude in enumerate((0.1, 0.2, 0.3)):
        turns = (0.1 + 0.02 * k) * (t + 0.3 * np.sin(0.4 * t))
        ripple = amplitude * np.sin(2 * math.pi * 12 * turns + k)
        frame = {
            "t": t,
            "L": 10.0 + t,
            "angle": turn * turns,
            "F": 10.0 + t + ripple + rng.normal(0, 0.05, 200),
        }
        runs[f"r{k}__csv"] = pd.DataFrame(frame)
    case = read_case(write_case(tmp_path, head, simulator=CELL, **runs))
    problem = problem_of(case, model_of(case, None))
    tone = unlocked_tone(problem, fit(problem, plain=True), "F")
    assert tone is not None
    assert [signal.name for signal in tone.signals] == ["angle"]
    fitted = dict(tone.applied.values)
    assert fitted["period"] == pytest.approx(turn / 12, abs=4 * tone.sds["period"])
    assert fitted["a"] == pytest.approx(0.2, abs=4 * tone.sds["a"])
    assert tone.applied.units["period"] == measure


SWING = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    t = inputs["t"].to_numpy()
    return pd.DataFrame({"F": p["gain"] * inputs["L"].iloc[0] * np.exp(-0.01 * t) * np.cos(3.1 * t)})
"""


@pytest.mark.parametrize(("ringing_Hz", "told"), [(None, False), (0.9, True)])
def test_a_swing_that_is_off_a_little_leaves_no_tone(
    tmp_path: Path, ringing_Hz: float | None, told: bool
) -> None:
    """A body that swings by itself half a per cent too quickly, or beside something that turns."""
    t, runs = np.arange(600) * 0.1, {}
    for k, start in enumerate((1.0, 0.7, 0.4)):
        rng = np.random.default_rng(k)
        F = start * np.exp(-0.012 * t) * np.cos((3.1 if ringing_Hz else 3.115) * t) + rng.normal(
            0, 0.002, t.size
        )
        if ringing_Hz:
            F += 0.05 * np.sin(2 * math.pi * ringing_Hz * t + k)
        runs[f"r{k}__csv"] = pd.DataFrame({"t": t, "L": np.full(t.size, start), "F": F})
    case = read_case(write_case(tmp_path, HEAD, simulator=SWING, **runs))
    problem = problem_of(case, model_of(case, None))
    made = fit(problem, plain=True)
    line = strongest_line(problem, "F", made.residual["F"])
    assert line is not None
    assert (own_swing(problem, line, made.simulated) is None) is told
    assert (unlocked_tone(problem, made, "F") is not None) is told
