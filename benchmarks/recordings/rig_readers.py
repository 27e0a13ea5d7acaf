"""The publishers' layouts of rigs and laboratory machines, read into tables of our own names and units."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.recordings.recording import Run
from benchmarks.records import Array

_RATED_HZ = 100.0  # of the tire rig's rows


def _columns(path: Path, *names: str) -> tuple[Array, ...]:
    """Return variables of a MAT-file, (rows,) each."""
    from scipy.io import loadmat

    content: dict[str, Any] = loadmat(path)
    return tuple(np.ravel(content[name]).astype(np.float64) for name in names)


def rack(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return one stroke of a rack: velocity, acceleration and the force that drives it, 1.5 kHz.

    These are the publisher's own filtered channels, before his fit of a friction model.
    """
    t, v, a, force = _columns(files["sample_workspace_3.mat"], "t", "v", "a", "F")
    return (Run(name="stroke", table=pd.DataFrame({"t": t, "v": v, "a": a, "force": force})),)


def heater(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the temperature of a heated transistor beside the heater's power, every other second."""
    table = pd.read_csv(files["0B.99-Step_Test_Data.csv"]).iloc[1::2]
    columns = {"t": "Time", "power": "Q1", "temperature": "T1"}
    frame = pd.DataFrame({new: table[old].to_numpy(float) for new, old in columns.items()})
    return (Run(name="step", table=frame, conditions={"start": float(frame["temperature"].iloc[0])}),)


def torsional_wheel(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the rate of a wheel that swings on a rod, every fifth row of 500 Hz."""
    table = pd.read_csv(files["bicycle-wheel-radial-inertia-rate-gyro-measurement.csv"]).iloc[::5]
    t, rate = table["time"].to_numpy(float), table["angular_velocity"].to_numpy(float)
    frame = pd.DataFrame({"t": t, "rate": rate})
    return (Run(name="gyro", table=frame, conditions={"speed0": float(rate[0])}),)


def _turns(path: Path, *, rate: int) -> tuple[Array, Array]:
    """Return the times [s] of the turns of drum or wheel and its speed [km/h]: the median of five of them.

    A row of the file is an event of either; a turn is a row whose counter, beside the rate, has gone up.
    """
    rows = pd.read_csv(path, header=None).apply(pd.to_numeric, errors="coerce").dropna().to_numpy(float)
    turned = np.concatenate([[False], np.diff(rows[:, rate + 1]) > 0])
    speed = pd.Series(rows[turned, rate]).rolling(5, center=True, min_periods=1).median()
    return rows[turned, 0] / 1e6, speed.to_numpy(float)


def _coasting(name: str, t: Array, speed: Array, *, begin: float, least: float) -> Run:
    """Return a run of a row every two seconds from ``begin`` [s] until a speed [km/h] is reached."""
    rows = np.arange(begin, t[-1], 2.0)
    v = np.interp(rows, t, speed)
    slow = np.flatnonzero(v < least)
    last = int(slow[0]) if slow.size else rows.size
    frame = pd.DataFrame({"t": rows[:last] - begin, "v": v[:last] / 3.6})
    return Run(name=name, table=frame, conditions={"speed0": float(v[0]) / 3.6})


def tire_on_drum(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the speed at the rim of drum and wheel, which coast together, from two seconds after the
    fastest turn.
    """
    runs = []
    for file, path in files.items():
        t, speed = _turns(path, rate=1)
        begin = float(t[int(np.argmax(speed))]) + 2.0
        runs.append(_coasting(_name(file), t, speed, begin=begin, least=4.0))
    return tuple(runs)


def wheel_in_air(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the speed at the rim of a wheel that has been lifted off its drum: from two seconds after it
    is 3 km/h slower than the drum.
    """
    runs = []
    for file, path in files.items():
        t_drum, drum = _turns(path, rate=1)
        t, speed = _turns(path, rate=3)
        apart = (t > t_drum[int(np.argmax(drum))]) & (speed < np.interp(t, t_drum, drum) - 3.0)
        begin = float(t[int(np.argmax(apart))]) + 2.0
        runs.append(_coasting(_name(file), t, speed, begin=begin, least=2.0))
    return tuple(runs)


def _name(file: str) -> str:
    """Return the run's name of a file such as "Grandprix - Contact - Left - 100 psi.csv"."""
    return "_".join(part.strip().replace(" ", "") for part in Path(file).stem.split("-")[1:])


def two_cells(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the counts of two load cells in series, loaded and then unloaded; every other row of 10 Hz."""
    rows = pd.read_csv(files["LoadCellCalibrationData.txt"], header=None).to_numpy(float)[::2]
    t, first, second = (rows[:, 0] - rows[0, 0]) / 1e3, rows[:, 10], rows[:, 11]
    parts = {"loading": t < 87.0, "unloading": t >= 87.0}
    frames = {
        name: pd.DataFrame({"t": t[part] - t[part][0], "first": first[part], "second": second[part]})
        for name, part in parts.items()
    }
    return tuple(Run(name=name, table=frame) for name, frame in frames.items())


def tire_sweeps(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return six sweeps of the slip angle at five loads, upright and at 83 kPa; every fifth row of 100 Hz.

    FZ is turned to the load, positive; the axes stay SAE.
    """
    names = ("ET", "SA", "FZ", "V", "TSTC", "FY", "MZ", "IA", "P")
    ET, SA, FZ, V, T, FY, MZ, IA, P = _columns(files["cornering.mat"], *names)
    upright = (np.abs(IA) < 0.3) & (np.abs(P - 83.0) < 3.0)
    columns = {
        "t": ET - ET[0], "SA": SA, "FZ": -FZ, "V": V / 3.6, "T_TREAD": T, "FY": FY, "MZ": MZ,
    }  # fmt: skip
    table = pd.DataFrame(columns)[upright]
    sweep = (table["t"].diff() > 50 / _RATED_HZ).cumsum()
    return tuple(
        Run(name=f"sweep{int(number) + 1}", table=rows.iloc[::5]) for number, rows in table.groupby(sweep)
    )
