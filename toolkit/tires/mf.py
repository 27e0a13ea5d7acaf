"""What Magic Formula 5.2 and 6.x share: longitudinal force, combined slip, and their parameters.

Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012): FX 4.E9 to 4.E18, combined FX 4.E50 to 4.E57,
combined FY 4.E58 to 4.E67, arm of FX 4.E76. MF 5.2 has no pressure, no RBX3 and no RBY4: `mf_versions`
keeps them out. The curvature factors are limited to 1.

Parameters have their names in a tire file and bounds that keep a curve physical. These follow the practice
of the field (Pacejka 2012, appendix 3, prints typical sets; Besselink et al. 2010 state that B, C, D, K and
1 - E must keep their sign), wide enough for bicycle to truck tires. PKY4 stays 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Axes, signs
from toolkit.tires.global_model import (
    Factor,
    Factors,
    GlobalModel,
    GlobalParameter,
    Responses,
    Rows,
    Seeds,
    parameters,
)
from toolkit.tires.recorded import as_array
from toolkit.tires.slip import State, cosine, nonzero, readers, sine, state

# name, default, low, high, size, needs, text
_LATERAL = """
PCY1  1.3    0.8   2.2  0.1   -    shape factor C
PDY1  1.0    0.05  3.0  0.1   -    friction at the nominal load
PDY2  0.0   -1.0   1.0  0.1   2    change of friction with load
PDY3  0.0  -20.0  30.0  1.0   c    change of friction with camber squared
PEY1  0.0  -15.0   1.0  0.5   -    curvature at the nominal load
PEY2  0.0  -15.0  15.0  0.5   2    change of curvature with load
PEY3  0.0   -1.0   1.0  0.2   s    asymmetry of curvature
PEY4  0.0  -20.0  20.0  1.0   cs   change of that asymmetry with camber
PKY1 -20.0 -200.0 -1.0  2.0   -    largest stiffness over the nominal load
PKY2  2.0    0.1  20.0  0.3   2    load at the largest stiffness over the nominal load
PKY3  0.0   -5.0   5.0  0.2   c    change of stiffness with camber
PHY1  0.0   -0.05  0.05 0.001 -    horizontal shift
PHY2  0.0   -0.05  0.05 0.001 2    change of horizontal shift with load
PVY1  0.0   -0.3   0.3  0.01  -    vertical shift over load
PVY2  0.0   -0.3   0.3  0.01  2    change of vertical shift with load
PVY3  0.0   -3.0   3.0  0.1   c    change of vertical shift with camber
PVY4  0.0   -3.0   3.0  0.1   2c   change of that with load
"""
_LATERAL_52 = """
PHY3  0.0   -1.0   1.0  0.01  c    change of horizontal shift with camber
"""
_LATERAL_61 = """
PEY5  0.0 -100.0 100.0  5.0   c    change of curvature with camber squared
PKY5  0.0  -20.0  20.0  1.0   2c   change with camber of the load at the largest stiffness
PKY6  0.0  -10.0  10.0  0.2   c    camber stiffness over load
PKY7  0.0  -10.0  10.0  0.2   2c   change of camber stiffness with load
PPY1  0.0   -3.0   3.0  0.1   p    change of stiffness with pressure
PPY2  0.0   -3.0   3.0  0.1   2p   change with pressure of the load at the largest stiffness
PPY3  0.0   -2.0   2.0  0.1   p    change of friction with pressure
PPY4  0.0   -5.0   5.0  0.2   P    change of friction with pressure squared
PPY5  0.0   -5.0   5.0  0.2   cp   change of camber stiffness with pressure
"""
_ALIGNING = """
QBZ1   9.0    0.3  80.0  2.0   -   slope factor of the trail
QBZ2   0.0  -60.0  60.0  2.0   2   change of the slope factor with load
QBZ3   0.0  -60.0  60.0  2.0   3   change of the slope factor with load squared
QBZ4   0.0   -5.0   5.0  0.2   c   change of the slope factor with camber
QBZ5   0.0   -5.0   5.0  0.2   c   change of the slope factor with |camber|
QBZ10  0.5    0.0   3.0  0.2   -   slope factor of the residual moment
QCZ1   1.2    0.3   3.0  0.1   -   shape factor of the trail
QDZ1   0.1    0.0   1.0  0.02  -   trail over the free radius at the nominal load
QDZ2   0.0   -1.0   1.0  0.02  2   change of the trail with load
QDZ3   0.0   -5.0   5.0  0.2   c   change of the trail with camber
QDZ4   0.0  -50.0  50.0  2.0   c   change of the trail with camber squared
QDZ6   0.0   -0.1   0.1  0.001 -   residual moment over load and radius
QDZ7   0.0   -0.1   0.1  0.001 2   change of the residual moment with load
QDZ8   0.0   -1.0   1.0  0.02  c   change of the residual moment with camber
QDZ9   0.0   -1.0   1.0  0.02  2c  change of that with load
QEZ1  -1.0  -20.0   1.0  0.5   -   curvature of the trail
QEZ2   0.0  -20.0  20.0  0.5   2   change of the trail's curvature with load
QEZ3   0.0  -20.0  20.0  0.5   3   change of the trail's curvature with load squared
QEZ4   0.0   -2.0   2.0  0.2   s   asymmetry of the trail's curvature
QEZ5   0.0  -20.0  20.0  1.0   cs  change of that asymmetry with camber
QHZ1   0.0   -0.05  0.05 0.001 -   shift of the trail
QHZ2   0.0   -0.05  0.05 0.001 2   change of the trail's shift with load
QHZ3   0.0   -1.0   1.0  0.02  c   change of the trail's shift with camber
QHZ4   0.0   -1.0   1.0  0.02  2c  change of that with load
"""
_ALIGNING_61 = """
QDZ10  0.0  -10.0  10.0  0.2   c   residual moment with camber times |camber|
QDZ11  0.0  -10.0  10.0  0.2   2c  change of that with load
PPZ1   0.0   -3.0   3.0  0.1   p   change of the trail with pressure
PPZ2   0.0   -5.0   5.0  0.2   cp  change with pressure of the residual moment of camber
"""
_LONGITUDINAL = """
PCX1   1.6    0.8   2.5  0.1   k   shape factor C
PDX1   1.1    0.05  3.0  0.1   k   friction at the nominal load
PDX2   0.0   -1.0   1.0  0.1   2k  change of friction with load
PDX3   0.0  -30.0  30.0  1.0   ck  change of friction with camber squared
PEX1   0.0  -15.0   1.0  0.5   k   curvature at the nominal load
PEX2   0.0  -15.0  15.0  0.5   2k  change of curvature with load
PEX3   0.0  -15.0  15.0  0.5   3k  change of curvature with load squared
PEX4   0.0   -1.0   1.0  0.2   K   asymmetry of curvature
PKX1  20.0    1.0 150.0  2.0   k   slip stiffness over load
PKX2   0.0 -100.0 100.0  2.0   2k  change of slip stiffness with load
PKX3   0.0   -3.0   3.0  0.1   3k  exponent of that change
PHX1   0.0   -0.05  0.05 0.001 k   horizontal shift
PHX2   0.0   -0.05  0.05 0.001 2k  change of horizontal shift with load
PVX1   0.0   -0.3   0.3  0.01  k   vertical shift over load
PVX2   0.0   -0.3   0.3  0.01  2k  change of vertical shift with load
RBX1  12.0    1.0  60.0  2.0   ka  slope factor of FX against slip angle
RBX2 -10.0  -60.0  60.0  2.0   ka  change of that with slip
RCX1   1.0    0.5   1.6  0.05  ka  shape factor of FX against slip angle
REX1   0.0  -15.0   1.0  0.5   ka  curvature of FX against slip angle
RHX1   0.0   -0.05  0.05 0.002 ka  shift of FX against slip angle
"""
_LONGITUDINAL_61 = """
PPX1   0.0   -3.0   3.0  0.1   pk  change of slip stiffness with pressure
PPX2   0.0   -5.0   5.0  0.2   Pk  change of slip stiffness with pressure squared
PPX3   0.0   -2.0   2.0  0.1   pk  change of friction with pressure
PPX4   0.0   -5.0   5.0  0.2   Pk  change of friction with pressure squared
"""
_COMBINED_LATERAL = """
RBY1   7.0    0.5  60.0  1.0   ka  slope factor of FY against longitudinal slip
RBY2   2.5  -40.0  40.0  1.0   ka  change of that with slip angle
RBY3   0.0   -0.3   0.3  0.01  ka  shift of that change
RCY1   1.0    0.5   1.6  0.05  ka  shape factor of FY against longitudinal slip
REY1   0.0  -15.0   1.0  0.5   ka  curvature of FY against longitudinal slip
REY2   0.0  -15.0  15.0  0.5   2ka change of that curvature with load
RHY1   0.0   -0.1   0.1  0.005 ka  shift of FY against longitudinal slip
RHY2   0.0   -0.1   0.1  0.005 2ka change of that shift with load
RVY1   0.0   -1.0   1.0  0.02  ka  side force that longitudinal slip induces, over friction
RVY2   0.0   -1.0   1.0  0.02  2ka change of that with load
RVY4   0.0  -50.0  50.0  2.0   ka  change of that with slip angle
RVY5   1.9    0.5   3.0  0.1   ka  shape factor of the induced force
RVY6   0.0  -60.0  60.0  2.0   ka  slope factor of the induced force
"""
_COMBINED_ALIGNING = """
SSZ1   0.0   -0.3   0.3  0.005 ka  arm of FX over the free radius
SSZ2   0.0   -0.3   0.3  0.005 ka  change of the arm with FY
SSZ3   0.0   -3.0   3.0  0.05  cka change of the arm with camber
SSZ4   0.0   -3.0   3.0  0.05  2cka change of that with load
"""

MF52 = (
    *parameters(_LONGITUDINAL, stage="FX", unit="1"),
    *parameters(_LATERAL + _LATERAL_52 + _COMBINED_LATERAL, stage="FY", unit="1"),
    *parameters(_ALIGNING + _COMBINED_ALIGNING, stage="MZ", unit="1"),
)
MF61 = (
    *parameters(_LONGITUDINAL + _LONGITUDINAL_61, stage="FX", unit="1"),
    *parameters(_LATERAL + _LATERAL_61 + _COMBINED_LATERAL, stage="FY", unit="1"),
    *parameters(_ALIGNING + _ALIGNING_61 + _COMBINED_ALIGNING, stage="MZ", unit="1"),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Forces:
    """FX, FY [N], MZ [N·m], arrays of one shape, ISO-W."""

    FX: Array
    FY: Array
    MZ: Array

    def in_axes(self, axes: Axes) -> Forces:
        """Return the same forces in another axis system; what is zero has no sign there either."""
        turn = signs("ISO-W", axes)
        return Forces(FX=self.FX + 0.0, FY=turn["FY"] * self.FY + 0.0, MZ=turn["MZ"] * self.MZ + 0.0)


Evaluator = Callable[..., Forces]
"""Of a tire file: parameters, state, UNLOADED_RADIUS."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Longitudinal:
    """FX [N] of pure longitudinal slip and its stiffness K [N]."""

    FX: Array
    K: Array


