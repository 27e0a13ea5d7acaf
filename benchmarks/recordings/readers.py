"""The publishers' layouts, read into tables of our own names and units."""

from __future__ import annotations

import gzip
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.recordings.recording import Run
from benchmarks.records import Array

_HEAD = 25  # lines of text in front of a table of Dataplot
_YEAR_S = 365.25 * 86400.0


def _dataplot(path: Path, *, skip: int = _HEAD) -> Array:
    """Return a table of Dataplot, (rows, columns)."""
    lines = path.read_text(encoding="latin-1").splitlines()[skip:]
    return np.array([[float(word) for word in line.split()] for line in lines if line.strip()])


def _mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    return {name: np.asarray(value) for name, value in loadmat(path).items() if not name.startswith("_")}


def _run(name: str, conditions: Mapping[str, float] | None = None, /, **columns: Array) -> Run:
    return Run(name=name, table=pd.DataFrame(columns), conditions=conditions or {})


def load_cell(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return three runs of eleven loads: the k-th repetition at each load."""
    table = _dataplot(files["LOADCELL.DAT"])
    return tuple(_run(f"repetition{k + 1}", load=table[k::3, 0], response=table[k::3, 1]) for k in range(3))


def transmittance(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return fifty readings, ten a second."""
    y = _dataplot(files["MAVRO.DAT"]).ravel()
    return (_run("readings", t=0.1 * np.arange(y.size), transmittance=y),)


def beam(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return two hundred deflections at equal intervals; the interval is not published, one second stands."""
    y = _dataplot(files["LEW.DAT"]).ravel()
    return (_run("deflections", t=np.arange(y.size, dtype=float), deflection=y),)


def pipeline(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return one run for each of six batches of defects."""
    table = _dataplot(files["BERGER1.DAT"])
    parts = {int(batch): table[table[:, 2] == batch] for batch in np.unique(table[:, 2])}
    return tuple(_run(f"batch{k}", laboratory=rows[:, 1], field=rows[:, 0]) for k, rows in parts.items())


def ultrasonic(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return four runs of ten coded blocks each."""
    table = _dataplot(files["CHWIRUT1.DAT"])
    part = (table[:, 2].astype(int) - 1) // 10
    return tuple(
        _run(f"blocks{k + 1}", distance=table[part == k, 1], response=table[part == k, 0]) for k in range(4)
    )


def carbon_dioxide(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return monthly means; time from the beginning of 1974."""
    table = _dataplot(files["MLCO2MON.DAT"])
    return (_run("months", t=(table[:, 1] - 1974.0) * _YEAR_S, co2=table[:, 0]),)


def drive_steps(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return four runs of 20 s: a torque, and a larger one after 10 s; every 40th row of 1 kHz.

    The torque is the one commanded; the speed begins at rest.
    """
    runs = []
    for file, path in files.items():
        rows = _mat(path)["data"][::40]
        runs.append(_run(file.removesuffix(".mat"), t=rows[:, 0], torque=rows[:, 4], speed=rows[:, 3]))
    return tuple(runs)


def pendulum(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return motions with the motor's torque; the acceleration is the slope of a local parabola of 0.1 s.

    About 100 rows a second are kept.
    """
    from scipy.signal import savgol_filter

    runs = []
    for file, path in files.items():
        table = pd.read_csv(path)
        step = float(np.median(np.diff(table["time"])))
        t = np.arange(float(table["time"].iloc[0]), float(table["time"].iloc[-1]), step)
        angle, speed, torque = (
            np.interp(t, table["time"], table[c]) for c in ("position", "velocity", "torque")
        )
        window = 2 * round(0.05 / step) + 1
        smooth = {"window_length": window, "polyorder": 2}
        rows = slice(window, -window, max(1, round(0.01 / step)))
        runs.append(
            _run(
                Path(file).stem, t=t[rows], angle=angle[rows], speed=savgol_filter(speed, **smooth)[rows],
                acceleration=savgol_filter(speed, **smooth, deriv=1, delta=step)[rows],
                torque=savgol_filter(torque, **smooth)[rows],
            )
        )  # fmt: skip
    return tuple(runs)


def damper(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return two runs of velocity and force, 200 rows a second."""
    m = _mat(files["Magneto.mat"])
    return tuple(
        _run(name, t=0.005 * np.arange(m[v].size), v=m[v].ravel(), force=m[f].ravel())
        for name, v, f in (("first", "U", "Y"), ("second", "U_val", "Y_val"))
    )


def robot_arm(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the first 2 s of both records, every fourth row of 2 kHz, as they are begun."""
    m = _mat(files["RobotArm.mat"])
    rows = slice(0, 4000, 4)
    runs = []
    for name, u, y in (("estimation", "U", "Y"), ("validation", "U_val", "Y_val")):
        torque, speed = m[u].ravel()[rows], m[y].ravel()[rows]
        t = 0.002 * np.arange(torque.size)
        runs.append(_run(name, {"speed0": float(speed[0])}, t=t, torque=torque, speed=speed))
    return tuple(runs)


def coasting(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return speeds of one vehicle that coasts to rest, a row a second."""
    runs = []
    for file, path in files.items():
        speed = np.loadtxt(path) / 3.6
        t = np.arange(speed.size, dtype=float)
        runs.append(_run(Path(file).stem, {"speed0": float(speed[0])}, t=t, v=speed))
    return tuple(runs)


def cooling(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the temperature of a mug of water, a row a minute."""
    minutes, temperature = _numbers(gzip.decompress(files["CoolingWater.rda"].read_bytes()), rows=222)
    return (_run("mug", {"start": float(temperature[0])}, t=60.0 * minutes, temperature=temperature),)


def _numbers(content: bytes, *, rows: int) -> list[Array]:
    """Return the numeric vectors of a length in R's serialised form (XDR): type 14, length, numbers."""
    head = struct.pack(">ii", 14, rows)
    vectors, at = [], content.find(head)
    while at >= 0:
        begin, end = at + len(head), at + len(head) + 8 * rows
        vectors.append(np.frombuffer(content[begin:end], ">f8").astype(np.float64))
        at = content.find(head, end)
    return vectors


def wall(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return flow of heat into a wall and the temperatures on both sides, every ten minutes."""
    table = pd.read_csv(files["DataOWall.csv"], skiprows=[1, 2], index_col=0, parse_dates=True)[::2]
    t = np.asarray((table.index - table.index[0]).total_seconds(), dtype=np.float64)
    columns = {"inside": "T_int", "outside": "T_ext", "flow": "Q_in"}
    return (_run("wall", t=t, **{new: table[old].to_numpy(float) for new, old in columns.items()}),)
