"""Noise and acquisition: coloured noise, spikes, the anti-alias filter, jitter, the converter's steps."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy import signal

from proof.model import Array, Noise


@cache
def innovation_gain(ar: tuple[float, ...]) -> float:
    """Return sd of the process over sd of its innovation, from the impulse response."""
    if not ar:
        return 1.0
    impulse = np.zeros(4000)
    impulse[0] = 1.0
    response = signal.lfilter([1.0], [1.0, *(-a for a in ar)], impulse)
    return float(np.sqrt(np.sum(response**2)))


def coloured(noise: Noise, n: int, rng: np.random.Generator) -> Array:
    """Return `n` values of stationary AR noise with the standard deviation asked for."""
    burn = 400
    e = rng.standard_normal(n + burn)
    y = signal.lfilter([1.0], [1.0, *(-a for a in noise.ar)], e)[burn:]
    return np.asarray(noise.sd * y / innovation_gain(noise.ar))


def whitened(noise: Noise, residual: Array) -> Array:
    """Return the residual of one run in innovations of unit variance (the first row by the process's sd)."""
    if not noise.ar:
        return residual / noise.sd
    out = signal.lfilter([1.0, *(-a for a in noise.ar)], [1.0], residual)
    out = np.asarray(out) * innovation_gain(noise.ar) / noise.sd
    out[0] = residual[0] / noise.sd
    return out


def spikes(noise: Noise, n: int, rng: np.random.Generator) -> Array:
    """Return isolated outliers, mostly zeros."""
    hit = rng.random(n) < noise.outliers
    return np.where(hit, noise.sd * rng.uniform(5, 10, n) * rng.choice([-1.0, 1.0], n), 0.0)


def anti_alias(fine_t: Array, y: Array, cutoff_Hz: float) -> Array:
    """Return `y` through a two-pole Butterworth filter that starts at rest."""
    rate = 1.0 / float(fine_t[1] - fine_t[0])
    sos, settled = _two_poles(cutoff_Hz, rate)
    out, _ = signal.sosfilt(sos, y, zi=settled * y[0])
    return np.asarray(out)


@cache
def _two_poles(cutoff_Hz: float, rate: float) -> tuple[Array, Array]:
    """Return the filter's sections, and their state under a steady 1. Its design takes longer than a run."""
    sos = signal.butter(2, cutoff_Hz, fs=rate, output="sos")
    return sos, np.asarray(signal.sosfilt_zi(sos))


def group_delay(fine_t: Array, cutoff_Hz: float) -> float:
    """Return the filter's delay at low frequency [s], with the bilinear transform's warped corner."""
    rate = 1.0 / float(fine_t[1] - fine_t[0])
    return float(np.sqrt(2.0) / (2 * rate * np.tan(np.pi * cutoff_Hz / rate)))


def jittered(rows: Array, share: float, rng: np.random.Generator) -> Array:
    """Return sampling instants moved by a part of their step; the recorded time is the true one."""
    step = float(rows[1] - rows[0])
    moved = rows + np.clip(rng.normal(0.0, share, rows.size), -0.4, 0.4) * step
    moved[0], moved[-1] = rows[0], rows[-1]
    return np.asarray(moved)


def converter(y: Array, step: float) -> Array:
    """Return `y` on the steps of an analogue-digital converter."""
    return np.round(y / step) * step