def longitudinal(p: Mapping[str, float], q: State) -> Longitudinal:
    """Return the force of pure longitudinal slip (4.E9 to 4.E18)."""
    c, s = readers(p)
    x = q.kappa + (c("PHX1") + c("PHX2") * q.df) * s("LHX")
    C = c("PCX1") * s("LCX")
    mu = (c("PDX1") + c("PDX2") * q.df) * (1 + c("PPX3") * q.dp + c("PPX4") * q.dp**2)
    D = mu * (1 - c("PDX3") * q.g**2) * q.mu_x * q.FZ
    E = (c("PEX1") + c("PEX2") * q.df + c("PEX3") * q.df**2) * (1 - c("PEX4") * np.sign(x)) * s("LEX")
    K = q.FZ * (c("PKX1") + c("PKX2") * q.df) * np.exp(c("PKX3") * q.df)
    K = K * (1 + c("PPX1") * q.dp + c("PPX2") * q.dp**2) * s("LKX")
    Sv = q.FZ * (c("PVX1") + c("PVX2") * q.df) * s("LVX") * q.mu_x
    return Longitudinal(FX=D * sine(K / nonzero(C * D), C, np.minimum(E, 1.0), x) + Sv, K=K)


def weight_x(p: Mapping[str, float], q: State) -> Array:
    """Return G_xa, by which slip angle lowers FX (4.E51 to 4.E57)."""
    c, s = readers(p)
    B = (c("RBX1") + c("RBX3") * q.g**2) * np.cos(np.arctan(c("RBX2") * q.kappa)) * s("LXAL")
    C, E = c("RCX1"), np.minimum(c("REX1") + c("REX2") * q.df, 1.0)
    return cosine(B, C, E, q.a + c("RHX1")) / nonzero(cosine(B, C, E, c("RHX1")))


