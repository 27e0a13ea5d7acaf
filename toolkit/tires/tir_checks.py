"""What of a tire file is no tire's: entries in the wrong unit, coefficients that are absent, or impossible.

The entries that the equations divide and multiply by are held against the sizes of tires, and so are the
factors that the coefficients make with their scales at the nominal load: a sign or a decimal that slipped
shows in the factor, whichever of its coefficients it came from.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from toolkit.errors import ConfigError
from toolkit.findings import Finding
from toolkit.reduction.limits import CONDITIONS, FRICTION, LEAST_LOAD_N, STIFFNESS
from toolkit.tires.plausibility import LARGEST
from toolkit.tires.slip import readers
from toolkit.tires.tir import TirFile, factors, si_number

# Without these the Magic Formula gives nothing of that channel.
MAKES = {
    "FX": ("PCX1", "PDX1", "PKX1"),
    "FY": ("PCY1", "PDY1", "PKY1", "PKY2"),
    "MZ": ("QCZ1", "QDZ1", "QBZ1"),
}
RADIUS_M = (0.08, 2.5)
"""Of tires, from those of karts and barrows to those of dumpers, whose diameter is 4 m."""
_LEAST_FRICTION = 0.02  # on wet ice
_LARGEST_SHAPE = 4.0  # C, beyond which a curve turns its sign before 90 deg
_LARGEST_SLIP_STIFFNESS = 150.0  # over load
_LARGEST_TRAIL = 1.0  # over the free radius


def demanded(tir: TirFile, key: str) -> float:
    """Return an entry in SI; ConfigError where it is absent or not above zero."""
    value = si_number(tir, key)
    if value <= 0:
        raise _not_positive(tir, key, value)
    return value


def nominal_pressure(tir: TirFile) -> float | None:
    """Return NOMPRES [Pa]; None where it is absent or zero. ConfigError where it is negative."""
    value = si_number(tir, "NOMPRES", 0.0)
    if value < 0:
        raise _not_positive(tir, "NOMPRES", value)
    return value or None


def file_findings(tir: TirFile) -> list[Finding]:
    """Return what should be known of a file wherever its equations are used.

    Raises
    ------
    ConfigError
        FITTYP is not known, or FNOMIN, UNLOADED_RADIUS are missing or not positive
    """
    p = tir.coefficients()
    return [
        *tir.findings(), *lacking_findings(tir, p), *_sizes(tir), *pressure_findings(tir), *_factors(tir, p)
    ]  # fmt: skip


def pressure_findings(tir: TirFile) -> Iterator[Finding]:
    """Yield where a pressure of the file is no tire's, and that a unit of it follows from force and length.

    The equations see only ratios of pressures, so that a wrong unit shows nowhere else until a pressure is
    given beside the file.
    """
    limits, units = CONDITIONS["P"], factors(tir)
    pressures = {key: value for key in ("NOMPRES", "INFLPRES") if (value := si_number(tir, key, 0.0)) > 0}
    for key, value in pressures.items():
        if not limits.holds(value):
            text = f"{key} is {value:.6g} Pa by [UNITS]; tires have {limits.low:g} to {limits.high:g} kPa"
            yield _finding("tir-nominal-pressure", tir, text)
    if pressures and "PRESSURE" not in tir.section("UNITS") and units["PRESSURE"] != 1.0:
        text = (
            f"[UNITS] has no PRESSURE: a number of {' and '.join(pressures)} is of FORCE / LENGTH^2, "
            f"{units['PRESSURE']:.6g} Pa"
        )
        yield _finding("tir-pressure-unit", tir, text, note=True)


def lacking_findings(tir: TirFile, p: Mapping[str, float]) -> Iterator[Finding]:
    """Yield which forces of a file hold nothing, or little, for want of coefficients; zero is no number."""
    for channel, names in MAKES.items():
        absent = [name for name in names if name not in p]
        zero = [name for name in names if p.get(name) == 0]
        if len(absent) == len(names):
            text = f"the file has none of {', '.join(names)}: {channel} holds nothing of pure slip"
            yield _finding("tir-no-coefficients", tir, text, note=True)
        elif len(absent) + len(zero) == len(names):
            text = f"{', '.join(names)} of the file are absent or zero: {channel} holds nothing of pure slip"
            yield _finding("tir-no-coefficients", tir, text, note=True)
        elif zero:
            named = ", ".join(name for name in names if name in absent or name in zero)
            text = f"of the file {named} {'is' if ', ' not in named else 'are'} zero: {channel} is doubtful"
            yield _finding("tir-no-coefficients", tir, text)
        elif absent:
            text = f"the file has no {', '.join(absent)}, which count as zero: {channel} is doubtful"
            yield _finding("tir-no-coefficients", tir, text)


def _sizes(tir: TirFile) -> Iterator[Finding]:
    """Yield a finding where a nominal entry is no tire's: kN that count as N, mm that count as m."""
    FNOMIN, radius = demanded(tir, "FNOMIN"), demanded(tir, "UNLOADED_RADIUS")
    low, high = LEAST_LOAD_N, LARGEST["force"]
    if not low <= FNOMIN <= high:
        text = f"FNOMIN is {FNOMIN:.6g} N by [UNITS]; tires have {low:g} to {high:g} N"
        yield _finding("tir-nominal-load", tir, text)
    low, high = RADIUS_M
    if not low <= radius <= high:
        text = f"UNLOADED_RADIUS is {radius:.6g} m by [UNITS]; tires have {low:g} to {high:g} m"
        yield _finding("tir-free-radius", tir, text)


