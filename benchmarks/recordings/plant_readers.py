"""The publishers' layouts of materials, tanks, cells, carts and vehicles, read into tables of our own."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.recordings.recording import Run
from benchmarks.records import Array

_GRAM_FORCE = 9.80665e-3  # N
_RAD_S = 2 * np.pi / 60  # of a revolution a minute


def electrical_steel(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return three loops of field strength [A/m] and flux density [T], row by row, the smallest first."""
    from scipy.io import loadmat

    H = loadmat(files["H_M130_27s.mat"])["HmeasT"]
    B = loadmat(files["B_M130_27s.mat"])["BmeasT"]
    return tuple(
        Run(name=f"loop{k + 1}", table=pd.DataFrame({"H": H[:, k], "B": B[:, k]})) for k in range(H.shape[1])
    )


def elastic_tape(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return extension and force of a tape that is drawn out and let back at three rates, about 200 rows
    each, until it hangs slack.
    """
    runs = []
    for file, path in files.items():
        lines = pd.read_csv(path, header=None, names=["t", "x", "F"], encoding="latin-1")
        rows = lines.apply(pd.to_numeric, errors="coerce").dropna().to_numpy(float)
        # The publisher's own limit of a tape that is taut.
        slack = (rows[:, 2] <= 0.01) & (np.arange(len(rows)) > int(np.argmax(rows[:, 2])))
        rows = rows[: int(np.argmax(slack))]
        rows = rows[:: len(rows) // 200]
        frame = pd.DataFrame({"t": rows[:, 0], "x": rows[:, 1] / 1e3, "F": rows[:, 2]})
        runs.append(Run(name="rate_" + file.removesuffix(".csv"), table=frame))
    return tuple(runs)


def cell_pulses(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return four pulse tests of a cell, from 90, 80, 70 and 60 % of its charge: discharge, rest, charge,
    a tenth of the charge taken out, an hour of rest.

    Every tenth row of the long discharge and every fifth of the charge is read, all rows elsewhere.
    """
    table = pd.read_csv(files["cell-low-current-hppc-25c-2.csv"])
    t, mode = table["Time(s)"].to_numpy(float), table["Mode"].str.strip().to_numpy(str)
    current, voltage = (table[name].to_numpy(float) for name in ("Current(A)", "Voltage(V)"))
    phase = np.concatenate([[0], np.cumsum(mode[1:] != mode[:-1])])
    pulses = [k for k in range(int(phase[-1])) if np.median(current[phase == k]) < -25.0]
    runs = []
    for number, (pulse, following) in enumerate(pairwise(pulses[1:6])):
        rows = [np.flatnonzero(phase == pulse)[:1] - 1]
        for k in range(pulse, following):
            part = np.flatnonzero(phase == k)
            step = 10 if len(part) > 500 else 5 if len(part) == 100 else 1
            rows.append(np.union1d(part[::step], part[-1:]))
        sample = np.concatenate(rows)
        columns = {"t": t[sample] - t[sample[0]], "current": current[sample], "voltage": voltage[sample]}
        charge = round(0.9 - 0.1 * number, 1)
        name, conditions = f"charge{round(100 * charge)}", {"start": charge}
        runs.append(Run(name=name, table=pd.DataFrame(columns), conditions=conditions))
    return tuple(runs)


def _draining(files: Mapping[str, Path], name: str) -> Run:
    """Return the level [m] of a tank, every 20th row: from the fullest calibrated level down to that at
    which the jet dies, both the publisher's.
    """
    calibration = pd.read_csv(files["level_sensor_calibration.csv"], encoding="utf-8-sig").to_numpy(float)
    rows = pd.read_csv(files[f"liq_level_data_{name}.csv"], comment="#").to_numpy(float)
    reading = pd.Series(rows[:, 1]).rolling(21, center=True, min_periods=1).median().to_numpy(float)
    full = int(np.argmax(reading))
    begin = full + int(np.argmax(reading[full:] <= calibration[-1, 1]))
    end = begin + int(np.argmax(reading[begin:] <= calibration[1, 1]))
    level = np.interp(rows[begin:end:20, 1], calibration[:, 1], calibration[:, 0]) / 100
    start = float(np.interp(reading[begin], calibration[:, 1], calibration[:, 0])) / 100
    t = rows[begin:end:20, 0]
    frame = pd.DataFrame({"t": t - t[0], "level": level})
    return Run(name=name, table=frame, conditions={"start": start})


def draining_tank(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the level of an empty tank that drains, twice."""
    return tuple(_draining(files, name) for name in ("empty_train", "empty_test"))


def tank_with_bottle(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return the level of the same tank with a bottle in it."""
    return (_draining(files, "w_bottle"),)


def propeller(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return speed, thrust and torque of a propeller on its stand where the speed has settled: within 2 %
    over the second before, as the publisher reads settled rows only.

    Torques beside more than 5 N are left out: the publisher fits his line below it.
    """
    runs = []
    for file, path in files.items():
        table = pd.read_csv(path, encoding="utf-8-sig")
        t, speed, thrust, torque = (table.iloc[:, k].to_numpy(float) for k in (0, 12, 9, 8))
        speed = pd.Series(speed).rolling(37, center=True, min_periods=1).median().to_numpy(float)
        rows = [
            row
            for row in np.flatnonzero(np.isfinite(thrust))
            if speed[row] > 1000.0 and _settled(speed[(t > t[row] - 1.0) & (t <= t[row])])
        ]
        read = np.isfinite(torque)
        pull = thrust[rows] * _GRAM_FORCE
        twist = np.where(pull < 5.0, np.abs(np.interp(t[rows], t[read], torque[read])), np.nan)
        columns = {
            "t": t[rows], "speed": speed[rows] * _RAD_S, "thrust": pull, "torque": twist,
        }  # fmt: skip
        runs.append(Run(name=file.removesuffix(".csv").replace("-", "_"), table=pd.DataFrame(columns)))
    return tuple(runs)


def _settled(speed: Array) -> bool:
    return bool(np.ptp(speed) < 0.02 * np.max(speed))


def belt_cart(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return position and motor current of a cart that a relay drives to and fro, from 10 to 14 s; every
    other row of 150 Hz. The speed at the first row is the slope over 0.06 s.
    """
    runs = []
    for file, path in files.items():
        rows = pd.read_csv(path, header=None).to_numpy(float)
        begin = int(np.argmax(rows[:, 0] >= 10.0))
        near = slice(begin - 4, begin + 5)
        slope = np.polyfit(rows[near, 0] - rows[begin, 0], rows[near, 2], 2)
        part = rows[begin : int(np.argmax(rows[:, 0] >= 14.0)) : 2]
        frame = pd.DataFrame({"t": part[:, 0] - part[0, 0], "current": part[:, 1], "position": part[:, 2]})
        conditions = {"start": float(slope[2]), "speed0": float(slope[1])}
        runs.append(Run(name=file.removesuffix(".csv"), table=frame, conditions=conditions))
    return tuple(runs)


def small_car(files: Mapping[str, Path]) -> tuple[Run, ...]:
    """Return steering command, speed and yaw rate of a small car, 10 Hz: its longest drive above 0.8 m/s,
    the publisher's limit.
    """
    runs = []
    for file, path in files.items():
        table = pd.read_csv(path)
        driving = (table["vel encoder"] > 0.8).to_numpy(bool)
        stretch = np.concatenate([[0], np.cumsum(driving[1:] != driving[:-1])])
        longest = max(np.unique(stretch[driving]), key=lambda k: int(np.sum(stretch == k)))
        rows = table[stretch == longest]
        t = rows["elapsed time sensors"].to_numpy(float)
        columns = {
            "t": t - t[0], "steering": rows["steering"], "speed": rows["vel encoder"],
            "yaw_rate": rows["W (IMU)"],
        }  # fmt: skip
        name = "drive_" + file.removesuffix(".csv")[-8:]
        runs.append(Run(name=name, table=pd.DataFrame({k: np.asarray(v) for k, v in columns.items()})))
    return tuple(runs)
