"""Tables of tires whose truth is known: Magic Formula 6.1 written a second time, from the book's equations.

Pacejka, Tire and Vehicle Dynamics, 3rd ed. (2012), 4.E1 to 4.E78, all scale factors one, no turn slip; ISO-W,
SI. It shares no line with the models that are fitted to its tables.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

Columns = dict[str, np.ndarray]

CAR = {
    "F0": 4000.0, "R0": 0.32, "P0": 220e3,
    "PCX1": 1.6, "PDX1": 1.15, "PDX2": -0.08, "PEX1": 0.1, "PEX2": 0.2, "PKX1": 22.0,
    "PKX2": 0.4, "PKX3": -0.2,
    "PCY1": 1.35, "PDY1": 1.0, "PDY2": -0.15, "PDY3": 1.5, "PEY1": -0.8, "PEY2": -0.4, "PEY3": 0.05,
    "PKY1": -22.0, "PKY2": 1.9, "PKY3": 0.3, "PKY4": 2.0, "PKY6": -0.9, "PKY7": -0.2,
    "PHY1": 0.002, "PHY2": 0.001, "PVY1": 0.015, "PVY2": -0.01, "PVY3": -0.2, "PVY4": -0.1,
    "PPY1": 0.4, "PPY2": 0.9, "PPY3": -0.15, "PPY5": 0.1,
    "QBZ1": 9.0, "QBZ2": -1.5, "QBZ10": 0.6, "QCZ1": 1.15, "QDZ1": 0.11, "QDZ2": -0.005, "QDZ6": 0.002,
    "QDZ8": -0.05, "QEZ1": -1.2, "QEZ2": 0.3, "QHZ1": 0.001, "PPZ1": -0.2,
    "RBX1": 13.0, "RBX2": 10.0, "RCX1": 1.0, "RBY1": 11.0, "RBY2": 8.0, "RBY3": 0.0, "RCY1": 1.0,
    "REY1": -0.3,
    "RHY1": 0.0, "RVY1": 0.05, "RVY4": 12.0, "RVY5": 1.9, "RVY6": -10.0, "SSZ2": 0.02,
}  # fmt: skip
"""A car tire of made-up numbers of the common size."""


def forces(
    numbers: Mapping[str, float],
    *,
    SA: np.ndarray,
    FZ: np.ndarray,
    IA: np.ndarray | float = 0.0,
    KAPPA: np.ndarray | float = 0.0,
    P: np.ndarray | float | None = None,
) -> Columns:
    """Return FX, FY [N], MZ [N·m] in ISO-W at slip angle, inclination [rad], load [N], pressure [Pa]."""
    p = defaultdict(float, numbers)
    F0, R0 = p["F0"], p["R0"]
    df, dp = FZ / F0 - 1, (0.0 if P is None else np.asarray(P) / p["P0"] - 1)
    a, g, k = np.tan(SA), np.sin(IA), np.asarray(KAPPA, dtype=float)

    # 4.E9 to 4.E18
    kx = k + p["PHX1"] + p["PHX2"] * df
    mux = (p["PDX1"] + p["PDX2"] * df) * (1 + p["PPX3"] * dp + p["PPX4"] * dp**2) * (1 - p["PDX3"] * g**2)
    Ex = (p["PEX1"] + p["PEX2"] * df + p["PEX3"] * df**2) * (1 - p["PEX4"] * np.sign(kx))
    Kx = FZ * (p["PKX1"] + p["PKX2"] * df) * np.exp(p["PKX3"] * df) * (1 + p["PPX1"] * dp + p["PPX2"] * dp**2)
    FX0 = _curve(p["PCX1"], mux * FZ, Kx, Ex, kx) + FZ * (p["PVX1"] + p["PVX2"] * df)

    def side(g: np.ndarray | float) -> tuple[np.ndarray, ...]:
        # 4.E19 to 4.E30
        stiff = p["PKY1"] * F0 * (1 + p["PPY1"] * dp) * (1 - p["PKY3"] * np.abs(g))
        soft = (p["PKY2"] + p["PKY5"] * g**2) * (1 + p["PPY2"] * dp) * F0
        Ky = stiff * np.sin(p["PKY4"] * np.arctan(FZ / soft))
        Svg = FZ * (p["PVY3"] + p["PVY4"] * df) * g
        Kg = FZ * (p["PKY6"] + p["PKY7"] * df) * (1 + p["PPY5"] * dp)
        Sh = p["PHY1"] + p["PHY2"] * df + (Kg * g - Svg) / Ky
        Sv = FZ * (p["PVY1"] + p["PVY2"] * df) + Svg
        x = a + Sh
        mu = (p["PDY1"] + p["PDY2"] * df) * (1 + p["PPY3"] * dp + p["PPY4"] * dp**2) * (1 - p["PDY3"] * g**2)
        bend = 1 + p["PEY5"] * g**2 - (p["PEY3"] + p["PEY4"] * g) * np.sign(x)
        Ey = (p["PEY1"] + p["PEY2"] * df) * bend
        return _curve(p["PCY1"], mu * FZ, Ky, Ey, x) + Sv, Ky, mu, Sh + Sv / Ky, Ky / (mu * FZ)

    FY0, Ky, muy, shift, BC = side(g)
    # 4.E50 to 4.E67
    Bx = (p["RBX1"] + p["RBX3"] * g**2) * np.cos(np.arctan(p["RBX2"] * k))
    FX = FX0 * _weight(Bx, p["RCX1"], p["REX1"] + p["REX2"] * df, a, p["RHX1"])

    def weight_y(g: np.ndarray | float) -> np.ndarray:
        By = (p["RBY1"] + p["RBY4"] * g**2) * np.cos(np.arctan(p["RBY2"] * (a - p["RBY3"])))
        return _weight(By, p["RCY1"], p["REY1"] + p["REY2"] * df, k, p["RHY1"] + p["RHY2"] * df)

    DV = muy * FZ * (p["RVY1"] + p["RVY2"] * df + p["RVY3"] * g) * np.cos(np.arctan(p["RVY4"] * a))
    FY = weight_y(g) * FY0 + DV * np.sin(p["RVY5"] * np.arctan(p["RVY6"] * k))
    upright = weight_y(0.0) * side(0.0)[0]

    # 4.E31 to 4.E49, 4.E71 to 4.E78
    at = a + p["QHZ1"] + p["QHZ2"] * df + (p["QHZ3"] + p["QHZ4"] * df) * g
    Bt = (p["QBZ1"] + p["QBZ2"] * df + p["QBZ3"] * df**2) * (1 + p["QBZ4"] * g + p["QBZ5"] * np.abs(g))
    Dt = FZ * R0 / F0 * (p["QDZ1"] + p["QDZ2"] * df) * (1 - p["PPZ1"] * dp)
    Dt = Dt * (1 + p["QDZ3"] * g + p["QDZ4"] * g**2)
    Et = (p["QEZ1"] + p["QEZ2"] * df + p["QEZ3"] * df**2) * (
        1 + (p["QEZ4"] + p["QEZ5"] * g) * 2 / np.pi * np.arctan(Bt * p["QCZ1"] * at)
    )
    both = (Kx / Ky) * k
    z = Bt * _joined(at, both)
    trail = Dt * np.cos(p["QCZ1"] * np.arctan(z - Et * (z - np.arctan(z)))) * np.cos(SA)
    Br = p["QBZ9"] + p["QBZ10"] * BC
    leaned = (p["QDZ8"] + p["QDZ9"] * df) * (1 + p["PPZ2"] * dp) + (p["QDZ10"] + p["QDZ11"] * df) * np.abs(g)
    Dr = FZ * R0 * (p["QDZ6"] + p["QDZ7"] * df + leaned * g)
    residual = Dr * np.cos(np.arctan(Br * _joined(a + shift, both))) * np.cos(SA)
    arm = R0 * (p["SSZ1"] + p["SSZ2"] * FY / F0 + (p["SSZ3"] + p["SSZ4"] * df) * g)
    return {"FX": FX, "FY": FY, "MZ": -trail * upright + residual + arm * FX}


def _curve(C: float, D: np.ndarray, K: np.ndarray, E: np.ndarray, x: np.ndarray) -> np.ndarray:
    B = K / (C * D)
    E = np.minimum(E, 1.0)
    return D * np.sin(C * np.arctan(B * x - E * (B * x - np.arctan(B * x))))


def _weight(B: np.ndarray, C: float, E: np.ndarray, x: np.ndarray, shift: np.ndarray | float) -> np.ndarray:
    def cosine(x: np.ndarray) -> np.ndarray:
        return np.cos(C * np.arctan(B * x - E * (B * x - np.arctan(B * x))))

    return cosine(x + shift) / cosine(np.zeros_like(x) + shift)


def _joined(angle: np.ndarray, both: np.ndarray) -> np.ndarray:
    return np.where(angle < 0, -1, 1) * np.arctan(np.hypot(np.tan(angle), both))


def cornering_stiffness(numbers: Mapping[str, float], load: float, **conditions: float) -> float:
    """Return -dFY/dSA at SA = 0 [N/rad] by a difference."""
    h = 1e-5
    FY = forces(numbers, SA=np.array([-h, h]), FZ=np.full(2, load), **conditions)["FY"]
    return float((FY[0] - FY[1]) / (2 * h))


def crossed(**levels: Iterable[float]) -> Columns:
    """Return columns in which every level of each meets every level of the others; the last changes first."""
    grids = np.meshgrid(*(np.asarray(list(values), dtype=float) for values in levels.values()), indexing="ij")
    return {name: grid.ravel() for name, grid in zip(levels, grids, strict=True)}


def measured(
    numbers: Mapping[str, float],
    columns: Columns,
    *,
    noise: float = 0.0,
    channels: tuple[str, ...] = ("FY", "MZ"),
    seed: int = 1,
) -> Columns:
    """Return columns [SI] with forces in ISO-W; ``noise`` is the sd as a part of a channel's largest."""
    rng = np.random.default_rng(seed)
    inputs = {name: columns[name] for name in ("SA", "FZ", "IA", "KAPPA", "P") if name in columns}
    made = forces(numbers, **inputs)
    noisy = {
        name: made[name] + rng.normal(0.0, noise * np.abs(made[name]).max(), len(made[name]))
        for name in channels
    }
    return columns | noisy


_UNITS = {
    "SA": ("deg", np.pi / 180), "IA": ("deg", np.pi / 180), "FZ": ("N", 1.0), "FX": ("N", 1.0),
    "FY": ("N", 1.0), "MZ": ("N*m", 1.0), "KAPPA": ("1", 1.0), "P": ("kPa", 1e3), "V": ("km/h", 1 / 3.6),
    "t": ("s", 1.0),
}  # fmt: skip


def write_table(
    path: Path, columns: Columns, *, units: Mapping[str, tuple[str, float]] | None = None
) -> Path:
    """Write columns [SI] as a table, each in its unit (text, SI value of one); return its path."""
    shown = {**_UNITS, **(units or {})}
    header = ",".join(f"{name} [{shown[name][0]}]" for name in columns)
    rows = zip(*(column / shown[name][1] for name, column in columns.items()), strict=True)
    lines = [",".join(f"{value:.6g}" for value in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")
    return path
