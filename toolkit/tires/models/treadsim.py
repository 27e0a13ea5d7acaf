"""TreadSim: a brush with any pressure, a tread of finite width, and a carcass that yaws and bends.

A bristle enters at the leading edge without deflection and is followed along the patch: it adheres while its
force stays under mu q, else it slides back to that limit (`bristles`).

    q(u)  (1 - |u|^N)(1 + SKEW u), u = x/a from 1 to -1, normalised to the load    (`contact.bulged`)
    mu    MU (p/p0)^-MU_P / (1 + MU_V vs);  p the local pressure, p0 its mean at FNOMIN, vs the sliding speed
    slip  tan(SA) - YAW' MZ + BEND' FY a u - camber (1 - EPS) sin(IA) x/R: the slope of the contact line
    camber also rolls the right of the tread slower than the left: slip along (1 - EPS) sin(IA) y/R

YAW and BEND say how soft the carcass is beside the tread: at FNOMIN the belt turns by 3 YAW/(C FNOMIN A) rad
per N·m, and the contact line has the slope 3 BEND/(C FNOMIN) per N at the patch's ends. C is the stiffness of
the tread alone; the tire's slope at zero is C/((1 + YAW)(1 + BEND)). LAT is the lateral compliance: the
patch, and with it FX, moves aside.

Source: Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.3, with its approximations that friction depends
on the speed of the bristle's base and that a sliding bristle keeps its direction. The pressure's law and the
dependence on load are ours. The sums over the bristles know where a bristle begins to slide between two
middles, so that 40 of them come within 1e-4 of the forces under a parabola, and for all pressures within 1e-3
(FY) and 5e-3 (MZ) of their largest values; where slips along and across turn a bristle while it slides,
within 3e-3 and 2e-2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.tires.bristles import Tread, balance, middles, sharpened, summed
from toolkit.tires.contact import bulged, half_length, slips, with_load
from toolkit.tires.global_model import OFFSETS, SHIFT, GlobalModel, Responses, Rows, Seeds, parameters

BRISTLES = 40
LINES = 5
_OUTSIDE = ("LAT", "SV", "SM")  # act on what the bristles sum to
_NEAR = 1e-3  # of the parameters' sizes: so near is one tire's balance a start for another's
_MANY = 3  # copies to one: then two more states to know its derivative are cheap
_THIN = 1e-2  # of the mean pressure: friction does not grow without end where the pressure vanishes

# name, unit, default, low, high, size, stage, needs, text
_TABLE = """
C     1/rad  20.0    1.0  300.0    1.0  FY  -  cornering stiffness of the tread over load at FNOMIN
C_Z   1       0.0   -2.0    2.0    0.1  FY  2  its change with load: C exp(C_Z dfz)
A     m      0.07  0.002    0.5  0.005  MZ  -  half contact length at FNOMIN
A_P   1       0.5   0.05    1.5    0.1  MZ  2  its growth with load: a = A (FZ/FNOMIN)^A_P
N     1       2.0    1.0   12.0    1.0  FY  -  exponent of the pressure: 2 a parabola, large an even one
SKEW  1       0.0   -0.9    0.9   0.15  MZ  -  pressure at the leading edge against the trailing one
MU    1       1.0   0.05    6.0   0.05  FY  -  friction at the mean pressure of FNOMIN without sliding
MU_P  1       0.0    0.0    0.9    0.1  FY  2  fall of friction with local pressure, exponent
MU_V  s/m     0.0    0.0    1.0   0.03  FY  -  fall of friction with sliding speed
YAW   1       0.0    0.0    1.2    0.1  MZ  -  yaw compliance of the carcass
BEND  1       0.0    0.0    2.0    0.1  MZ  -  bending compliance of the carcass
LAT   m       0.0    0.0    0.2  0.002  MZ  a  lateral displacement of the patch for FY = FNOMIN
B     m      0.08    0.0    0.3   0.01  MZ  c  half the width of the tread
EPS   1       0.5   -0.5    1.0    0.1  FY  c  part of camber that the tire's deformation takes up
"""


def forces(values: Sequence[Any], rows: Rows, *, bristles: int = BRISTLES, lines: int = LINES) -> Responses:
    """Return FX, FY [N] and MZ [N·m] in SAE axes; ``values`` as `MODEL.parameters`.

    ``bristles`` are those along the patch, ``lines`` those over its width (only with camber).
    """
    p = dict(zip(MODEL.names, values, strict=True))
    sx, sy = slips(rows, p["SH"])
    a = half_length(p["A"], p["A_P"], rows)
    load = rows.FZ / rows.FNOMIN
    C = with_load(p["C"], p["C_Z"], rows.dfz)
    tilt = (1 - p["EPS"]) * np.sin(rows.IA) / rows.UNLOADED_RADIUS
    rolling = np.abs(rows.V * np.cos(rows.SA) * (1 + rows.KAPPA))
    softness = 3 / p["C"] * load
    cases = {
        "half_C": 0.5 * C,
        "fade": p["MU_V"] * rolling,
        "yaw": p["YAW"] * softness * (a / p["A"]),
        "bend": p["BEND"] * softness,
        "curve": tilt * a,
        "cone": -tilt * p["B"],
        "edge": p["B"] / np.maximum(a, 1e-6),
    }
    shape, arrays = _flat({**cases, "sx": sx, "sy": sy})
    sx, sy = arrays.pop("sx"), arrays.pop("sy")
    limit = _limit(p, load, p["A_P"], shape, bristles)
    FX, FY, moment = (
        one.reshape(shape) for one in _sums(Tread(limit=limit, **arrays), sx, sy, lines, *_leaders(p, shape))
    )
    FX, FY = FX * rows.FZ, FY * rows.FZ
    MZ = moment * rows.FZ * a - FX * FY / rows.FNOMIN * p["LAT"]
    return Responses(FX=FX, FY=FY + rows.FZ * p["SV"], MZ=MZ + rows.FZ * p["SM"])


def _leaders(p: Mapping[str, Any], shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    # (copies,) the first copy whose bristles are nearly those of each copy, and where they are the same: a
    # derivative asks for copies of one tire that differ by a millionth, or in what acts on the sums alone.
    copies = shape[0] if len(shape) == 2 else 1
    searched = [
        parameter
        for parameter in MODEL.parameters
        if parameter.name not in _OUTSIDE and np.size(p[parameter.name]) > 1
    ]
    if copies == 1 or not searched:
        return np.zeros(copies, dtype=np.intp), np.arange(copies) > 0
    places = np.stack([np.ravel(p[parameter.name]) / parameter.size for parameter in searched], axis=1)
    nearest = np.full(copies, -1)
    for copy in range(copies):
        if nearest[copy] < 0:
            near = np.abs(places - places[copy]).max(axis=1) <= _NEAR
            nearest[near & (nearest < 0)] = copy
    return nearest, (places == places[nearest]).all(axis=1) & (nearest != np.arange(copies))


def _sums(
    tread: Tread, sx: Array, sy: Array, lines: int, leaders: NDArray[np.intp], same: NDArray[np.bool_]
) -> Array:
    # The sums (3, cases) of copies: those that lead are balanced first, the others start from there.
    copies = len(leaders)
    led = leaders != np.arange(copies)
    if not led.any():
        return balance(tread, sx, sy, lines=lines).sums
    of_copy = np.arange(len(sy)).reshape(copies, -1)
    first, followers = of_copy[~led].ravel(), of_copy[led & ~same].ravel()
    leading = tread.take(first)
    start = balance(leading, sx[first], sy[first], lines=lines)
    if len(followers) > _MANY * len(first):
        start = sharpened(leading, sx[first], sy[first], start, lines=lines)
    # Of each copy, its leader's cases among those that lead.
    begun = np.arange(len(first)).reshape(-1, of_copy.shape[1])[(np.cumsum(~led) - 1)[leaders]]
    sums = start.sums[:, begun.ravel()]
    near = start.take(begun[led & ~same].ravel())
    sums[:, followers] = balance(
        tread.take(followers), sx[followers], sy[followers], lines=lines, near=near
    ).sums
    return sums


def _limit(p: Mapping[str, Any], load: Array, growth: Any, shape: tuple[int, ...], bristles: int) -> Array:
    # (bristles, cases): friction at standstill times the pressure of each bristle, over FZ/a.
    u = middles(bristles).reshape(-1, *(1 for _ in shape))
    q = bulged(u, p["N"], p["SKEW"])
    q = q / summed(q)
    # The power of pressure by its two factors, over the patch and over the load: one has few rows.
    mean = np.power(np.maximum(load, _THIN), 1 - growth)
    limit = p["MU"] * np.power(np.maximum(2 * q, _THIN), -p["MU_P"]) * q * np.power(mean, -p["MU_P"])
    return np.ascontiguousarray(np.broadcast_to(limit, (bristles, *shape))).reshape(bristles, -1)


def _flat(arrays: Mapping[str, Any]) -> tuple[tuple[int, ...], dict[str, Array]]:
    # All at one shape, then in one line of cases.
    together = np.broadcast_arrays(*(np.asarray(array, dtype=np.float64) for array in arrays.values()))
    shape = together[0].shape
    return shape, {name: np.ravel(array) for name, array in zip(arrays, together, strict=True)}


def starts(seeds: Seeds) -> tuple[Mapping[str, float], ...]:
    """Return start values: stiffness, peak and trail of each load, with a stiff and two soft carcasses."""
    stiffness, change = seeds.law(seeds.stiffness / seeds.load)
    friction, fade = seeds.law(seeds.peak / seeds.load)
    trail = seeds.at_nominal(seeds.trail)[0]
    start = {
        "C": 1.3 * stiffness, "C_Z": change, "MU": 1.1 * friction,
        "MU_P": min(max(-2 * fade, 0.0), 0.5), "N": 3.0, "YAW": 0.1, "BEND": 0.1,
    }  # fmt: skip
    if np.isfinite(trail) and trail > 0:
        start["A"] = 2.5 * trail
    soft = {**start, "C": 1.8 * stiffness, "YAW": 0.4, "BEND": 0.2, "N": 4.0}
    return start, soft, {**soft, "MU_V": 0.03, "SKEW": 0.3, "MU": 1.3 * friction}


MODEL = GlobalModel(
    name="treadsim",
    title="TreadSim",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 3.3",
    valid="steady rolling forward, camber to about 10 deg; a rectangular patch whose pressure is even over "
    "its width; a sliding bristle keeps its direction",
    axes="SAE",
    channels=("FY", "MZ"),
    joint=True,
    grid=BRISTLES,
    parameters=parameters(_TABLE + SHIFT + OFFSETS),
    reads=("IA", "KAPPA", "V"),
    forces=forces,
    starts=starts,
)
