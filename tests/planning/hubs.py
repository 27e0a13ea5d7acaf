"""Virtual hubs whose truth no planner sees, and the sessions that they give: a generator of its own.

A hub is three cells on a plane map from forces to loads, drawn about the drawing's. A session of it scatters
within runs and between them, drifts, creeps and answers to the direction, each of a size that is drawn for
the hub. Nothing of this is taken from the toolkit's virtual machine or its planner.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

LOADS = ("FY [N]", "MZ [N*m]", "MX [N*m]")
CELLS = ("D51 [mV/V]", "D52 [mV/V]", "E5 [mV/V]")
LARGEST = np.array([6000.0, 200.0, 1800.0])
TOLERANCE = 0.002  # of the largest load: that of the check loads
DRAWING = np.array([[1.0, 1.0, 1.02], [-0.048, 0.049, 0.001], [0.05, 0.05, -0.10]])
"""FY [N], MZ and MX [N·m] of a newton in D51, D52, E5, as the drawing of the hub has it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hub:
    """A hub: ``loads_by_cell`` (loads, cells) per mV/V, and its standard deviations by the largest load.

    ``noise`` (loads,) of a reading, ``zero`` and ``gain`` (loads,) between runs; ``drift`` over a run,
    ``creep`` after the largest load and ``reversal`` between the directions are parts of the noise.
    """

    loads_by_cell: NDArray[np.float64]
    noise: NDArray[np.float64]
    zero: NDArray[np.float64]
    gain: NDArray[np.float64]
    drift: float
    creep: float
    reversal: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Readings:
    """A session: reference loads and indications (rows,), run from 1 and direction of each row."""

    loads: NDArray[np.float64]
    cells: NDArray[np.float64]
    run: NDArray[np.intp]
    up: NDArray[np.bool_]


def draw_hub(seed: int) -> Hub:
    """Draw a hub; every fourth has runs that do not differ."""
    rng = np.random.default_rng([2025, seed])
    map_ = DRAWING * (1 + 0.03 * rng.normal(size=(3, 3)))
    sensitivity = 2.0 / 13000.0 * (1 + 0.02 * rng.normal(size=3))  # mV/V a newton
    noise = 1.2e-4 * np.exp(0.4 * rng.normal(size=3)) * LARGEST
    ratio = 0.0 if seed % 4 == 0 else 1.0
    return Hub(
        loads_by_cell=map_ / sensitivity,
        noise=noise,
        zero=ratio * noise * rng.uniform(0.2, 1.5, size=3),
        gain=ratio * noise * rng.uniform(0.2, 1.5, size=3),
        drift=rng.uniform(0.0, 0.5),
        creep=rng.uniform(0.0, 0.3),
        reversal=rng.uniform(0.0, 0.3),
    )


def read_session(
    hub: Hub,
    loads: NDArray[np.float64],
    run: NDArray[np.intp],
    up: NDArray[np.bool_],
    rng: np.random.Generator,
) -> Readings:
    """Return what the hub shows under reference loads in their order."""
    share = loads / LARGEST
    runs = int(run.max()) + 1
    zero, gain = (rng.normal(size=(runs, 3)) * sd for sd in (hub.zero, hub.gain))
    drift = rng.normal(size=(runs, 3)) * hub.drift
    noise = rng.normal(size=loads.shape)
    for number in range(runs):
        rows = np.flatnonzero(run == number)
        noise[rows] += np.linspace(-0.5, 0.5, len(rows))[:, None] * drift[number]
        noise[rows] -= hub.creep * np.diff(share[rows], axis=0, prepend=np.zeros((1, 3)))
    noise += np.where(up, 0.5, -0.5)[:, None] * hub.reversal * (1 - share**2)
    # What the cells show departs from the loads by all of it together.
    felt = loads - zero[run] - gain[run] * share - noise * hub.noise
    return Readings(loads=loads, cells=np.linalg.solve(hub.loads_by_cell, felt.T).T, run=run + 1, up=up)


def schedule() -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return a run of the machine's protocol: each load by itself, then all together, up and down."""
    shares, up = [np.zeros(3)], [True]
    steps = ((0.25, True), (0.5, True), (0.75, True), (1.0, True), (0.5, False))
    for axis in range(3):
        for sign in (1.0, -1.0):
            for level, rising in steps:
                shares.append(sign * level * np.eye(3)[axis])
                up.append(rising)
    for corner in np.array(np.meshgrid(*[[1.0, -1.0]] * 3, indexing="ij")).reshape(3, -1).T:
        most = 1.0 if corner[0] == corner[2] else 0.6  # E5's capacity
        for level, rising in ((0.5, True), (1.0, True), (0.5, False)):
            shares.append(most * level * corner)
            up.append(rising)
    shares.append(np.zeros(3))
    up.append(False)
    return np.array(shares) * LARGEST, np.array(up)


CHECK = LARGEST * np.array(
    [
        [0.85, 0, 0], [-0.65, 0, 0], [0, 0.85, 0], [0, -0.65, 0], [0, 0, 0.85], [0, 0, -0.65],
        [0.7, 0.7, 0.7], [-0.7, 0.7, -0.7], [0.35, -0.7, -0.35], [-0.35, -0.35, 0.35],
    ]
)  # fmt: skip


def machine_session(hub: Hub, rng: np.random.Generator, runs: int = 3) -> Readings:
    """Return the protocol's session."""
    loads, up = schedule()
    run = np.repeat(np.arange(runs), len(loads))
    return read_session(hub, np.tile(loads, (runs, 1)), run, np.tile(up, runs), rng)


def read_check(hub: Hub, loads: NDArray[np.float64], rng: np.random.Generator) -> Readings:
    """Return check loads, read after the runs in a run of their own."""
    rows = len(loads)
    return read_session(hub, loads, np.zeros(rows, dtype=np.intp), np.ones(rows, dtype=bool), rng)


def write_session(folder: Path, readings: Readings, check: Readings) -> Path:
    """Write a session's files."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "loads.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*CELLS, *LOADS, "run", "direction"])
        for cells, loads, run, up in zip(
            readings.cells, readings.loads, readings.run, readings.up, strict=True
        ):
            writer.writerow(
                [*(f"{x:.9f}" for x in cells), *(f"{x:.4f}" for x in loads), run, "up" if up else "down"]
            )
    with (folder / "check.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*CELLS, *LOADS])
        for cells, loads in zip(check.cells, check.loads, strict=True):
            writer.writerow([*(f"{x:.9f}" for x in cells), *(f"{x:.4f}" for x in loads)])
    names = [load.split()[0] for load in LOADS]
    tolerance = "\n".join(
        f'{name} = {{ value = {TOLERANCE * size:g}, unit = "{load.split()[1].strip("[]")}" }}'
        for name, load, size in zip(names, LOADS, LARGEST, strict=True)
    )
    (folder / "SESSION.toml").write_text(
        f"""schema = 1
instrument = "hub"
date = 2026-05-04
operator = "first person"
indications = ["D51", "D52", "E5"]
loads = ["FY", "MZ", "MX"]
data = "loads.csv"
[check]
file = "check.csv"
[check.tolerance]
{tolerance}
"""
    )
    return folder / "SESSION.toml"
