"""Cells of which single rows were lost: an effect on a cell is searched for all the same."""

import numpy as np
import pandas as pd

from tests.conftest import EXAMPLES
from tests.diagnosis.cases import write_case
from tests.diagnosis.tire_case import toml
from tests.golden.cases import TIRE_FILE
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose

REGISTRY = EXAMPLES.parents[1] / "calibrations"
LBF, FOOT = 4.4482216152605, 0.3048
# The published calibration (thesis, section 4.1), lbf and lbf*ft: D51, D52, E5, constant.
FY = (0.99719, 0.99718, 1.0228, 0.6473)
MZ = (-0.15688, 0.16197, 0.0026666, 0.68759)
NAMES = ("D51", "D52", "E5")
ROWS = 100
CELLS = "".join(f'{name} = {{ unit = "lbf", role = "output" }}\n' for name in NAMES)


def tire(SA, FZ):
    """FY [N] and MZ [N*m] of the property file on the machine: Pacejka 2012, 4.E19 to 4.E49, its terms alone.

    Machine axes are SAE's: slip angle, force and moment of ISO-W with the sign changed.
    """
    alpha, df = -np.tan(np.deg2rad(SA)), (FZ - 4000) / 4000
    D = (1.0 - 0.1 * df) * FZ
    B = -15 * 4000 * np.sin(2 * np.arctan(FZ / (1.8 * 4000))) / (1.3 * D)
    force = D * np.sin(1.3 * np.arctan(B * alpha))
    trail = FZ * 0.1 * 0.3 / 4000 * np.cos(1.1 * np.arctan(8 * alpha)) * np.cos(np.deg2rad(SA))
    return -force, trail * force


def recording(seed, *, lost):
    """A sweep on cells: E5 carries a tenth of FY and a little of the load; D51 and D52 what is left."""
    rng = np.random.default_rng(seed)
    t = np.arange(ROWS) * 0.2
    SA = 6 * np.sin(2 * np.pi * t / 7.5 + seed)
    FZ = np.where(t < 10, 3000.0, 5000.0) + 200 * np.sin(t)
    force, moment = tire(SA, FZ)
    E5 = (0.1 * force + 0.02 * FZ) / LBF
    loads = np.stack([force / LBF - FY[2] * E5 - FY[3], moment / LBF / FOOT - MZ[2] * E5 - MZ[3]])
    D51, D52 = np.linalg.solve([FY[:2], MZ[:2]], loads)
    made = {name: one + rng.normal(0, 0.5, ROWS) for name, one in zip(NAMES, (D51, D52, E5), strict=True)}
    made["E5"] = -made["E5"]
    for one in made.values():
        one[rng.choice(ROWS, size=lost, replace=False)] = np.nan
    return pd.DataFrame({"t": t, "SA": SA, "FZ": FZ, **made})


def test_the_sign_of_E5_is_named_although_one_row_in_a_hundred_was_lost(tmp_path):
    text = toml('kind = "machine"\nmachine = "m15"\ntire = "tire.tir"\ncalibration = "m15-r2"\n',
                axes="machine", mu="LMUY", channels=CELLS)  # fmt: skip
    frames = {f"r{i}__csv": recording(i, lost=1) for i in range(2)}
    case = read_case(write_case(tmp_path, text, simulator=None, tire__tir=TIRE_FILE, **frames))
    assert all(int(np.isnan(run.columns[name]).sum()) == 1 for run in case.runs for name in NAMES)
    made = diagnose(case, REGISTRY).diagnosis
    assert (made.verdict, made.remaining) == ("equivalent", "nothing")
    (one,) = made.effects
    assert {one.name, *one.equivalent_to} == {"channel_sign", "wrong_calibration"}
    assert one.channel == "E5"