def _factors(tir: TirFile, p: Mapping[str, float]) -> Iterator[Finding]:
    """Yield the factors at the nominal load, upright and at the nominal pressure, that no tire has.

    Factors of a coefficient that is absent or zero are told by that.
    """
    c, s = readers(p)
    df = (1 - s("LFZO")) / (s("LFZO") or math.inf)  # FNOMIN over the nominal load that the equations take
    friction, shape = (_LEAST_FRICTION, FRICTION.high), (0.0, _LARGEST_SHAPE)
    stiffness = _cornering(tir, p)
    rows = (
        ("mu_x", "PDX1", _peak(c("PDX1"), c("PDX2"), df) * s("LMUX"), friction, "friction of FX"),
        ("mu_y", "PDY1", _peak(c("PDY1"), c("PDY2"), df) * s("LMUY"), friction, "friction of FY"),
        ("C_x", "PCX1", c("PCX1") * s("LCX"), shape, "shape of FX"),
        ("C_y", "PCY1", c("PCY1") * s("LCY"), shape, "shape of FY"),
        ("C_t", "QCZ1", c("QCZ1"), shape, "shape of the trail"),
        ("K_x", "PKX1", (c("PKX1") + c("PKX2") * df) * math.exp(min(c("PKX3") * df, 700.0)) * s("LKX"),
         (0.0, _LARGEST_SLIP_STIFFNESS), "slip stiffness over load"),
        ("-K_y", "PKY1", stiffness, (STIFFNESS.low, STIFFNESS.high), "cornering stiffness over load"),
        ("D_t", "QDZ1", (c("QDZ1") + c("QDZ2") * df) * s("LTR"), (0.0, _LARGEST_TRAIL),
         "trail over the free radius"),
        ("B_t", "QBZ1", (c("QBZ1") + c("QBZ2") * df + c("QBZ3") * df * df) * s("LKY"), (0.0, math.inf),
         "slope of the trail"),
    )  # fmt: skip
    for name, of, value, (low, high), text in rows:
        lacking = p.get(of, 0.0) == 0 or (of == "PKY1" and p.get("PKY2", 0.0) == 0)
        if lacking or (low < value <= high if low == 0 else low <= value <= high):
            continue
        bound = "more than 0" if math.isinf(high) else f"{low:g} to {high:g}"
        message = (
            f"at the nominal load the coefficients give {name} = {value:.4g}, the {text}; tires have {bound}"
        )
        yield _finding("tir-factors", tir, message)


def _peak(at_nominal: float, change: float, df: float) -> float:
    """Return the friction at a load ``df`` from the nominal one, positive in files that write it negative.

    The sign of D = mu FZ is that of B = K / (C D) and drops out of D sin(C atan(B x)): some programs write
    PDY1 below zero beside a PKY1 below zero. Its change with load then has the other sign too, since
    friction falls with load; where it has not, the sign is a slip of the pen.

    >>> _peak(0.9, -0.18, 0.5), _peak(-0.9, 0.18, 0.5), _peak(-0.9, -0.18, 0.5)
    (0.81, 0.81, -0.99)
    """
    value = at_nominal + change * df
    return -value if at_nominal < 0 <= change else value


def _cornering(tir: TirFile, p: Mapping[str, float]) -> float:
    """Return the cornering stiffness over the nominal load [1/rad], positive as tires have it."""
    c, s = readers(p)
    F0 = s("LFZO")
    over = c("PKY2") * F0
    turns = p.get("PKY4", 2.0) if tir.version == "6.x" else 2.0
    return -c("PKY1") * F0 * math.sin(turns * math.atan(1 / over if over else math.inf)) * s("LKY")


def _finding(rule: str, tir: TirFile, message: str, *, note: bool = False) -> Finding:
    return Finding(rule=rule, where=tir.where, message=message, level="note" if note else "warning")


def _not_positive(tir: TirFile, key: str, value: float) -> ConfigError:
    return ConfigError(
        f"the tire file's {key} is not positive", where=tir.where, got=value, expected=f"{key} > 0",
        next_step="correct the entry", rule="tir-number",
    )  # fmt: skip