def weight_y(p: Mapping[str, float], q: State) -> Array:
    """Return G_yk, by which longitudinal slip lowers FY (4.E59 to 4.E65)."""
    c, s = readers(p)
    B = (c("RBY1") + c("RBY4") * q.g**2) * np.cos(np.arctan(c("RBY2") * (q.a - c("RBY3")))) * s("LYKA")
    C, E = c("RCY1"), np.minimum(c("REY1") + c("REY2") * q.df, 1.0)
    shift = c("RHY1") + c("RHY2") * q.df
    return cosine(B, C, E, q.kappa + shift) / nonzero(cosine(B, C, E, shift))


def kappa_force(p: Mapping[str, float], q: State, friction: Array) -> Array:
    """Return S_Vyk [N], the side force that kappa induces (4.E66, 4.E67); ``friction`` is mu_y Fz [N]."""
    c, s = readers(p)
    D = friction * (c("RVY1") + c("RVY2") * q.df + c("RVY3") * q.g) * np.cos(np.arctan(c("RVY4") * q.a))
    return as_array(D * np.sin(c("RVY5") * np.arctan(c("RVY6") * q.kappa)) * s("LVYKA"))


def equivalent(slip: Array, ratio: Array, kappa: Array) -> Array:
    """Return the slip angle that stands for both slips; ``ratio`` is K_x / K_y.

    arctan sqrt(tan^2(slip) + ratio^2 kappa^2) sgn(slip): Besselink, Schmeitz, Pacejka, Vehicle System
    Dynamics 48 (2010), A54 and A55. At kappa = 0 it is the slip angle itself. From a quarter turn on,
    where the tangent would fold it back, nothing is added.
    """
    inside = np.abs(slip) < np.pi / 2
    joined = np.arctan(np.hypot(np.tan(np.where(inside, slip, 0.0)), ratio * kappa))
    return np.where(inside & (kappa != 0), np.copysign(joined, slip), slip)


