"""A cell whose readings loop: the width is that of the largest cycle, wherever in its loop a run begins."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import CELL, TWO, cell_case, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

CASE = cell_case(0.002)
FULL, WIDTH, NOISE = 1000.0, 24.0, 1.5  # N; the width is that of a cycle over +-FULL
HALF = (0.85, 0.5)  # half range of each run, over FULL


def relays(u, count=40):
    """Return a field of relays (Preisach) that was demagnetised, less its line; its full loop is 1 high."""
    centres = (np.arange(count) + 0.5) * 2 / count - 1
    up, down = (grid.ravel() for grid in np.meshgrid(centres, centres, indexing="ij"))
    up, down = up[up >= down], down[up >= down]
    weight = np.where(np.isclose(up, down), 0.5, 1.0)
    state = np.where(up + down < 0, 1.0, -1.0)
    field = np.empty_like(u)
    for i, value in enumerate(u):
        rise = np.clip((value - up) * count, -1.0, 1.0)
        fall = np.clip((value - down) * count, -1.0, 1.0)
        state = np.minimum(np.maximum(state, rise), fall)
        field[i] = weight @ state / weight.sum()
    return field - u


def recording(draw, run):
    """Cycles that begin under load: of one run from -0.7 to 1, of the other from -0.1 to 0.9."""
    rng = np.random.default_rng([draw, run])
    t = np.arange(160) * 0.5
    middle = (0.15, 0.4)[run]
    u = middle + HALF[run] * np.sin(0.3 * t + 0.8 + run) * (0.7 + 0.3 * np.cos(0.05 * t))
    load = FULL * u
    return pd.DataFrame({"t": t, "L": load, "F": load + WIDTH * relays(u) + rng.normal(0, NOISE, len(t))})


LENGTH = pytest.mark.campaign("more draws of one recording: two of them show a wrong width")


@pytest.mark.parametrize(("draws", "least"), [(2, 1), pytest.param(6, 4, marks=LENGTH)])
def test_the_interval_holds_the_height_of_the_largest_cycle(tmp_path, draws, least):
    held = 0
    for draw in range(draws):
        frames = {f"r{run}__csv": recording(draw, run) for run in range(2)}
        half = max(0.5 * np.ptp(frame["L"]) / FULL for frame in frames.values())
        case = read_case(write_case(tmp_path / str(draw), CASE + TWO, simulator=CELL, **frames))
        found = {effect.name: effect for effect in diagnose(case, None).diagnosis.effects}
        low, high = found["hysteresis"].parameters[0].ci95
        held += low < WIDTH * half**2 < high
        assert high - low < 0.5 * WIDTH * half**2
    assert held >= least  # fewer by chance once in 400, of intervals that cover 95 %
