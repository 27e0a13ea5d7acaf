"""Plans of the tire machine: what the slip angle, the load and the drum do, and how warm the tread gets."""

from __future__ import annotations

import math

import numpy as np

from proof import tire_steady as steady
from proof import tire_truth
from proof.model import Array, Run
from proof.noise import jittered

RATE_Hz = 20.0
OVER = 8
ROLLING_RADIUS, DRUM_RADIUS = 0.306, 1.353
TURNED = (1, 4, 7)
"""Runs with the tire turned round on the hub, where a plan has such runs."""


def _sweep(t: Array, peak: float, rate: float) -> Array:
    """Return a triangle from 0 to +peak, -peak and on, its corners rounded by the actuator (0.15 s)."""
    x = (t - t[0]) * rate / peak
    triangle = peak * (np.abs(np.mod(x - 1, 4) - 2) - 1)
    kernel = np.hanning(int(0.3 / (t[1] - t[0])) | 1)
    padded = np.concatenate([np.full(kernel.size, triangle[0]), triangle, np.full(kernel.size, triangle[-1])])
    return np.convolve(padded, kernel / kernel.sum(), mode="same")[kernel.size : -kernel.size]


def _heat(
    power: Array, start: tuple[float, float], ambient: Array, h: float
) -> tuple[Array, tuple[float, float]]:
    """Return the tread's temperature: tread and carcass as two capacities, three resistances."""
    tread, inner = start
    out = np.empty_like(power)
    for i in range(power.size):
        exchange = 6.0 * (tread - inner)
        tread += h * (0.6 * power[i] - exchange - 9.0 * (tread - ambient[i])) / 250.0
        inner += h * (exchange - 4.0 * (inner - ambient[i])) / 1800.0
        out[i] = tread
    return out, (tread, inner)


def _run(
    name: str,
    start: float,
    seconds: float,
    *,
    sa: tuple[float, float],
    loads: tuple[float, ...],
    speed: float,
    rng: np.random.Generator,
    conditions: dict[str, str],
    ripple: bool = True,
) -> Run:
    """Return a run that sweeps the slip angle while the load takes the given levels in turn.

    Without `ripple` the load is held to what was commanded, whatever turns.
    """
    t = start + np.arange(round(seconds * RATE_Hz) * OVER + 1) / (RATE_Hz * OVER)
    tau = t - start
    level = np.array(loads)[np.minimum((tau / seconds * len(loads)).astype(int), len(loads) - 1)]
    kernel = np.hanning(int(0.8 * RATE_Hz * OVER) | 1)
    padded = np.concatenate([np.full(kernel.size, level[0]), level, np.full(kernel.size, level[-1])])
    load = np.convolve(padded, kernel / kernel.sum(), mode="same")[kernel.size : -kernel.size]
    angle = np.degrees(speed * tau / ROLLING_RADIUS) + rng.uniform(0, 360)
    drum = np.degrees(speed * tau / DRUM_RADIUS) + rng.uniform(0, 360)
    if ripple:
        load = load * (1 + 0.006 * np.cos(np.radians(angle)) + 0.004 * np.cos(np.radians(drum)))
    ambient = 24 + 3 * np.sin(2 * math.pi * (tau / seconds * rng.uniform(0.6, 1.4) + rng.random()))
    fine = {
        "t": t, "SA": _sweep(t, *sa), "FZ": load, "FZ_CMD": load, "V": np.full(t.size, speed),
        "TIRE_ANGLE": angle, "DRUM_ANGLE": drum, "T_AMBIENT": ambient,
        "P_INFL": 220 + 4 * np.sin(tau / 3.1 + rng.uniform(0, 6)),
    }  # fmt: skip
    rows = jittered(t[::OVER], 0.05, rng)
    return Run(name=name, fine=fine, rows=rows, conditions=conditions)


def plan(
    rng: np.random.Generator,
    *,
    reverse: bool,
    surfaces: bool,
    seconds: float,
    turned: bool = False,
    ripple: bool = True,
) -> tuple[list[Run], list[Run]]:
    """Return training runs at two speeds, three steering rates and several loads, and two untouched ones."""
    load = lambda share: 4000 * share * rng.uniform(0.95, 1.05)  # noqa: E731
    slow, fast = 2.128 * rng.uniform(0.5, 0.65), 2.128
    rows: list[tuple[tuple[float, float], tuple[float, ...], float, bool]] = [
        ((8.0, 4.0), (load(0.6),), fast, False),
        ((9.0, 2.0), (load(1.1),), fast, False),
        ((5.0, 8.0), (load(0.9),), slow, False),
        ((3.0, 1.0), (load(0.4), load(1.3), load(0.7), load(1.0)), fast, False),
        ((8.0, 5.0), (load(0.9),), fast, reverse),
        ((6.0, 4.0), (load(1.2), load(0.5)), slow, reverse),
    ]
    ahead = [
        ((7.0, 6.0), (load(0.8), load(1.15)), fast, False),
        ((4.0, 3.0), (load(1.0),), slow * 1.2, False),
    ]
    out, start = [], 0.0
    for i, (sa, loads, speed, backwards) in enumerate(rows + ahead):
        conditions = {"rotation": "reverse" if backwards else "forward"}
        if turned:
            conditions["mounting"] = "turned" if i in TURNED else "normal"
        if surfaces:
            conditions["surface"] = "sandpaper" if i % 2 else "steel"
        name = f"run{i + 1:02d}.csv" if i < len(rows) else f"more{i + 1 - len(rows):02d}.csv"
        out.append(_run(
            name, start, seconds, sa=sa, loads=loads, speed=speed, rng=rng, conditions=conditions,
            ripple=ripple,
        ))  # fmt: skip
        start += seconds + 25.0
    return out[: len(rows)], out[len(rows) :]


def single_rate(rng: np.random.Generator, *, seconds: float) -> tuple[list[Run], list[Run]]:
    """Return runs with one small sine of the slip angle, all alike."""
    out = []
    for i in range(5):
        run = _run(f"run{i + 1:02d}.csv" if i < 4 else "more01.csv", i * (seconds + 25.0), seconds,
            sa=(1.0, 1.0),
                   loads=(4000.0,), speed=2.128, rng=rng, conditions={"rotation": "forward"})  # fmt: skip
        f = dict(run.fine)
        tau = f["t"] - f["t"][0]
        f["SA"] = 0.8 * np.sin(2 * math.pi * 0.2 * tau) * np.clip(tau / 2.5, 0, 1)
        out.append(Run(name=run.name, fine=f, rows=run.rows, conditions=run.conditions))
    return out[:4], out[4:]


def warmed(runs: list[Run], tire: tire_truth.Tire) -> list[Run]:
    """Return the runs with the tread's temperature and the slip work done before each."""
    state, work, last, out = (27.0, 25.0), 0.0, 0.0, []
    for run in runs:
        f = dict(run.fine)
        h = float(f["t"][1] - f["t"][0])
        rest = int((f["t"][0] - last) / h)
        _, state = _heat(np.zeros(rest), state, np.full(rest, 24.0), h)
        slip = np.radians(f["SA"])
        power = np.abs(tire.forces(slip, f["FZ"], steady.Scales())[0] * f["V"] * np.sin(slip))
        f["T_TREAD"], state = _heat(power, state, f["T_AMBIENT"], h)
        f["work_before_kJ"] = np.full(f["t"].size, work)
        work += float(power.sum() * h / 1e3)
        last = float(f["t"][-1])
        out.append(Run(name=run.name, fine=f, rows=run.rows, conditions=run.conditions))
    return out
