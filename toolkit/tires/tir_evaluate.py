"""Forces and moments of a tire property file at given slips, loads, cambers, pressures; ISO-W, SI."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.errors import FitError, refuse_unknown
from toolkit.findings import Finding
from toolkit.reduction.limits import FRICTION, LARGEST_TRAIL_M, LEAST_LOAD_N
from toolkit.tires.mf import Forces
from toolkit.tires.models import mf52, mf61
from toolkit.tires.slip import ANGLES, Angles, state
from toolkit.tires.tir import TirFile, factors, scale, si_number
from toolkit.tires.tir_checks import RADIUS_M, demanded, file_findings, nominal_pressure

_RANGES = (
    ("SA", "ALPMIN", "ALPMAX", "rad"),
    ("FZ", "FZMIN", "FZMAX", "N"),
    ("IA", "CAMMIN", "CAMMAX", "rad"),
    ("KAPPA", "KPUMIN", "KPUMAX", "1"),
    ("P", "PRESMIN", "PRESMAX", "Pa"),
)
_COMBINED = 4  # the last digit of USE_MODE from which slips are combined; 1 to 3 are pure slips
_SLIGHT = 0.2  # of the load
_EDGE = 1e-6  # of the range: limits are printed with five or six digits


def evaluate_tir(
    tir: TirFile,
    *,
    SA: ArrayLike,
    FZ: ArrayLike,
    IA: ArrayLike = 0.0,
    KAPPA: ArrayLike = 0.0,
    P: ArrayLike | None = None,
    V: ArrayLike | None = None,
    angles: Angles = "star",
) -> tuple[Forces, tuple[Finding, ...]]:
    """Return FX, FY [N], MZ [N·m] in ISO-W, and what should be known about them; arrays broadcast.

    Parameters
    ----------
    SA, IA : slip and inclination angle [rad], ISO-W
    FZ : load [N], not negative
    KAPPA : longitudinal slip [1]
    P : pressure [Pa]; without it the file's INFLPRES, else its NOMPRES
    V : speed [m/s], for its sign and for LMUV; without it the file's LONGVL
    angles : ``star`` for tan(alpha) and sin(gamma), ``raw`` for MF-Tyre's

    Raises
    ------
    ConfigError
        FITTYP is not known, FNOMIN, UNLOADED_RADIUS are missing or not positive, or NOMPRES is negative
    UnitError
        a unit of the file is not known
    FitError
        the result is not finite
    """
    refuse_unknown("kind of angles", angles, ANGLES, where="--angles", rule="unknown-angles")
    version = tir.version
    p = tir.coefficients()
    FNOMIN, radius = demanded(tir, "FNOMIN"), demanded(tir, "UNLOADED_RADIUS")
    speed = si_number(tir, "LONGVL", 0.0) or None
    change, findings = _pressure_change(tir, version, P)
    with np.errstate(all="ignore"):
        responses = forces_of(
            version, p, SA=SA, FZ=FZ, IA=IA, KAPPA=KAPPA, pressure_change=change,
            V=(speed or 1.0) if V is None else V, LONGVL=speed, FNOMIN=FNOMIN, UNLOADED_RADIUS=radius,
            angles=angles,
        )  # fmt: skip
    FX, FY, MZ, _ = np.broadcast_arrays(
        responses.FX, responses.FY, responses.MZ, np.asarray(SA, dtype=np.float64)
    )
    result = Forces(FX=FX, FY=FY, MZ=MZ)
    _refuse_infinite(tir, result)
    inputs = {"SA": SA, "FZ": FZ, "IA": IA, "KAPPA": KAPPA} | ({} if P is None else {"P": P})
    findings += [
        *file_findings(tir), *_beyond(tir, inputs), *_beyond_friction(tir, FZ, result),
        *_beyond_trail(tir, FZ, result, radius), *_combined(tir, SA, KAPPA),
    ]  # fmt: skip
    return result, tuple(findings)


def forces_of(
    version: str,
    p: Mapping[str, float],
    *,
    SA: ArrayLike,
    FZ: ArrayLike,
    IA: ArrayLike,
    KAPPA: ArrayLike,
    pressure_change: ArrayLike,
    V: ArrayLike,
    LONGVL: float | None,
    FNOMIN: float,
    UNLOADED_RADIUS: float,
    angles: Angles = "star",
) -> Forces:
    """Return the forces of coefficients of ``5.2`` or ``6.x``, ISO-W, SI; the whole way from slips to them.

    ``pressure_change`` is (P - NOMPRES) / NOMPRES, ``LONGVL`` None where the file has none.
    """
    q = state(
        p, SA=SA, FZ=FZ, FNOMIN=FNOMIN, IA=IA, KAPPA=KAPPA, pressure_change=pressure_change, V=V,
        V0=LONGVL if version == "6.x" else None, angles=angles,
    )  # fmt: skip
    forces = mf52.forces if version == "5.2" else mf61.forces
    return forces(p, q, UNLOADED_RADIUS=UNLOADED_RADIUS)


def _pressure_change(tir: TirFile, version: str, P: ArrayLike | None) -> tuple[Array | float, list[Finding]]:
    nominal = nominal_pressure(tir)
    if version == "5.2" or nominal is None:
        why = "MF 5.2 has no pressure terms" if version == "5.2" else "the file has no NOMPRES"
        if P is None:
            return 0.0, []
        return 0.0, [_note("tir-no-pressure", tir, f"{why}: the column P changes nothing")]
    if P is not None:
        return np.asarray(P, dtype=np.float64) / nominal - 1, []
    inflation = si_number(tir, "INFLPRES", nominal)
    if inflation <= 0 or inflation == nominal:
        return 0.0, []
    text = f"no column P: the file's INFLPRES of {inflation:.6g} Pa is used, NOMPRES is {nominal:.6g} Pa"
    return inflation / nominal - 1, [_note("tir-pressure", tir, text)]


def _beyond(tir: TirFile, array_likes: Mapping[str, ArrayLike]) -> list[Finding]:
    findings, units = [], factors(tir)
    for channel, low_key, high_key, unit in _RANGES:
        low, high = tir.get(low_key), tir.get(high_key)
        if channel not in array_likes or not isinstance(low, float) or not isinstance(high, float):
            continue
        low, high = low * (scale(low_key, units) or 1.0), high * (scale(high_key, units) or 1.0)
        values = np.asarray(array_likes[channel], dtype=np.float64)
        edge = _EDGE * max(abs(low), abs(high))
        outside = (values < low - edge) | (values > high + edge)
        if outside.any():
            text = (
                f"{channel} from {values.min():.6g} to {values.max():.6g} {unit} leaves the file's range "
                f"{low:.6g} to {high:.6g} {unit} in {int(outside.sum())} of {outside.size} rows: extrapolated"
            )
            findings.append(Finding(rule="tir-range", where=tir.where, message=text))
    return findings


def _combined(tir: TirFile, SA: ArrayLike, KAPPA: ArrayLike) -> list[Finding]:
    """Return a note where both slips are asked of a file that its programs take without combined slip."""
    mode = tir.get("USE_MODE")
    if not isinstance(mode, float) or mode % 10 >= _COMBINED or not np.any(np.multiply(SA, KAPPA)):
        return []
    text = (
        f"the file's USE_MODE is {mode:g}, without combined slip; here slip angle and slip ratio "
        "act together by its coefficients"
    )
    return [_note("tir-use-mode", tir, text)]


def _beyond_friction(tir: TirFile, FZ: ArrayLike, forces: Forces) -> list[Finding]:
    """Return a finding where the file's numbers make more force than any tire has for its load."""
    load = np.broadcast_to(np.asarray(FZ, dtype=np.float64), forces.FY.shape)
    use = np.hypot(forces.FX, forces.FY) / np.maximum(load, LEAST_LOAD_N)
    over = use > FRICTION.high
    if not over.any():
        return []
    text = (
        f"the force in the road's plane is up to {use.max():.3g} times the load, in {int(over.sum())} of "
        f"{over.size} rows; no tire exceeds {FRICTION.high:g}"
    )
    return [Finding(rule="tir-friction", where=tir.where, message=text)]


