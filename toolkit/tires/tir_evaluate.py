"""Forces and moments of a tire property file at given slips, loads, cambers, pressures; ISO-W, SI."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.errors import ConfigError, FitError
from toolkit.findings import Finding
from toolkit.reduction.limits import FRICTION, LEAST_LOAD_N
from toolkit.tires.mf import Forces
from toolkit.tires.models import mf52, mf61
from toolkit.tires.plausibility import LARGEST
from toolkit.tires.slip import ANGLES, Angles, state
from toolkit.tires.tir import TirFile, factors, scale, si_number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

_RANGES = (
    ("SA", "ALPMIN", "ALPMAX", "rad"),
    ("FZ", "FZMIN", "FZMAX", "N"),
    ("IA", "CAMMIN", "CAMMAX", "rad"),
    ("KAPPA", "KPUMIN", "KPUMAX", "1"),
    ("P", "PRESMIN", "PRESMAX", "Pa"),
)
# Without these the Magic Formula gives nothing of that channel.
_MAKES = {
    "FX": ("PCX1", "PDX1", "PKX1"),
    "FY": ("PCY1", "PDY1", "PKY1", "PKY2"),
    "MZ": ("QCZ1", "QDZ1", "QBZ1"),
}
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
        FITTYP is not known, or FNOMIN, UNLOADED_RADIUS are missing or not positive
    UnitError
        a unit of the file is not known
    FitError
        the result is not finite
    """
    if angles not in ANGLES:
        raise ConfigError(
            f"unknown kind of angles {angles!r}", where="--angles", got=angles, expected=", ".join(ANGLES),
            next_step="name one of those expected", rule="unknown-angles",
        )  # fmt: skip
    version = tir.version
    p = tir.coefficients()
    FNOMIN, radius = positive(tir, "FNOMIN"), positive(tir, "UNLOADED_RADIUS")
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
        *tir.findings(), *lacking_findings(tir, p), *_nominal_load(tir, FNOMIN), *_beyond(tir, inputs),
        *_beyond_friction(tir, FZ, result),
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


def positive(tir: TirFile, key: str) -> float:
    """Return an entry in SI; ConfigError where it is absent or not above zero."""
    value = si_number(tir, key)
    if value <= 0:
        raise ConfigError(
            f"the tire file's {key} is not positive", where=tir.where, got=value, expected=f"{key} > 0",
            next_step="correct the entry", rule="tir-number",
        )  # fmt: skip
    return value


def _pressure_change(
    tir: TirFile, version: str, P: ArrayLike | None
) -> tuple[NDArray[np.float64] | float, list[Finding]]:
    nominal = si_number(tir, "NOMPRES", 0.0)
    if version == "5.2" or nominal <= 0:
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


def lacking_findings(tir: TirFile, p: Mapping[str, float]) -> list[Finding]:
    """Return which forces of a file hold nothing, or little, for want of coefficients."""
    findings = []
    for channel, names in _MAKES.items():
        absent = [name for name in names if name not in p]
        if len(absent) == len(names):
            text = f"the file has none of {', '.join(names)}: {channel} holds nothing of pure slip"
            findings.append(_note("tir-no-coefficients", tir, text))
        elif absent:
            text = f"the file has no {', '.join(absent)}, which count as zero: {channel} is doubtful"
            findings.append(Finding(rule="tir-no-coefficients", where=tir.where, message=text))
    return findings


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


def _nominal_load(tir: TirFile, FNOMIN: float) -> list[Finding]:
    """Return a finding where the nominal load is no tire's: kN that count as N, or the reverse."""
    if LEAST_LOAD_N <= FNOMIN <= LARGEST["force"]:
        return []
    text = f"FNOMIN is {FNOMIN:.6g} N by [UNITS]; tires have {LEAST_LOAD_N:g} to {LARGEST['force']:g} N"
    return [Finding(rule="tir-nominal-load", where=tir.where, message=text)]


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
