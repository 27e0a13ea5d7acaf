"""Steady tires, twice: a Magic Formula written from its papers, and a brush of discrete bristles.

Both answer in SAE axes for arrays: slip angle [rad], load [N] to lateral force [N] and aligning moment [N·m].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from proof.model import Array

NOMINAL_PRESSURE = 220.0  # kPa


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Factors on friction, cornering stiffness and trail; numbers or arrays of the signals' length."""

    mu: Array | float = 1.0
    stiffness: Array | float = 1.0
    trail: Array | float = 1.0
    pressure: Array | float = NOMINAL_PRESSURE
    """Inflation pressure [kPa]."""
    camber: float = 0.0
    """Inclination [rad], positive towards the vehicle's right, of a drum that turns forward."""


@dataclass(frozen=True, slots=True)
class MagicFormulaTire:
    """Pure slip. MF 5.2: Pacejka (2006) eqs 4.E19-4.E49; 6.1: Besselink, Schmeitz, Pacejka (2010).

    Camber as 5.2 has it, in the terms PHY3, PVY3, PVY4 and QHZ3, whose coefficients few files lack.
    """

    c: Mapping[str, float]

    @property
    def nominal_load(self) -> float:
        """Return FNOMIN [N]."""
        return self.c["FNOMIN"]

    def forces(self, slip: Array, load: Array, s: Scales) -> tuple[Array, Array]:
        """Return FY [N] and MZ [N·m] in SAE axes: the file is ISO-W, so the odd parts keep their signs."""
        c = self.c
        F0 = c["FNOMIN"]
        Fz = np.maximum(load, 1e-9)
        df = (Fz - F0) / F0
        dp = (np.asarray(s.pressure) - NOMINAL_PRESSURE) / NOMINAL_PRESSURE
        a = np.tan(-slip)  # ISO-W slip angle
        K = c["PKY1"] * F0 * (1 + c.get("PPY1", 0.0) * dp)
        K = K * np.sin(2 * np.arctan(Fz / (c["PKY2"] * F0 * (1 + c.get("PPY2", 0.0) * dp)))) * s.stiffness
        mu = (c["PDY1"] + c["PDY2"] * df) * (1 + c.get("PPY3", 0.0) * dp) * s.mu
        D, C, lean = mu * Fz, c["PCY1"], np.sin(s.camber)  # 4.E4
        x = a + c["PHY1"] + c["PHY2"] * df + c.get("PHY3", 0.0) * lean
        E = np.minimum((c["PEY1"] + c["PEY2"] * df) * (1 - c["PEY3"] * np.sign(x)), 1.0)
        B = K / (C * D)
        Fy = D * np.sin(C * np.arctan(B * x - E * (B * x - np.arctan(B * x))))
        thrust = (c.get("PVY3", 0.0) + c.get("PVY4", 0.0) * df) * lean
        Fy = Fy + Fz * (c["PVY1"] + c["PVY2"] * df + thrust) * s.mu
        xt = a + c["QHZ1"] + c["QHZ2"] * df + c.get("QHZ3", 0.0) * lean
        Bt = (c["QBZ1"] + c["QBZ2"] * df) * s.stiffness / s.mu
        Ct = c["QCZ1"]
        Dt = Fz * (c["R0"] / F0) * (c["QDZ1"] + c["QDZ2"] * df) * (1 - c.get("PPZ1", 0.0) * dp) * s.trail
        Et = np.minimum(c["QEZ1"] + c["QEZ2"] * df, 1.0)
        trail = Dt * np.cos(Ct * np.arctan(Bt * xt - Et * (Bt * xt - np.arctan(Bt * xt)))) * np.cos(slip)
        return -Fy, trail * Fy  # MZ_iso = -t Fy_iso; SAE turns both signs


@dataclass(frozen=True, slots=True)
class BristleTire:
    """Quasi-static bristles over a parabolic pressure, summed bristle by bristle (Pacejka 2012, sec. 3.2)."""

    c: Mapping[str, float]
    bristles: int = 240

    @property
    def nominal_load(self) -> float:
        """Return the load at which the half length is a0 [N]."""
        return self.c["FZ0"]

    def forces(self, slip: Array, load: Array, s: Scales) -> tuple[Array, Array]:
        """Return FY [N] and MZ [N·m] in SAE axes."""
        c = self.c
        Fz = np.maximum(np.asarray(load, float), 1e-6)
        mu = c["mu"] * (1 - c["mu_load"] * (Fz / c["FZ0"] - 1)) * s.mu
        a = c["a0"] * np.sqrt(Fz / c["FZ0"])
        sigma = np.tan(slip)
        u = (np.arange(self.bristles) + 0.5) / self.bristles * 2 - 1  # -1 trailing, +1 leading edge
        reach = (c["cp"] * s.stiffness * a * np.abs(sigma))[:, None] * (1 - u)[None, :]  # adhesion [N/m]
        limit = (mu * Fz / a)[:, None] * (0.75 * (1 - u**2))[None, :]
        q = np.minimum(reach, limit)
        width = 2 * a / self.bristles
        force = q.sum(axis=1) * width * np.sign(sigma)
        moment = -(q * u).sum(axis=1) * width * a * np.sign(sigma)
        return -force, c["trail"] * s.trail * moment


