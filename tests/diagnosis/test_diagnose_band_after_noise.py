"""A dead band in the digits, behind the noise of the reading: its width is found, not that of its mean."""

import numpy as np
import pandas as pd

from tests.diagnosis.cases import CELL, TWO, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

WIDTH, NOISE = 16.0, 8.0
CASE = cell_case(0.005)


def recording(seed):
    """A load through its zero a few times; the reading's noise first, then the band."""
    rng = np.random.default_rng(seed)
    t = np.arange(400) * 0.1
    load = 24 * np.sin(0.5 * t + seed) + 6 * np.sin(1.7 * t)
    read = load + rng.normal(0, NOISE, 400)
    shown = np.where(np.abs(read) > WIDTH / 2, read - np.sign(read) * WIDTH / 2, 0.0)
    return pd.DataFrame({"t": t, "L": load, "F": shown})


def test_the_interval_holds_the_width_of_a_band_on_a_noisy_reading(tmp_path):
    frames = {f"r{i}__csv": recording(i) for i in range(2)}
    made = diagnose(read_case(write_case(tmp_path, CASE + TWO, simulator=CELL, **frames)), None).diagnosis
    # No noise is stated, and it is half of the reading's spread; but it is as white as a sensor's.
    assert (made.verdict, made.remaining) == ("named", "nothing")
    (one,) = made.effects
    assert (one.name, one.channel) == ("dead_band", "F")
    (width,) = one.parameters
    low, high = width.ci95
    assert low < WIDTH < high
    assert high - low < 0.2 * WIDTH
