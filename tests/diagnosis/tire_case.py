"""Tire cases written by hand: a Magic Formula in SAE axes as simulator, and a minimal property file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from tests.diagnosis.cases import TWO, write_case

# SA, FY, MZ of SAE J670 in each system (drum forward): half turns about x, and the slip angle's sense.
SIGNS = {"machine": (1, 1, 1), "SAE": (1, 1, 1), "adapted-SAE": (-1, 1, 1), "ISO-W": (-1, -1, -1)}
SIMULATOR = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    s = {signs}
    slip, FZ = np.deg2rad(s[0] * inputs["SA"]), inputs["FZ"]
    FY = -p["mu"] * FZ * (1.1 - 2e-5 * FZ) * np.sin(1.3 * np.arctan(9 * slip))
    MZ = 0.02 * FZ * np.sin(2 * np.arctan(8 * slip)) * np.exp(-20 * slip**2)
    return pd.DataFrame({{"FY": s[1] * FY, "MZ": s[2] * MZ}})
"""


def plain(SA: np.ndarray, FZ: np.ndarray) -> pd.DataFrame:
    """Return FY and MZ of the simulator in SAE, SA [deg]."""
    space: dict = {}
    exec(SIMULATOR.format(signs=SIGNS["SAE"]), space)  # noqa: S102
    return space["simulate"](pd.DataFrame({"SA": SA, "FZ": FZ}), {"mu": 1.0})


def sweep(
    axes: str, *, seed: int, offset: float = 0.0, pull: float = 0.0, delay: float = 0.0, leak: float = 0.0
):
    """Return a steering test in an axis system.

    ``offset`` [deg] is what the recorded SA shows too much, ``pull`` [N] comes on top of the recorded FY at
    4000 N, ``leak`` is the share of FZ in it, ``delay`` [s] how much later it is: all in the case's axes.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(120) * 0.1
    s = SIGNS[axes]
    shown = 6 * np.sin(2 * np.pi * t / 7.5 + seed)
    FZ = np.where(t < 6, 3000.0, 5000.0) + 200 * np.sin(t)
    made = plain(s[0] * (shown - offset), FZ)
    FY = np.interp(t - delay, t, s[1] * made["FY"]) + pull * FZ / 4000 + leak * FZ
    return pd.DataFrame(
        {"t": t, "SA": shown, "FZ": FZ, "FY": FY + rng.normal(0, 8, 120),
         "MZ": s[2] * made["MZ"] + rng.normal(0, 0.4, 120)}
    )  # fmt: skip


def toml(simulation: str, *, axes: str = "SAE", channels: str = "", runs: str = "", mu: str = "mu") -> str:
    """Return a tire case; FY and MZ are outputs unless ``channels`` are given."""
    outputs = channels or 'FY = { unit = "N", role = "output" }\nMZ = { unit = "N*m", role = "output" }\n'
    free = f'[simulation.parameters.{mu}]\nvalue = 1.0\nunit = "1"\nsd = 0.05\n' if mu else ""
    return f"""schema = 1
title = "A tire"
[simulation]
{simulation}
{free}[recording]
axes = "{axes}"
[recording.channels]
t = {{ unit = "s", role = "time" }}
SA = {{ unit = "deg", role = "input" }}
FZ = {{ unit = "N", role = "input" }}
{outputs}{runs or TWO}"""


def python_tire(folder: Path, axes: str = "SAE", **effect: float) -> Path:
    """Write a tire test as a case of kind python in some axes, with something left out."""
    return write_case(
        folder, toml('kind = "python"\npath = "sim.py"', axes=axes),
        simulator=SIMULATOR.format(signs=SIGNS[axes]),
        r0__csv=sweep(axes, seed=0, **effect), r1__csv=sweep(axes, seed=1, **effect),
    )  # fmt: skip
