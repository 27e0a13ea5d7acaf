"""Runs that begin with a load on an unloaded cell: its creep is found with its size and its time."""

import numpy as np
import pandas as pd

from tests.diagnosis.cases import CELL, TWO, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

FRACTION, TAU = 0.02, 15.0
CASE = cell_case(0.002)


def recording(seed):
    """Loads of some 30 s each, the first from the first row on; what creeps is nothing there."""
    rng = np.random.default_rng(seed)
    t = np.arange(120) * 1.0
    load = np.repeat([(900.0, 300.0, 700.0, 500.0), (600.0, 1000.0, 200.0, 800.0)][seed], 30)
    fine = np.arange(119 * 50 + 1) / 50
    on = np.interp(fine, t, load)
    crept = np.zeros(len(fine))
    for k in range(len(fine) - 1):  # TAU dc/dt + c = FRACTION load, trapezoidal
        middle = FRACTION * (on[k] + on[k + 1]) / 2
        crept[k + 1] = ((TAU - 0.01) * crept[k] + 0.02 * middle) / (TAU + 0.01)
    return pd.DataFrame({"t": t, "L": load, "F": load + crept[::50] + rng.normal(0, 0.5, 120)})


def test_its_interval_holds_what_creeps_and_how_fast(tmp_path):
    frames = {f"r{i}__csv": recording(i) for i in range(2)}
    made = diagnose(read_case(write_case(tmp_path, CASE + TWO, simulator=CELL, **frames)), None).diagnosis
    assert (made.verdict, made.remaining) == ("named", "nothing")
    (one,) = made.effects
    assert (one.name, one.channel) == ("creep", "F")
    told = {each.name: each for each in one.parameters}
    for name, true in (("fraction", FRACTION), ("time_constant", TAU)):
        low, high = told[name].ci95
        assert low < true < high
        assert high - low < 0.3 * true
