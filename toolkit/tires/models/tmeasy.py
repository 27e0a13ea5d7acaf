"""TMeasy: force against slip by initial slope, peak and sliding point; dynamic trail by three numbers.

    0 to sM    F = dF0 s / (1 + n (n + dF0 sM/FM - 2)),   n = s/sM
    sM to s*   F = FM - a (s - sM)^2,    a = (FM/sM)^2 / (dF0 sM),   s* = sM + (FM - FS)/(a (sS - sM))
    s* to sS   F = FS + b (sS - s)^2,    b = a (s* - sM)/(sS - s*);   beyond sS  F = FS
    (a cubic from FM to FS, level at both ends, where s* does not lie before sS)

Combined slip: s = hypot(sx/hx, sy/hy), hx = sxM/(sxM + syM) + (FxM/dFx0)/(FxM/dFx0 + FyM/dFy0) and hy alike;
with the direction cos, sin of (sx/hx, sy/hy) the five values of F are hypot(x value cos, y value sin), slips
over and slopes times h; FX = F cos, FY = -F sin.

    MZ = -n FY;   n/n0 = (1-w)(1-q) + w (1 - (3-2q) q^2),   q = |sy|/s0, w = s0/sE            up to s0
                  n/n0 = -(1-w) (q-1) ((sE - |sy|)/(sE - s0))^2                               s0 to sE; then 0

Source: Rill, Road Vehicle Dynamics (2012), 3.3 to 3.5; Rill, TMeasy - the handling tire model for all driving
situations, DINAME (2013). Forces and slopes change quadratically and slips linearly with load, through
their values at payload (FNOMIN) and twice payload: Y(FZ) = FZ/FNOMIN Y (1 + Y_Z dfz), with
Y_Z = Y(2 FNOMIN)/(2 Y) - 1, and s(FZ) = s (1 + s_Z dfz), with s_Z = s(2 FNOMIN)/s - 1. The trail n0 is (n/L)0
times the patch length, and that grows as the root of load. Forces are given over FNOMIN.

What follows the peak is given as its distance from it, which keeps the order of the points and says "no fall"
by zero: FS = FM - FD, sS = sM + sD, sE = s0 + sED, each with its own change with load.

Rill asks for dF0 >= 2 FM/sM; where a parameter set breaks it, sM is raised to 2 FM/dF0, since the slope at
zero is what data know best. Camber acts as the lateral slip -K_IA sin(IA). SH, SV, SM as in the brush.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from toolkit.tires.contact import directed, slips
from toolkit.tires.global_model import OFFSETS, SHIFT, GlobalModel, Responses, Rows, Seeds, parameters

_LEAST = 0.05  # a quadratic in load turns over far out; no value falls below this part of its law

# name, unit, default, low, high, size, stage, needs, text
_TABLE = """
dFx0  1  20.0     1.0  300.0    1.0  FX  k  longitudinal slope at zero slip over FNOMIN
FxM   1   1.0    0.05    5.0   0.05  FX  k  largest longitudinal force over FNOMIN
sxM   1  0.15    0.01    2.0   0.03  FX  k  slip at the largest longitudinal force
FxD   1   0.0     0.0    3.0    0.1  FX  k  longitudinal force lost to sliding over FNOMIN
sxD   1   0.5    0.02    5.0    0.1  FX  k  slip from the longitudinal peak to sliding
dFy0  1  15.0     1.0  300.0    1.0  FY  -  lateral slope at zero slip over FNOMIN
FyM   1   1.0    0.05    5.0   0.05  FY  -  largest lateral force over FNOMIN
syM   1  0.15    0.01    2.0   0.03  FY  -  slip at the largest lateral force
FyD   1   0.0     0.0    3.0    0.1  FY  -  lateral force lost to sliding over FNOMIN
syD   1   0.5    0.02    5.0    0.1  FY  -  slip from the lateral peak to sliding
n0    m  0.03  0.0001    0.2  0.002  MZ  -  dynamic trail at zero slip, (n/L)0 L
sy0   1  0.15    0.01    2.0   0.03  MZ  -  lateral slip where the trail changes sign
syED  1  0.25     0.0    5.0    0.1  MZ  -  slip from there to where no trail is left
"""
_CAMBER = """
K_IA  1  0.0  -0.5  1.0  0.02  FY  c  lateral slip of camber over sin(IA)
"""


def forces(values: Sequence[Any], rows: Rows) -> Responses:
    """Return FX, FY [N] and MZ [N·m] in SAE axes; ``values`` as `MODEL.parameters`."""
    p = dict(zip(MODEL.names, values, strict=True))

    def law(name: str) -> Any:
        return p[name] * np.maximum(1 + p[name + "_Z"] * rows.dfz, _LEAST)

    x, y = (
        [law(f"dF{a}0"), law(f"F{a}M"), law(f"s{a}M"), law(f"F{a}M") - law(f"F{a}D"), law(f"s{a}D")]
        for a in "xy"
    )
    sx, sy = slips(rows, p["SH"])
    sy = sy - p["K_IA"] * np.sin(rows.IA)
    for axis in (x, y):
        axis[2] = np.maximum(axis[2], 2 * axis[1] / axis[0])
        axis[3] = np.maximum(axis[3], _LEAST * axis[1])
        axis[4] = axis[2] + axis[4]
    ratio = x[1] / x[0] / (x[1] / x[0] + y[1] / y[0])
    hx, hy = x[2] / (x[2] + y[2]) + ratio, y[2] / (x[2] + y[2]) + 1 - ratio
    slip, cos, sin = directed(sx / hx, sy / hy)
    # The slip's direction at standstill is of no consequence, but the curve needs one.
    sin_ = np.where(slip > 0, sin, 1.0)
    F = rows.FZ * curve(
        slip,
        dF0=np.hypot(x[0] * hx * cos, y[0] * hy * sin_),
        FM=np.hypot(x[1] * cos, y[1] * sin_),
        sM=np.hypot(x[2] / hx * cos, y[2] / hy * sin_),
        FS=np.hypot(x[3] * cos, y[3] * sin_),
        sS=np.hypot(x[4] / hx * cos, y[4] / hy * sin_),
    )
    FY = -F * sin
    s0 = law("sy0")
    offset = law("n0") * np.sqrt(rows.FZ / rows.FNOMIN) * lever(sy, s0=s0, sE=s0 + law("syED"))
    return Responses(FX=F * cos, FY=FY + rows.FZ * p["SV"], MZ=-offset * FY + rows.FZ * p["SM"])


def curve(s: Any, *, dF0: Any, FM: Any, sM: Any, FS: Any, sS: Any) -> Any:
    """Return F of the slip s >= 0 in the unit of FM; arrays broadcast. sS is taken as 1.001 sM at least."""
    sS = np.maximum(sS, 1.001 * sM)
    n = s / sM
    rising = dF0 * s / (1 + n * (n + dF0 * sM / FM - 2))
    a = (FM / sM) ** 2 / (dF0 * sM)
    turn = sM + (FM - FS) / (a * (sS - sM))
    parabolas = turn < sS
    b = a * (turn - sM) / np.where(parabolas, sS - turn, 1.0)
    q = np.clip((s - sM) / (sS - sM), 0.0, 1.0)
    falling = np.where(s <= turn, FM - a * (s - sM) ** 2, FS + b * (sS - s) ** 2)
    falling = np.where(parabolas, falling, FM - (FM - FS) * q * q * (3 - 2 * q))
    return np.where(s <= sM, rising, np.where(s < sS, falling, FS))


def lever(sy: Any, *, s0: Any, sE: Any) -> Any:
    """Return the dynamic trail over its value at zero slip; s0 > 0, sE >= s0."""
    size = np.abs(sy)
    w, q = s0 / sE, size / s0
    near = (1 - w) * (1 - q) + w * (1 - (3 - 2 * q) * q * q)
    to_end = (sE - size) / np.where(sE > s0, sE - s0, 1.0)
    return np.where(q <= 1, near, np.where(size < sE, -(1 - w) * (q - 1) * to_end**2, 0.0))


def starts(seeds: Seeds) -> tuple[Mapping[str, float], ...]:
    """Return start values: slope, peak and its slip from the Magic Formula, three ways to slide."""
    stiffness, slope = seeds.at_nominal(seeds.stiffness / seeds.load)
    peak, fade = seeds.at_nominal(seeds.peak / seeds.load)
    angle = seeds.at_nominal(np.tan(seeds.peak_angle))[0]
    start = {
        "dFy0": stiffness, "dFy0_Z": slope / stiffness, "FyM": peak, "FyM_Z": fade / peak,
        "syM": max(angle, 2.2 * peak / stiffness), "FyD": 0.1 * peak,
    }  # fmt: skip
    trail = seeds.at_nominal(seeds.trail)[0]
    if np.isfinite(trail) and trail > 0:
        start["n0"] = trail
    start |= {"syD": 2 * start["syM"], "sy0": 0.7 * start["syM"], "syED": 1.3 * start["syM"]}
    wide = 1.6 * start["syM"]
    return (
        start,
        {**start, "syM": wide, "syD": wide, "FyD": 0.02 * peak},
        {**start, "FyD": 0.25 * peak, "syD": 0.5 * start["syM"], "syED": 0.1 * start["sy0"]},
    )


def _with_changes(table: str) -> str:
    # Behind every value at payload its change with load.
    lines = []
    for line in filter(None, table.splitlines()):
        name, *_, stage, needs, _ = line.split(maxsplit=8)
        pair = f"{needs.replace('-', '')}2"
        lines += [line, f"{name}_Z  1  0.0  -0.8  1.5  0.2  {stage}  {pair}  change of {name} with load"]
    return "\n".join(lines)


MODEL = GlobalModel(
    name="tmeasy",
    title="TMeasy",
    reference="Rill, Road Vehicle Dynamics (2012), 3.3-3.5; Rill, DINAME 2013",
    valid="loads to about three times the payload, camber to about 5 deg; one peak in FY and FX; the trail "
    "does not depend on longitudinal slip",
    axes="SAE",
    channels=("FX", "FY", "MZ"),
    parameters=parameters(_with_changes(_TABLE) + SHIFT + _CAMBER + OFFSETS),
    reads=("KAPPA",),
    forces=forces,
    starts=starts,
)
