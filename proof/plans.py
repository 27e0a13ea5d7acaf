"""Signals that plans are made of, and the text of a case's simulator."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np

from proof.model import Array


def source(module: ModuleType) -> str:
    """Return the text of a simulator's file."""
    return Path(str(module.__file__)).read_text(encoding="utf-8")


def _fade(t: Array, seconds: float = 0.5) -> Array:
    return np.asarray(np.clip((t - t[0]) / seconds, 0, 1))


def wave(rng: np.random.Generator, t: Array, *, low: float, high: float, rms: float) -> Array:
    """Return five sines with frequencies [Hz] between low and high, faded in from zero."""
    f = rng.uniform(low, high, 5)
    total = sum(np.sin(2 * np.pi * fi * (t - t[0]) + rng.uniform(0, 2 * np.pi)) for fi in f)
    return np.asarray(total / np.sqrt(2.5) * rms * _fade(t))


def walk(rng: np.random.Generator, t: Array, *, peak: float, hold: float) -> Array:
    """Return smooth moves between drawn levels, with rests; starts at zero."""
    n = int((t[-1] - t[0]) / hold) + 2
    level = np.concatenate([[0.0], rng.uniform(-peak, peak, n)])
    x = (t - t[0]) / hold
    i = np.minimum(x.astype(int), n - 1)
    s = np.clip((x - i) / 0.75, 0, 1)
    return np.asarray(level[i] + (level[i + 1] - level[i]) * (10 * s**3 - 15 * s**4 + 6 * s**5))


def steps(rng: np.random.Generator, t: Array, *, low: float, high: float, hold: float, rise: float) -> Array:
    """Return drawn levels joined by ramps of `rise` seconds."""
    n = int((t[-1] - t[0]) / hold) + 2
    level = rng.uniform(low, high, n + 1)
    x = (t - t[0]) / hold
    i = np.minimum(x.astype(int), n - 1)
    s = np.clip((x - i) * hold / rise, 0, 1)
    return np.asarray(level[i] + (level[i + 1] - level[i]) * s)


def cycles(t: Array, *, peak: float, seconds: float, floor: float = 0.0) -> Array:
    """Return load cycles floor-peak-floor whose peaks grow in thirds."""
    x = (t - t[0]) / seconds
    height = (np.minimum(np.floor(x), 2) + 1) / 3
    up = 1 - np.abs(2 * np.mod(x, 1) - 1)
    return np.asarray(floor + (peak - floor) * height * up)
