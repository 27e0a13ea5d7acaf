"""A drift with the temperature of a channel that was zeroed before its recording, at another temperature."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, TWO, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

COEFFICIENT = 0.8  # N/K
NOISE = 1.5  # N; the zero is off by 1.2 N at the first row
CASE = cell_case(0.002, T="degC")


def recording(draw, run, zeroed=18.5):
    rng = np.random.default_rng([draw, run])
    t = np.arange(120) * 10.0
    load = 400 + 300 * np.sin(0.013 * t + run) + 100 * np.sin(0.037 * t)
    T = 20 + run + 2 * (1 - np.cos(0.05 * t))
    force = load + COEFFICIENT * (T - zeroed) + rng.normal(0, NOISE, 120)
    return pd.DataFrame({"t": t, "L": load, "T": T, "F": force})


LENGTH = pytest.mark.campaign("more draws of one recording: one of them shows a wrong coefficient")


@pytest.mark.parametrize(("draws", "least"), [(1, 1), pytest.param(6, 5, marks=LENGTH)])
def test_the_interval_holds_the_coefficient_and_no_zero_is_named_beside_it(tmp_path, draws, least):
    held = 0
    for draw in range(draws):
        frames = {f"r{run}__csv": recording(draw, run) for run in range(2)}
        case = read_case(write_case(tmp_path / str(draw), CASE + TWO, simulator=CELL, **frames))
        made = diagnose(case, None).diagnosis
        assert [(one.name, one.channel) for one in made.effects] == [("thermal_drift", "F")]
        low, high = made.effects[0].parameters[0].ci95
        held += low < COEFFICIENT < high
    assert held >= least


def test_the_one_recorded_temperature_is_the_temperature_whatever_its_name(tmp_path):
    frames = {f"r{run}__csv": recording(0, run).rename(columns={"T": "ofen"}) for run in range(2)}
    text = cell_case(0.002, ofen="degC") + TWO
    made = diagnose(read_case(write_case(tmp_path, text, simulator=CELL, **frames)), None).diagnosis
    assert [(effect.name, effect.channel) for effect in made.effects] == [("thermal_drift", "F")]
    low, high = made.effects[0].parameters[0].ci95
    assert low < COEFFICIENT < high


def test_a_drift_is_seen_beside_a_zero_that_is_larger_than_all_that_it_does(tmp_path):
    """Zeroed at 70 degC, recorded between 20 and 25: counted from the first row the drift is unlike."""
    frames = {f"r{run}__csv": recording(7, run, zeroed=70.0) for run in range(2)}
    case = read_case(write_case(tmp_path, CASE + TWO, simulator=CELL, **frames))
    made = diagnose(case, None).diagnosis
    drift = next(effect for effect in made.effects if effect.name == "thermal_drift")
    assert {effect.name for effect in made.effects} <= {"thermal_drift", "zero_offset"}
    low, high = drift.parameters[0].ci95
    assert low < COEFFICIENT < high
