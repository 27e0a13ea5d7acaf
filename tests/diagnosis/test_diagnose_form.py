"""Dry friction behind the filter of an acquisition: its law is off where it jumps, its interval holds it."""

import numpy as np
import pandas as pd

from tests.diagnosis.cases import HEAD, TWO, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

COULOMB, NOISE, FINE = 20.0, 0.5, 20  # N; fine steps to a row


def filtered(x, memory):
    """Return a signal through two equal lags, ``memory`` fine steps each."""
    for _ in range(2):
        out, keep = np.empty_like(x), np.exp(-1 / memory)
        out[0] = x[0]
        for i in range(1, len(x)):
            out[i] = x[i] + keep * (out[i - 1] - x[i])
        x = out
    return x


def recording(seed):
    """Return 24 s of a carriage, force, speed and acceleration through one filter, the noise behind it."""
    rng = np.random.default_rng(seed)
    t = np.arange(600 * FINE) * (0.04 / FINE)
    v = 0.15 * np.sin(2.1 * t + seed) + 0.08 * np.sin(4.3 * t)
    a = 0.315 * np.cos(2.1 * t + seed) + 0.344 * np.cos(4.3 * t)
    force = 95 * a + 200 * v + COULOMB * np.sign(v)
    rows = {name: filtered(x, 0.25 * FINE)[::FINE] for name, x in (("v", v), ("a", a), ("F", force))}
    rows["F"] = rows["F"] + rng.normal(0, NOISE, 600)
    return pd.DataFrame({"t": t[::FINE], **rows})


def test_the_interval_holds_the_friction(tmp_path):
    frames = {f"r{i}__csv": recording(i) for i in range(2)}
    found = diagnose(read_case(write_case(tmp_path, HEAD + TWO, **frames)), None).diagnosis
    friction = next(effect for effect in found.effects if effect.name == "coulomb_friction")
    low, high = friction.parameters[0].ci95
    assert low < COULOMB < high
    assert high - low < 0.1 * COULOMB
