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
from toolkit.tires.global_model import GlobalModel, GlobalParameter, Responses, Rows, Seeds


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
    stiffness, change = _law(seeds, seeds.stiffness / seeds.load)
    friction, fade = _law(seeds, seeds.peak / seeds.load)
    trail = seeds.at_nominal(seeds.trail)[0]
    start = {"C": stiffness, "C_Z": change, "MU": friction, "MU_Z": fade}
    if np.isfinite(trail) and trail > 0:
        start["A"] = 3 * trail
    # The brush bends more gently than tires do: its best stiffness lies above the measured one.
    return start, {**start, "C": 1.3 * stiffness}, {**start, "MU": 1.3 * friction}


def _law(seeds: Seeds, ratio: Any) -> tuple[float, float]:
    base, slope = seeds.at_nominal(np.log(ratio))
    return float(np.exp(base)), slope


MODEL = GlobalModel(
    name="brush",
    title="Brush with parabolic pressure",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.2",
    valid="steady rolling, small camber; the carcass is rigid, so that a and CF are effective values; "
    "friction does not depend on speed, so that FY never falls beyond its peak; MZ vanishes when all slides",
    axes="SAE",
    channels=("FY", "MZ"),
    parameters=(
        GlobalParameter(
            name="C", unit="1/rad", default=15.0, low=1.0, high=200.0, size=1.0,
            text="cornering stiffness over load at FNOMIN",
        ),
        GlobalParameter(
            name="C_Z", unit="1", default=0.0, low=-3.0, high=3.0, size=0.1,
            text="its change with load: CF/FZ = C exp(C_Z dfz + C_ZZ dfz^2)", needs=("two_loads",),
        ),
        GlobalParameter(
            name="C_ZZ", unit="1", default=0.0, low=-1.5, high=1.5, size=0.1,
            text="its second change with load", needs=("three_loads",),
        ),
        GlobalParameter(
            name="MU", unit="1", default=1.0, low=0.05, high=5.0, size=0.05, text="friction at FNOMIN",
        ),
        GlobalParameter(
            name="MU_Z", unit="1", default=0.0, low=-2.0, high=2.0, size=0.05,
            text="its change with load: mu = MU exp(MU_Z dfz)", needs=("two_loads",),
        ),
        GlobalParameter(
            name="A", unit="m", default=0.08, low=0.002, high=0.5, size=0.005,
            text="effective half contact length at FNOMIN", stage="MZ",
        ),
        GlobalParameter(
            name="A_P", unit="1", default=0.5, low=0.05, high=2.0, size=0.1,
            text="its growth with load: a = A (FZ/FNOMIN)^A_P", stage="MZ", needs=("two_loads",),
        ),
        GlobalParameter(
            name="SH", unit="rad", default=0.0, low=-0.1, high=0.1, size=1e-3,
            text="equivalent slip angle of plysteer and steering zero", needs=("both_signs",),
        ),
        GlobalParameter(
            name="K_IA", unit="1", default=0.0, low=-0.5, high=1.0, size=0.02,
            text="equivalent slip angle of camber, per rad", needs=("camber",),
        ),
        GlobalParameter(
            name="SV", unit="1", default=0.0, low=-0.2, high=0.2, size=0.01,
            text="offset of FY over load (conicity)", needs=("both_signs",),
        ),
        GlobalParameter(
            name="SM", unit="m", default=0.0, low=-0.05, high=0.05, size=1e-3,
            text="offset of MZ over load", stage="MZ", needs=("both_signs",),
        ),
    ),
    forces=forces,
    starts=starts,
)  # fmt: skip
