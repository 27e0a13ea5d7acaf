"""The plain brush: bristles on a rigid carcass, a parabolic pressure, one friction coefficient.

    theta = CF / (3 mu FZ),  lambda = 1 - theta sigma  (sigma the size of the theoretical slip)
    F  = mu FZ (1 - lambda^3)              up to full sliding at theta sigma = 1, then mu FZ
    t  = a/3 (1 - 3 ts + 3 ts^2 - ts^3) / (1 - ts + ts^2/3),   ts = theta sigma;  0 when sliding
    FX = F sigma_x/sigma,   FY = -F sigma_y/sigma,   MZ = -t FY

Source: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.2: eq. 3.6 to 3.17 (side slip) and 3.32 to
3.40 (combined, equal stiffness along and across). CF/FZ, mu and a depend on load as `contact` says. Beyond
the book: an equivalent slip angle (plysteer, camber) and offsets of FY and MZ in proportion to load, as
measured tires have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolkit.tires.contact import directed, half_length, slips, with_load
from toolkit.tires.global_model import CAMBER, OFFSETS, SHIFT, GlobalModel, Responses, Rows, Seeds, parameters

# name, unit, default, low, high, size, stage, needs, text
_TABLE = """
C     1/rad  15.0    1.0  200.0    1.0  FY  -  cornering stiffness over load at FNOMIN
C_Z   1       0.0   -3.0    3.0    0.1  FY  2  its change with load: CF/FZ = C exp(C_Z dfz + C_ZZ dfz^2)
C_ZZ  1       0.0   -1.5    1.5    0.1  FY  3  its second change with load
MU    1       1.0   0.05    5.0   0.05  FY  -  friction at FNOMIN
MU_Z  1       0.0   -2.0    2.0   0.05  FY  2  its change with load: mu = MU exp(MU_Z dfz)
A     m      0.08  0.002    0.5  0.005  MZ  -  effective half contact length at FNOMIN
A_P   1       0.5   0.05    2.0    0.1  MZ  2  its growth with load: a = A (FZ/FNOMIN)^A_P
"""


def forces(values: Sequence[Any], rows: Rows) -> Responses:
    """Return FX, FY [N] and MZ [N·m] in SAE axes; ``values`` as `MODEL.parameters`."""
    C, C_Z, C_ZZ, MU, MU_Z, A, A_P, SH, K_IA, SV, SM = values
    sx, sy = slips(rows, SH - K_IA * rows.IA)
    slip, along, across = directed(sx, sy)
    mu = with_load(MU, MU_Z, rows.dfz)
    # CF/FZ stands for CF: no load, no division by it.
    ts = np.minimum(with_load(C, C_Z, rows.dfz, C_ZZ) / (3 * mu) * slip, 1.0)
    F = mu * rows.FZ * (1 - (1 - ts) ** 3)
    trail = half_length(A, A_P, rows) / 3 * (1 - ts) ** 3 / (1 - ts + ts * ts / 3)
    FY = -F * across
    return Responses(FX=F * along, FY=FY + rows.FZ * SV, MZ=-trail * FY + rows.FZ * SM)


def starts(seeds: Seeds) -> tuple[Mapping[str, float], ...]:
    """Return start values: stiffness, peak and trail of each load, brought to their laws of load."""
    stiffness, change = seeds.law(seeds.stiffness / seeds.load)
    friction, fade = seeds.law(seeds.peak / seeds.load)
    trail = seeds.at_nominal(seeds.trail)[0]
    start = {"C": stiffness, "C_Z": change, "MU": friction, "MU_Z": fade}
    if np.isfinite(trail) and trail > 0:
        start["A"] = 3 * trail
    # The brush bends more gently than tires do: its best stiffness lies above the measured one.
    return start, {**start, "C": 1.3 * stiffness}, {**start, "MU": 1.3 * friction}


MODEL = GlobalModel(
    name="brush",
    title="Brush with parabolic pressure",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.2",
    valid="steady rolling, small camber; the carcass is rigid, so that a and CF are effective values; "
    "friction does not depend on speed, so that FY never falls beyond its peak; MZ vanishes when all slides",
    axes="SAE",
    channels=("FY", "MZ"),
    parameters=parameters(_TABLE + SHIFT + CAMBER + OFFSETS),
    reads=("KAPPA",),
    forces=forces,
    starts=starts,
)
