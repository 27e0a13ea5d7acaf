"""Negative controls: a recording whose trace was destroyed must end in `nothing` or `unknown`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pandas as pd

from proof.model import Array, Run, Scenario

KINDS: dict[str, tuple[tuple[str, str], ...]] = {
    "permuted metadata": (
        ("tire-machine", "nonuniformity"), ("tire-machine", "drum_runout"), ("tire-columns", "nonuniformity"),
        ("beam-python", "thermal_drift"), ("beam-columns", "thermal_drift"),
    ),
    "swapped labels": (("tire-machine", "surface_friction"), ("tire-columns", "surface_friction")),
    "phase-randomised residual": (
        ("tire-machine", "relaxation"), ("tire-machine", "steer_compliance"), ("tire-python", "backlash"),
        ("pendulum", "coulomb_friction"), ("beam-python", "hysteresis"), ("drive-force", "coulomb_friction"),
    ),
}  # fmt: skip
_COLUMN = {"nonuniformity": "TIRE_ANGLE", "drum_runout": "DRUM_ANGLE", "thermal_drift": "T"}


def permuted(s: Scenario, effect: str) -> Scenario:
    """Return the scenario whose record of the effect's variable is another's: an angle that turns at a
    foreign
    rate, or the next run's temperature backwards.
    """
    column = _COLUMN[effect]
    inputs: Callable[[Run], pd.DataFrame] = s.inputs
    runs = [*s.runs, *s.predict]

    def foreign(run: Run) -> pd.DataFrame:
        df = inputs(run)
        if column != "T":
            return df.assign(**{column: 0.713 * df[column] + 77.0})
        after = runs[([r.name for r in runs].index(run.name) + 1) % len(runs)]
        other = inputs(after)[column].to_numpy()[::-1]
        return df.assign(
            **{column: np.interp(np.linspace(0, 1, len(df)), np.linspace(0, 1, other.size), other)}
        )

    return dataclasses.replace(s, inputs=foreign)


def swapped(s: Scenario) -> Scenario:
    """Return the scenario whose surfaces are labelled so that each label holds as many of either."""

    def label(run: Run, i: int) -> Run:
        surface = "sandpaper" if (i // 2) % 2 else "steel"
        return dataclasses.replace(run, conditions={**run.conditions, "surface": surface})

    return dataclasses.replace(
        s,
        runs=tuple(label(run, i) for i, run in enumerate(s.runs)),
        predict=tuple(label(run, i) for i, run in enumerate(s.predict)),
    )


def phase_randomised(residual: Array, rng: np.random.Generator) -> Array:
    """Return a signal with the residual's power spectrum and other phases (Theiler et al., Physica D 58,
    1992)."""
    mean = float(residual.mean())
    spectrum = np.fft.rfft(residual - mean)
    turn = np.exp(2j * np.pi * rng.random(spectrum.size))
    turn[0] = 1.0
    if residual.size % 2 == 0:
        turn[-1] = rng.choice([-1.0, 1.0])
    return np.asarray(np.fft.irfft(spectrum * turn, residual.size) + rng.choice([-1.0, 1.0]) * mean)
