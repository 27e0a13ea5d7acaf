"""The publishers' layouts of recordings of friction, drag and loops, read into tables of our own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.recordings.recording import Run

_INCH, _KIP = 0.0254, 4448.2216


def band_brake(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return travel, velocity and force of a band brake moved by sines; every eighth row of 1024 Hz."""
    runs = []
    for file, path in files.items():
        rows = np.array(json.loads(path.read_text(encoding="utf-8"))["data"])[::8]
        frame = pd.DataFrame(
            {"t": rows[:, 0], "x": rows[:, 1] * _INCH, "v": rows[:, 3] * _INCH, "F": rows[:, 2] * _KIP}
        )
        runs.append(Run(name=file.removesuffix(".json").replace(".", "_"), table=frame))
    return tuple(runs)


def swinging_bob(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the angle of a wooden bob on a thread, filmed at 30 pictures a second."""
    rows = pd.read_excel(files["damping_angle.xlsx"], header=None, engine="openpyxl").to_numpy(float)
    angle = np.radians(rows[:, 1])
    frame = pd.DataFrame({"t": rows[:, 0] - rows[0, 0], "angle": angle})
    return (Run(name="wooden_bob", table=frame, conditions={"angle0": float(angle[0])}),)


def air_cylinder(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return pressure, travel, velocity and force of a piston; every fourth row of 100 Hz."""
    runs = []
    for file, path in files.items():
        rows = pd.read_csv(path, sep="\t", header=None).to_numpy(float)[::4]
        t, x = (rows[:, 0] - rows[0, 0]) / 1e3, rows[:, 4] / 1e3
        frame = pd.DataFrame(
            {"t": t, "x": x, "v": np.gradient(x, t), "pressure": rows[:, 5] * 1e5, "F": rows[:, 6]}
        )
        runs.append(Run(name=file.removesuffix(".csv"), table=frame))
    return tuple(runs)


def concrete_column(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the travel of a column's head [m] and its lateral load over its weight [1], row by row."""
    from scipy.io import loadmat

    rows = loadmat(files["column_experimental_data.mat"])["data_exp"]
    return (Run(name="column", table=pd.DataFrame({"x": rows[:, 0], "load": rows[:, 1]})),)