def _beyond_trail(tir: TirFile, FZ: ArrayLike, forces: Forces, radius: float) -> list[Finding]:
    """Return a finding where the moment has a longer arm than the force could have on any tire.

    The force acts within the contact patch: its arm is shorter than the tire's radius. Near zero slip, where
    there is hardly a force, what the tire's build makes of moment is held against a part of the load.
    """
    low, high = RADIUS_M
    longest = min(LARGEST_TRAIL_M, radius) if low <= radius <= high else LARGEST_TRAIL_M
    load = np.broadcast_to(np.asarray(FZ, dtype=np.float64), forces.MZ.shape)
    force = np.maximum(np.hypot(forces.FX, forces.FY), _SLIGHT * np.maximum(load, LEAST_LOAD_N))
    trail = np.abs(forces.MZ) / force
    over = trail > longest
    if not over.any():
        return []
    text = (
        f"MZ is up to {trail.max():.3g} m times the force in the road's plane, in {int(over.sum())} of "
        f"{over.size} rows; no tire of this radius has a trail of more than {longest:.3g} m"
    )
    return [Finding(rule="tir-trail", where=tir.where, message=text)]


def _refuse_infinite(tir: TirFile, result: Forces) -> None:
    for name in ("FX", "FY", "MZ"):
        bad = np.flatnonzero(~np.isfinite(getattr(result, name)))
        if len(bad):
            raise FitError(
                f"the tire file gives no finite {name}", where=f"{tir.where}, row {bad[0] + 1} of the grid",
                got=f"{len(bad)} rows without a number", expected="finite forces",
                next_step="check that row and the file's coefficients", rule="not-finite",
            )  # fmt: skip


def _note(rule: str, tir: TirFile, message: str) -> Finding:
    return Finding(rule=rule, where=tir.where, message=message, level="note")
