"""What an amplifier, a filter, a converter or a load cell does to one channel, in own formulations.

Analogue stages act on the fine grid, before the noise; digital ones on the sampled, noisy values.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from proof.model import Array, Effects, Run
from proof.noise import anti_alias, group_delay

DIGITAL = ("saturation", "quantisation", "dead_band", "rectification", "unit_error", "channel_sign")

ANALOGUE = (
    "channel_delay", "filter_lag", "zero_offset", "zero_drift", "thermal_drift", "creep", "hysteresis",
    "nonlinearity", "sensitivity_error", "crosstalk",
)  # fmt: skip


def rc(t: Array, y: Array, time_constant: float, start: float | None = None) -> Array:
    """Return `y` through a resistor and a capacitor, exact for a piecewise linear input."""
    out = np.empty_like(y)
    out[0] = y[0] if start is None else start
    h = np.diff(t)
    a = np.exp(-h / time_constant)
    slope = np.diff(y) / h
    for i in range(h.size):
        lagged = y[i] - time_constant * slope[i]
        out[i + 1] = y[i + 1] - time_constant * slope[i] + (out[i] - lagged) * a[i]
    return out


def preisach(x: Array, full_scale: float, relays: int = 24) -> Array:
    """Return a field of relays with uniform thresholds over +-`full_scale`, minus its line.

    A full cycle has the branches -1 + (1+u)^2/2 and 1 - (1-u)^2/2; their mean is u, their loop 1 high at
    u = 0. The field is demagnetised at first.
    """
    edges = np.linspace(-1, 1, relays + 1)
    centre = (edges[1:] + edges[:-1]) / 2
    up, down = np.meshgrid(centre, centre, indexing="ij")
    keep = up >= down
    up, down = up[keep], down[keep]
    weight = np.where(np.isclose(up, down), 0.5, 1.0)
    weight /= weight.sum()
    state = np.where(up + down < 0, 1.0, -1.0)
    u = np.clip(x / full_scale, -1.0, 1.0)
    half = 1.0 / relays  # a relay answers gradually over its cell, else the output is a staircase
    field = np.empty_like(u)
    for i, value in enumerate(u):
        rise = np.clip((value - up) / half, -1.0, 1.0)
        fall = np.clip((value - down) / half, -1.0, 1.0)
        state = np.minimum(np.maximum(state, rise), fall)
        field[i] = weight @ state
    return field - u


def analogue(name: str, p: Mapping[str, Any], t: Array, y: Array, other: Mapping[str, Array]) -> Array:
    """Return the channel after one analogue effect; unknown names are an error."""
    if name == "channel_delay":
        return np.interp(t - p["delay"], t, y)
    if name == "filter_lag":
        return rc(t, y, p["time_constant"]) if p["time_constant"] > 1e-9 else y
    if name == "zero_offset":
        return y + p["offset"]
    if name == "zero_drift":
        return y + p["rate"] * t / 60.0
    if name == "thermal_drift":
        return y + p["coefficient"] * (other[p["from"]] - p["reference"])
    if name == "creep":
        return y + p["fraction"] * rc(t, y, p["time_constant"], start=0.0)
    if name == "hysteresis":
        return y + p["width"] * preisach(y, p["full_scale"])
    if name == "nonlinearity":
        u = y / p["full_scale"]
        return y + p["full_scale"] * (p["quadratic"] * u**2 + p["cubic"] * u**3)
    if name == "sensitivity_error":
        return y * (1 + p["gain_error"])
    if name == "crosstalk":
        return y + p["coefficient"] * other[p["from"]]
    raise KeyError(name)


def digital(name: str, p: Mapping[str, Any], y: Array) -> Array:
    """Return the sampled channel after one digital effect."""
    if name == "saturation":
        level = p["level"] * (1 - p["cut"])
        return np.clip(y, -level, level)
    if name == "quantisation":
        return np.round(y / p["step"]) * p["step"] if p["step"] > 0 else y
    if name == "dead_band":
        return np.sign(y) * np.maximum(np.abs(y) - p["width"] / 2, 0.0)
    if name == "rectification":
        return np.abs(y)
    if name == "unit_error":
        return y * p["factor"]
    if name == "channel_sign":
        return -y
    raise KeyError(name)


def sampled(
    run: Run, fine: dict[str, Array], e: Effects, *, cutoff_Hz: float | None, compensated: bool
) -> dict[str, Array]:
    """Return the fine outputs as the acquisition gives them: instruments, anti-alias filter, rows, converter.

    `compensated`: the rows' time stamps are corrected for the filter's group delay. No cut-off: the values
    are a controller's own numbers, not sampled signals.
    """
    t = run.fine["t"]
    late = group_delay(t, cutoff_Hz) if compensated and cutoff_Hz else 0.0
    other = {**run.fine, **fine}
    out = {}
    for name, y in fine.items():
        for effect, p in e.items():
            if effect in ANALOGUE and p["channel"] == name:
                y = analogue(effect, p, t, y, other)
        rows = np.interp(run.rows + late, t, anti_alias(t, y, cutoff_Hz) if cutoff_Hz else y)
        for effect, p in e.items():
            if effect in DIGITAL and p["channel"] == name:
                rows = digital(effect, p, rows)
        out[name] = rows
    if "channel_swap" in e:
        a, b = e["channel_swap"]["channel"], e["channel_swap"]["with"]
        out[a], out[b] = out[b], out[a]
    return out
