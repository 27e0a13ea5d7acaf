"""A maker's tire file against numbers that others worked out from it and printed.

Project Chrono (BSD-3) prints a TMeasy set for its FED-Alpha vehicle (FEDA_TMeasyTire.cpp), made by its own
Magic Formula from the Goodyear 335/65R22.5 G275 MSA at 60 psi (MF-Tyre 5.0): FX at a slip of its grid and at
200 %, FY at 0.8 rad, at half the nominal load and at the nominal load. Its lateral peaks belong to another
curve than the file's and are left out.
"""

import numpy as np
import pytest

from tests.conftest import SHARED_DATA
from toolkit.tires.tir import read_tir
from toolkit.tires.tir_evaluate import evaluate_tir

FILE = SHARED_DATA / "goodyear_feda_tir" / "335_65R22_5_G275MSA_60psi.tir"
# Load [N]; slip sxM, FX there; FX where sx = 0.66667; FY where tan(alpha) = 1.0296 (forces in N, as printed).
PRINTED = [
    (10837.0, 0.16807, 10356.6344, 8598.812, 8073.6063),
    (21674.0, 0.13913, 20238.7957, 16604.7647, 15157.9197),
]
pytestmark = pytest.mark.skipif(not FILE.exists(), reason="no shared data")


@pytest.mark.parametrize(("load", "sxM", "FxM", "FxS", "FyS"), PRINTED)
def test_forces_agree_with_those_that_others_printed(load, sxM, FxM, FxS, FyS):
    tir = read_tir(FILE)
    # sx = KAPPA/(1 + KAPPA); the printed slips have five digits, where FX is flat.
    FX = evaluate_tir(tir, SA=0.0, FZ=load, KAPPA=[sxM / (1 - sxM), 2.0])[0].FX
    assert FX[0] == pytest.approx(FxM, rel=1e-6)
    assert FX[1] == pytest.approx(FxS, abs=1e-4)
    # That program takes the slip angle as it is, as MF-Tyre does.
    FY = evaluate_tir(tir, SA=[0.8], FZ=load, angles="raw")[0].FY
    assert np.tan(0.8) == pytest.approx(1.0296, abs=5e-5)
    assert -FY[0] == pytest.approx(FyS, abs=1e-4)