def cornering_stiffness(tire: MagicFormulaTire | BristleTire, load: float) -> float:
    """Return -dFY/dSA at zero slip [N/rad]."""
    h = 1e-4
    fy, _ = tire.forces(np.array([-h, h]), np.full(2, load), Scales())
    return float(-(fy[1] - fy[0]) / (2 * h))


def slope_table(tire: MagicFormulaTire | BristleTire, points: int = 200) -> tuple[float, Array]:
    """Return the step in |SA| [rad] and the slope at nominal load over the slope at zero."""
    step = np.radians(14.0) / points
    grid = np.arange(points + 2) * step
    fy, _ = tire.forces(grid, np.full(grid.size, tire.nominal_load), Scales())
    slope = np.maximum(-np.diff(fy) / step, 0.0)
    return float(step), np.asarray(slope / slope[0])


def draw_magic_formula(
    rng: np.random.Generator, *, pressure: bool, camber: bool = False, symmetric: bool = False
) -> MagicFormulaTire:
    """Return coefficients of a passenger-car tire, each moved by some per cent.

    `symmetric`: no shifts; such a tire is the same when it is turned round on its hub.
    """
    near = lambda value, share=0.1: float(value * rng.uniform(1 - share, 1 + share))  # noqa: E731
    c = {
        "FNOMIN": 4000.0, "R0": 0.313, "PCY1": near(1.35, 0.05), "PDY1": near(0.95), "PDY2": near(-0.12),
        "PEY1": near(-0.9, 0.3), "PEY2": near(-0.35, 0.3), "PEY3": 0.0, "PKY1": near(-15.5),
        "PKY2": near(1.6), "PHY1": near(0.002, 0.5), "PHY2": near(0.0005, 0.5), "PVY1": near(0.012, 0.5),
        "PVY2": near(-0.006, 0.5), "QBZ1": near(8.5), "QBZ2": near(-1.5), "QCZ1": near(1.15, 0.04),
        "QDZ1": near(0.092), "QDZ2": near(-0.004), "QEZ1": near(-1.6, 0.2), "QEZ2": near(0.4),
        "QHZ1": near(0.003, 0.5), "QHZ2": near(0.0005, 0.5),
    }  # fmt: skip
    if pressure:
        c |= {"PPY1": near(-0.45), "PPY2": near(0.9), "PPY3": near(-0.15), "PPZ1": near(-0.35)}
    if symmetric:
        c |= dict.fromkeys(("PHY1", "PHY2", "PVY1", "PVY2", "QHZ1", "QHZ2"), 0.0)
    if camber:  # about 55 N/deg at nominal load, towards the side to which the wheel leans
        c |= {"PHY3": near(0.03), "PVY3": near(-0.35), "PVY4": near(0.04), "QHZ3": near(0.1)}
    return MagicFormulaTire(c)


def draw_brush(rng: np.random.Generator) -> BristleTire:
    """Return a brush of passenger-car size."""
    near = lambda value, share=0.1: float(value * rng.uniform(1 - share, 1 + share))  # noqa: E731
    return BristleTire({
        "FZ0": 4000.0, "mu": near(0.95), "mu_load": near(0.1), "a0": near(0.06), "cp": near(7.5e6),
        "trail": near(1.0),
    })  # fmt: skip


def tir_text(tire: MagicFormulaTire, *, fittyp: int) -> str:
    """Return the tire property file of the coefficients, ISO-W and SI."""
    c = dict(tire.c)
    lines = [
        "[MDI_HEADER]", "FILE_TYPE = 'tir'", "FILE_VERSION = 3.0", "FILE_FORMAT = 'ASCII'",
        "[UNITS]", "LENGTH = 'meter'", "FORCE = 'newton'", "ANGLE = 'radians'", "MASS = 'kg'",
        "TIME = 'second'", "PRESSURE = 'pascal'",
        "[MODEL]", f"FITTYP = {fittyp}", "TYRESIDE = 'Left'", "LONGVL = 2.128",
        "[DIMENSION]", f"UNLOADED_RADIUS = {c.pop('R0')!r}", "WIDTH = 0.205", "ASPECT_RATIO = 0.55",
        "RIM_RADIUS = 0.2032", "RIM_WIDTH = 0.1651",
    ]  # fmt: skip
    if fittyp >= 60:
        lines += ["[OPERATING_CONDITIONS]", f"INFLPRES = {NOMINAL_PRESSURE * 1e3}"]
        lines += [f"NOMPRES = {NOMINAL_PRESSURE * 1e3}"]
    lines += ["[VERTICAL]", f"FNOMIN = {c.pop('FNOMIN')!r}", "VERTICAL_STIFFNESS = 200000.0"]
    lines += ["[VERTICAL_FORCE_RANGE]", "FZMIN = 100", "FZMAX = 9000"]
    lines += ["[SLIP_ANGLE_RANGE]", "ALPMIN = -0.3", "ALPMAX = 0.3"]
    lines += ["[SCALING_COEFFICIENTS]", *(f"{k} = 1" for k in ("LFZO", "LMUY", "LKY", "LTR"))]
    for title, first in (("[LATERAL_COEFFICIENTS]", "P"), ("[ALIGNING_COEFFICIENTS]", "Q")):
        lines.append(title)
        lines += [f"{k} = {c.pop(k)!r}" for k in list(c) if k[0] == first and k != "PPZ1"]
    lines += [f"{k} = {v!r}" for k, v in c.items()]
    return "\n".join(lines) + "\n"
