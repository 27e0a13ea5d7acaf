"""Pacejka '94: FY and MZ over slip angle, load and camber, each a Magic Formula of its own.

    y = D sin(C arctan(B x - E (B x - arctan B x))) + V,    x = slip + H,    B = BCD / (C D)

    lateral    C = a0                                      D = FZ (a1 FZ + a2)(1 - a15 g^2)
               BCD = a3 sin(2 arctan(FZ / a4))(1 - a5 |g|)
               E = (a6 FZ + a7)(1 - (a16 g + a17) sign(x))
               H = a8 FZ + a9 + a10 g                      V = a11 FZ + a12 + (a13 FZ + a14) g FZ
    aligning   C = c0                                      D = FZ (c1 FZ + c2)(1 - c18 g^2)
               BCD = (c3 FZ^2 + c4 FZ)(1 - c6 |g|) exp(-c5 FZ)
               E = (c7 FZ^2 + c8 FZ + c9)(1 - (c19 g + c20) sign(x)) / (1 - c10 |g|)
               H = c11 FZ + c12 + c13 g                    V = c14 FZ + c15 + (c16 FZ^2 + c17 FZ) g

FZ in kN, slip and camber g in degrees, FY in N, MZ in N·m, adapted-SAE signs: FY rises and MZ falls with
the slip angle. Source: table 4.1 of the thesis (lateral; it prints g where |g| in BCD is meant, since a
stiffness cannot depend on the side to which a tire leans) and its companion for the moment, which go back to
Bakker, Pacejka and Lidner, SAE 890087 (1989), and Pacejka and Bakker, Vehicle System Dynamics 21 (1993). E is
limited to 1, and a stiffness never changes sign with camber: 1 - a5 |g| and 1 - c6 |g| stay above 0.
The moment is a curve of its own and not trail times force: the two are fitted apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.global_model import Factor, GlobalModel, Responses, Rows, Seeds, parameters
from toolkit.tires.recorded import as_array
from toolkit.tires.slip import nonzero, sine

# name, unit, default, low, high, size, needs, text
_FY = """
a0   1              1.3     0.8    2.2  0.1  -  shape factor of FY
a1   N/kN^2         0.0  -400.0  200.0  20.0 2  load dependence of friction
a2   N/kN        1000.0    50.0 3000.0  100  -  friction, in thousandths
a3   N/deg       1200.0    10.0 30000.0 200  -  largest cornering stiffness
a4   kN             8.0     0.1  120.0  1.0  2  load at the largest cornering stiffness
a5   1/deg          0.0   -0.2     0.2  0.01 c  camber dependence of stiffness
a6   1/kN           0.0   -8.0     8.0  0.2  2  load dependence of curvature
a7   1              0.0  -15.0     6.0  0.5  -  curvature
a8   deg/kN         0.0   -1.0     1.0  0.02 2  load dependence of the horizontal shift
a9   deg            0.0   -3.0     3.0  0.05 -  horizontal shift
a10  1              0.0   -1.0     1.0  0.02 c  camber dependence of the horizontal shift
a11  N/kN           0.0 -300.0   300.0  10   2  load dependence of the vertical shift
a12  N              0.0 -2000.0 2000.0  20   -  vertical shift
a13  N/deg/kN^2     0.0  -50.0    50.0  2    2c load dependence of the camber force
a14  N/deg/kN       0.0 -200.0   200.0  5    c  camber force over load
a15  1/deg^2        0.0   -0.02   0.02 0.001 c  camber dependence of friction
a16  1/deg          0.0   -0.3     0.3  0.02 cs camber dependence of the asymmetry
a17  1              0.0   -1.0     1.0  0.2  s  asymmetry of curvature
"""
_MZ = """
c0   1              2.3     1.0    3.5  0.1  -  shape factor of MZ
c1   N*m/kN^2      -2.0  -40.0    20.0  1.0  2  load dependence of the largest moment
c2   N*m/kN        -3.0 -200.0    60.0  2.0  -  largest moment over load
c3   N*m/deg/kN^2  -1.0  -30.0    15.0  0.5  2  stiffness with load squared
c4   N*m/deg/kN    -2.0  -60.0    20.0  1.0  -  stiffness with load
c5   1/kN           0.0   -0.6     1.0  0.05 3  exponent of the stiffness
c6   1/deg          0.0   -0.2     0.2  0.01 c  camber dependence of stiffness
c7   1/kN^2         0.0   -5.0     5.0  0.1  3  curvature with load squared
c8   1/kN           0.0  -10.0    10.0  0.3  2  curvature with load
c9   1             -2.0  -20.0     6.0  0.5  -  curvature
c10  1/deg          0.0   -0.1     0.1  0.01 c  camber dependence of curvature
c11  deg/kN         0.0   -1.0     1.0  0.02 2  load dependence of the horizontal shift
c12  deg            0.0   -3.0     3.0  0.05 -  horizontal shift
c13  1              0.0   -2.0     2.0  0.05 c  camber dependence of the horizontal shift
c14  N*m/kN         0.0  -30.0    30.0  0.5  2  load dependence of the vertical shift
c15  N*m            0.0 -100.0   100.0  1    -  vertical shift
c16  N*m/deg/kN^2   0.0   -5.0     5.0  0.1  2c camber moment with load squared
c17  N*m/deg/kN     0.0  -20.0    20.0  0.3  c  camber moment with load
c18  1/deg^2        0.0   -0.02   0.02 0.001 c  camber dependence of the largest moment
c19  1/deg          0.0   -0.3     0.3  0.02 cs camber dependence of the asymmetry
c20  1              0.0   -1.0     1.0  0.2  s  asymmetry of curvature
"""
_SPLIT = 18  # a0 to a17


def forces(values: Sequence[Any], rows: Rows) -> Responses:
    """Return FY [N] and MZ [N·m], adapted-SAE, of (a0 ... a17, c0 ... c20) at rows in SI."""
    F, x, g = rows.FZ / 1000.0, np.degrees(rows.SA), np.degrees(rows.IA)
    return Responses(
        FY=lateral(values[:_SPLIT], F, x, g) * (F > 0), MZ=aligning(values[_SPLIT:], F, x, g) * (F > 0)
    )


def lateral(a: Sequence[Any], F: Array, slip: Array, g: Array) -> Array:
    """Return FY [N] of (a0 ... a17) at loads [kN], slip and camber angles [deg], adapted-SAE.

    >>> a = [1.3, -22.0, 1000.0, 1000.0, 5.0] + 13 * [0.0]
    >>> step = np.array([1e-6])  # the slope at zero is BCD = 1000 sin(2 arctan(3/5))
    >>> float(round(lateral(a, np.array([3.0]), step, 0 * step)[0] / 1e-6, 3))
    882.353
    """
    D = F * (a[1] * F + a[2]) * (1 - a[15] * g * g)
    BCD = a[3] * np.sin(2 * np.arctan(F / a[4])) * np.maximum(1 - a[5] * np.abs(g), 0.0)
    x = slip + a[8] * F + a[9] + a[10] * g
    E = (a[6] * F + a[7]) * (1 - (a[16] * g + a[17]) * np.sign(x))
    V = a[11] * F + a[12] + (a[13] * F + a[14]) * g * F
    return as_array(D * sine(BCD / nonzero(a[0] * D), a[0], np.minimum(E, 1.0), x) + V)


def aligning(c: Sequence[Any], F: Array, slip: Array, g: Array) -> Array:
    """Return MZ [N·m] of (c0 ... c20) at loads [kN], slip and camber angles [deg], adapted-SAE."""
    D = F * (c[1] * F + c[2]) * (1 - c[18] * g * g)
    BCD = (c[3] * F * F + c[4] * F) * np.maximum(1 - c[6] * np.abs(g), 0.0) * np.exp(-c[5] * F)
    x = slip + c[11] * F + c[12] + c[13] * g
    E = (c[7] * F * F + c[8] * F + c[9]) * (1 - (c[19] * g + c[20]) * np.sign(x))
    E = np.minimum(E / np.maximum(1 - c[10] * np.abs(g), 0.05), 1.0)
    V = c[14] * F + c[15] + (c[16] * F * F + c[17] * F) * g
    return as_array(D * sine(BCD / nonzero(c[0] * D), c[0], E, x) + V)


# D alone has no sign in D sin(C arctan(BCD x / (C D))): it must keep that of BCD, and so B its own.
BOUNDED = (
    Factor(
        name="D_y", stage="FY", low=50.0, high=3000.0, size=100.0, text="friction of FY, in thousandths"
    ),
    Factor(
        name="1/BC_z", stage="MZ", low=0.02, high=200.0, size=1.0,
        text="slip angle of MZ: its largest value over its stiffness",
    ),
)  # fmt: skip


def factors(values: Sequence[Any], rows: Rows) -> Mapping[str, Any]:
    """Return the factors of `BOUNDED` at rows: a1 FZ + a2 [N/kN], D / BCD of the moment [deg]."""
    F, g = rows.FZ / 1000.0, np.degrees(rows.IA)
    a, c = values[:_SPLIT], values[_SPLIT:]
    stiffness = (c[3] * F + c[4]) * np.maximum(1 - c[6] * np.abs(g), 0.05) * np.exp(-c[5] * F)
    return {
        "D_y": (a[1] * F + a[2]) * (1 - a[15] * g * g),
        "1/BC_z": (c[1] * F + c[2]) * (1 - c[18] * g * g) / nonzero(as_array(stiffness)),
    }


def starts(seeds: Seeds) -> Sequence[Mapping[str, float]]:
    """Return starts: a1, a2, a3, a4, c1 to c4 from the curves of each load, shapes tried."""
    F = seeds.load / 1000.0
    many = len(F) > 1
    a1, a2 = np.polyfit(F, seeds.peak / F, 1) if many else (0.0, float(seeds.peak[0] / F[0]))
    stiffness = np.radians(seeds.stiffness)
    best = (np.inf, float(stiffness[0]), 8.0)
    for a4 in np.geomspace(0.3, 12.0, 40) * F.mean() if many else (8.0,):
        shape = np.sin(2 * np.arctan(F / a4))
        a3 = float(shape @ stiffness / (shape @ shape))
        best = min(best, (float(np.sum((a3 * shape - stiffness) ** 2)), a3, float(a4)))
    common = {"a1": float(a1), "a2": float(a2), "a3": best[1], "a4": best[2]}
    good = np.isfinite(seeds.trail)
    if good.any():
        aligning_stiffness = -(seeds.trail * stiffness)[good] / F[good]
        top = aligning_stiffness * 2.5  # N·m/kN: the largest moment lies near 2.5 deg on any tire
        if good.sum() > 1:
            c3, c4 = np.polyfit(F[good], aligning_stiffness, 1)
            c1, c2 = np.polyfit(F[good], top, 1)
        else:
            (c3, c4), (c1, c2) = (0.0, aligning_stiffness[0]), (0.0, top[0])
        common |= {"c1": float(c1), "c2": float(c2), "c3": float(c3), "c4": float(c4)}
    return [
        {**common, "a0": a0, "a7": a7, "c0": c0, "c9": c9}
        for a0, a7, c0, c9 in (
            (1.3, -0.5, 2.4, -2.0), (1.5, 0.4, 2.0, -0.5), (1.15, -2.5, 2.6, -5.0), (1.3, 0.5, 1.6, -3.0),
        )
    ]  # fmt: skip


MODEL = GlobalModel(
    name="pacejka94",
    title="Pacejka '94",
    reference="thesis table 4.1; Bakker, Pacejka, Lidner, SAE 890087 (1989); Pacejka, Bakker, VSD 21 (1993)",
    valid="within the loads and angles of the data; one pressure, pure side slip",
    axes="adapted-SAE",
    channels=("FY", "MZ"),
    parameters=(*parameters(_FY, stage="FY"), *parameters(_MZ, stage="MZ")),
    forces=forces,
    starts=starts,
    moment_alone=True,
    bounded=BOUNDED,
    factors=factors,
)
