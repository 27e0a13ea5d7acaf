"""A flat-belt machine with a hub of six loads, and a test on it whose truth is known in SAE J670."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from tests.reduction.hub_factory import ARM, CELLS
from toolkit.calibration.records.record import CalibrationRecord
from toolkit.channels import Axes
from toolkit.pipeline import TestResult, process, read_test
from toolkit.recording.folder import read_test_folder

BELT = """schema = 1
name = "rig"
title = "Flat belt 2"
kind = "real"
axes = "SAE"
rotations = ["forward"]
column = [
  { symbol = "FZ", header = "Load", unit = "N", role = "load" },
  { symbol = "SA", header = "SA", unit = "deg", role = "slip_angle" },
  CELLS
]
[drum]
surface = "flat belt"
speed = { value = 60, unit = "km/h" }
speed_tolerance = { value = 2, unit = "km/h" }
HUB
[protocol]
source = "house method 7"
slip_angles = { value = [0, 2, -2, 6, -6], unit = "deg" }
loads = { value = [2000, 4000], unit = "N" }
slip_angle_tolerance = { value = 0.3, unit = "deg" }
load_tolerance = 0.05
settle_revolutions = 2
average_revolutions = 1
acquisition = "after_settling"
"""
HUB = """[hub]
loads = ["FX", "FZ", "MX", "MY"]
arm = { value = 320, unit = "mm" }
u_arm = { value = 2, unit = "mm" }
"""
# From SAE to the vectors of an axis system: half a turn about x (ISO 8855); an angle is no vector.
TURNS: dict[Axes, tuple[float, tuple[float, float, float]]] = {
    "SAE": (1.0, (1.0, 1.0, 1.0)), "ISO-W": (-1.0, (1.0, -1.0, -1.0)), "adapted-SAE": (-1.0, (1.0, 1.0, 1.0)),
}  # fmt: skip
ANGLES, WHEEL_LOADS = (0, 2, -2, 6, -6), (2000.0, 4000.0)


def truth(angle_deg: float, FZ: float) -> dict[str, float]:
    """Return the wrench at the contact patch: [N, N*m], SAE J670; FZ the load."""
    FY = -FZ * math.sin(1.3 * math.atan(11.0 * math.radians(angle_deg)))
    return {"FX": -0.012 * FZ, "FY": FY, "FZ": FZ, "MX": 0.004 * FY, "MY": 3.0, "MZ": -0.02 * FY}


def write_belt(
    folder: Path,
    *,
    hub: bool = True,
    turned: str | None = None,
    load: bool = True,
    zero: float = 0.0,
    axes: Axes = "SAE",
    angles: tuple[float, ...] = ANGLES,
    upward: int = 1,
) -> Path:
    """Write a machine in ``axes`` and a test in ``folder``, at the slip angles [deg] in SAE of its protocol.

    ``turned`` names a cell whose sign is wrong; without ``load`` the machine has no column of its load;
    ``zero`` [count] is what each cell reads of nothing, and of each file's first rows then;
    ``upward`` -1: the load has the sign of a force along z.
    """
    cells = "\n  ".join(
        f'{{ symbol = "{cell}", header = "{cell}", unit = "count", role = "indication" }},' for cell in CELLS
    )
    folder.mkdir(parents=True, exist_ok=True)
    SA_sign, turn = TURNS[axes]
    text = BELT.replace('"SAE"', f'"{axes}"').replace("CELLS", cells)
    text = text.replace("[0, 2, -2, 6, -6]", str([SA_sign * angle for angle in angles]))
    text = text.replace("HUB\n", HUB if hub else "")
    if not load:
        text = text.replace('  { symbol = "FZ", header = "Load", unit = "N", role = "load" },\n', "")
    (folder / "belt.toml").write_text(text)
    test = folder / "test"
    test.mkdir()
    (test / "test.toml").write_text('schema = 1\nmachine = "../belt.toml"\ndate = 2026-03-10\n')
    rng = np.random.default_rng(7)
    for number, angle in enumerate(angles):
        lines = [",".join(["Load [N]", "SA [deg]", *(f"{cell} [count]" for cell in CELLS)][not load :])]
        for FZ in (*((0.0,) if zero else ()), *WHEEL_LOADS):
            patch = truth(angle, FZ)
            force = np.array([patch["FX"], patch["FY"], -FZ])
            moment = np.array([patch[load] for load in ("MX", "MY", "MZ")])
            moment = moment + np.cross([0.0, 0.0, ARM], force)
            force, moment = turn * force, turn * moment
            values = np.array([*force[:2], FZ, *moment])
            if turned is not None:
                values[CELLS.index(turned)] *= -1
            for _ in range(40):
                row = [upward * FZ, SA_sign * angle, *(values + zero + 0.2 * rng.normal(size=6))][not load :]
                lines.append(",".join(f"{value:.4f}" for value in row))
        (test / f"run_{number}.csv").write_text("\n".join(lines) + "\n")
    return test


def processed(test: Path, record: CalibrationRecord) -> TestResult:
    """Return the test's result by a record."""
    folder = read_test_folder(test)
    return process(folder, read_test(folder), record)