def arm(p: Mapping[str, float], q: State, *, FY: Array, UNLOADED_RADIUS: float) -> Array:
    """Return s [m], the arm of FX about the contact centre (4.E76)."""
    c, s = readers(p)
    share = c("SSZ1") + c("SSZ2") * FY / q.F0 + (c("SSZ3") + c("SSZ4") * q.df) * q.g
    return UNLOADED_RADIUS * share * s("LS")


def magic_formula(
    *,
    name: str,
    title: str,
    reference: str,
    valid: str,
    parameters: tuple[GlobalParameter, ...],
    evaluator: Evaluator,
) -> GlobalModel:
    """Return a version as a model over all loads; ``evaluator`` gives the forces of its tire files."""
    return GlobalModel(
        name=name,
        title=title,
        reference=reference,
        valid=valid,
        axes="ISO-W",
        channels=("FX", "FY", "MZ"),
        parameters=parameters,
        forces=_forces(parameters, evaluator),
        starts=_starts,
        bounded=_bounded(parameters),
        factors=_factors(parameters),
    )


def _forces(parameters: Sequence[GlobalParameter], evaluator: Evaluator) -> Any:
    """Return the function ``forces(values, rows)`` of an evaluator of tire files."""
    names = tuple(parameter.name for parameter in parameters)

    def forces(values: Sequence[Any], rows: Rows) -> Responses:
        p: Mapping[str, Any] = dict(zip(names, values, strict=True))
        responses = evaluator(p, _state(rows), UNLOADED_RADIUS=rows.UNLOADED_RADIUS)
        return Responses(FY=responses.FY, MZ=responses.MZ, FX=responses.FX)

    return forces


# name, parameter that has its bounds at the nominal load, text
_FACTORS = """
mu_y PDY1 friction of FY
K_y  PKY1 largest cornering stiffness
L_y  PKY2 load of the largest cornering stiffness
E_y  PEY1 curvature of FY
B_t  QBZ1 slope of the trail
D_t  QDZ1 size of the trail
E_t  QEZ1 curvature of the trail
mu_x PDX1 friction of FX
K_x  PKX1 slip stiffness
E_x  PEX1 curvature of FX
"""


def _bounded(parameters: Sequence[GlobalParameter]) -> tuple[Factor, ...]:
    """Return the factors of FX, FY and MZ that must stay within bounds (Besselink et al. 2010).

    Above 1 the equations take a curvature E for 1 by themselves: it cannot be too large, and a fit may rest
    on that limit at some of its loads.
    """
    by_name = {parameter.name: parameter for parameter in parameters}
    lines = [line.split(maxsplit=2) for line in filter(None, _FACTORS.splitlines())]
    return tuple(
        Factor(
            name=name, stage=by_name[like].stage, low=by_name[like].low, size=by_name[like].size, text=text,
            high=math.inf if name.startswith("E_") else by_name[like].high,
        )
        for name, like, text in lines
    )  # fmt: skip


def _factors(parameters: Sequence[GlobalParameter]) -> Factors:
    """Return the function ``factors(values, rows)`` of a version; 5.2 is 6.1 without pressure."""
    names = tuple(parameter.name for parameter in parameters)

    def factors(values: Sequence[Any], rows: Rows) -> Mapping[str, Any]:
        p: Mapping[str, Any] = dict(zip(names, values, strict=True))
        q, c = _state(rows), readers(p)[0]
        squared, leaned = q.g * q.g, np.abs(q.g)
        return {
            "mu_y": (c("PDY1") + c("PDY2") * q.df) * (1 + c("PPY3") * q.dp + c("PPY4") * q.dp**2)
            * (1 - c("PDY3") * squared),
            "K_y": c("PKY1") * (1 + c("PPY1") * q.dp) * (1 - c("PKY3") * leaned),
            "L_y": (c("PKY2") + c("PKY5") * squared) * (1 + c("PPY2") * q.dp),
            "E_y": (c("PEY1") + c("PEY2") * q.df) * (1 + c("PEY5") * squared),
            "B_t": (c("QBZ1") + c("QBZ2") * q.df + c("QBZ3") * q.df**2)
            * (1 + c("QBZ4") * q.g + c("QBZ5") * leaned),
            "D_t": (c("QDZ1") + c("QDZ2") * q.df) * (1 - c("PPZ1") * q.dp)
            * (1 + c("QDZ3") * q.g + c("QDZ4") * squared),
            "E_t": c("QEZ1") + c("QEZ2") * q.df + c("QEZ3") * q.df * q.df,
            "mu_x": (c("PDX1") + c("PDX2") * q.df) * (1 + c("PPX3") * q.dp + c("PPX4") * q.dp**2)
            * (1 - c("PDX3") * squared),
            "K_x": (c("PKX1") + c("PKX2") * q.df) * np.exp(c("PKX3") * q.df)
            * (1 + c("PPX1") * q.dp + c("PPX2") * q.dp**2),
            "E_x": c("PEX1") + c("PEX2") * q.df + c("PEX3") * q.df**2,
        }  # fmt: skip

    return factors


def _state(rows: Rows) -> State:
    """Return the state of the rows: alpha* = tan(alpha), gamma* = sin(gamma), forward."""
    return state(
        {}, SA=rows.SA, FZ=rows.FZ, FNOMIN=rows.FNOMIN, IA=rows.IA, KAPPA=rows.KAPPA,
        pressure_change=rows.dpi, V=rows.V,
    )  # fmt: skip


def _starts(seeds: Seeds) -> Sequence[Mapping[str, float]]:
    """Return starts: stiffness and friction of each load from the seeds, shape and curvature tried.

    PKY1 enters linearly for each PKY2 and is solved on a grid of PKY2.
    """
    load, F0 = seeds.load, seeds.FNOMIN
    PDY1, PDY2 = seeds.at_nominal(seeds.peak / load)
    best = (np.inf, -20.0, 2.0)
    for PKY2 in np.geomspace(0.3, 12.0, 40) if len(load) > 1 else (2.0,):
        shape = F0 * np.sin(2 * np.arctan(load / F0 / PKY2))
        PKY1 = -float(shape @ seeds.stiffness / (shape @ shape))
        cost = float(np.sum((PKY1 * shape + seeds.stiffness) ** 2))
        best = min(best, (cost, PKY1, float(PKY2)))
    trail = seeds.at_nominal(seeds.trail / load * F0 / 0.3)[0] if np.isfinite(seeds.trail).any() else 0.1
    trail = trail if 0.01 < trail < 0.6 else 0.1
    common = {"PDY1": PDY1, "PDY2": PDY2, "PKY1": best[1], "PKY2": best[2], "QDZ1": trail}
    return [
        {**common, "PCY1": C, "PEY1": E, "QBZ1": B, "QCZ1": Ct, "QEZ1": Et, "PCX1": C + 0.2, "PEX1": E}
        for (C, E), (B, Ct, Et) in product(
            ((1.3, -0.5), (1.5, 0.4), (1.15, -2.5)), ((9.0, 1.2, -1.0), (18.0, 1.1, -3.0))
        )
    ]
