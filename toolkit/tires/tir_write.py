"""Tire property files written: a fit of MF 6.1, or a file that was read, in SI.

A fit: ISO-W axes, SI, FITTYP 61, the ranges of the fitted data, scale factors 1. A file that was read keeps
its Magic Formula, its order, its unknown entries, its comments and the rows of its tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from toolkit.files import write_atomic
from toolkit.findings import Finding
from toolkit.tires.mf61 import ALIGNING, LATERAL
from toolkit.tires.mf61_fit import TireFit
from toolkit.tires.tir import TirFile, TirLine
from toolkit.tires.tir_units import SI, factors, scale

_SCALES = tuple(
    "LFZO LCX LMUX LEX LKX LHX LVX LCY LMUY LEY LKY LHY LVY LTR LRES "
    "LXAL LYKA LVYKA LS LKYC LKZC LVMX LMX LMY LMP".split()
)


def tir_text(fit: TireFit, *, comments: Sequence[str] = (), side: str = "LEFT") -> str:
    """Return the property file of a fit; ``comments`` stand at its head, ``side`` is TYRESIDE as tested."""
    given = dict(fit.coefficients)
    sections: list[tuple[str, list[tuple[str, str | float]]]] = [
        ("MDI_HEADER", [("FILE_TYPE", "tir"), ("FILE_VERSION", 3.0), ("FILE_FORMAT", "ASCII")]),
        (
            "UNITS",
            [
                ("LENGTH", "meter"),
                ("FORCE", "newton"),
                ("ANGLE", "radians"),
                ("MASS", "kg"),
                ("TIME", "second"),
            ],
        ),
        (
            "MODEL",
            [("PROPERTY_FILE_FORMAT", "USER"), ("USE_MODE", 2.0), ("FITTYP", 61.0), ("TYRESIDE", side)],
        ),
        ("DIMENSION", [("UNLOADED_RADIUS", fit.UNLOADED_RADIUS)]),
        ("VERTICAL", [("FNOMIN", fit.FNOMIN)]),
        ("SLIP_ANGLE_RANGE", [("ALPMIN", fit.SA_range[0]), ("ALPMAX", fit.SA_range[1])]),
        ("INCLINATION_ANGLE_RANGE", [("CAMMIN", 0.0), ("CAMMAX", 0.0)]),
        ("VERTICAL_FORCE_RANGE", [("FZMIN", fit.FZ_range[0]), ("FZMAX", fit.FZ_range[1])]),
        ("SCALING_COEFFICIENTS", [(name, 1.0) for name in _SCALES]),
        ("LATERAL_COEFFICIENTS", [(n, given.get(n, 2.0 if n == "PKY4" else 0.0)) for n in LATERAL]),
        ("ALIGNING_COEFFICIENTS", [(name, given.get(name, 0.0)) for name in ALIGNING]),
    ]
    lines = [f"! {comment}" for comment in comments]
    for name, entries in sections:
        lines.append(f"[{name}]")
        lines += [f"{key:<24}= {_shown(value)}" for key, value in entries]
    return "\n".join(lines) + "\n"


def write_tir(path: Path, fit: TireFit, *, comments: Sequence[str] = (), side: str = "LEFT") -> None:
    """Write the property file of a fit, whole or not at all."""
    write_atomic(path, tir_text(fit, comments=comments, side=side))


def file_text(tir: TirFile) -> str:
    """Return the text of a property file as it is; reading it gives the same lines again."""
    return "\n".join(_line(line) for line in tir.lines) + "\n"


def in_si(tir: TirFile) -> tuple[TirFile, tuple[Finding, ...]]:
    """Return the file with its dimensional entries in SI, and what kept its number in another unit.

    Raises
    ------
    UnitError
        a unit of the file is not known
    """
    units = factors(tir)
    if all(factor == 1.0 for factor in units.values()):
        return tir, ()
    lines, kept = [], []
    for line in tir.lines:
        value = line.value
        if line.key and line.section == "UNITS":
            value = SI.get(line.key, value)
        elif isinstance(value, float) and (factor := scale(line.key, units)) is not None:
            value = value * factor
        elif _may_have_a_unit(line):
            kept.append(line.key or f"a row of [{line.section}]")
        lines.append(TirLine(section=line.section, key=line.key, value=value, text=line.text))
    findings: tuple[Finding, ...] = ()
    if kept:
        names = ", ".join(dict.fromkeys(kept))
        findings = (
            Finding(
                rule="tir-unit-kept",
                where=tir.where,
                message=f"no dimension is known for {names}: the number is as it was, in the old units",
            ),
        )
    return TirFile(lines=tuple(lines), where=tir.where), findings


_PURE = ("MODEL", "MDI_HEADER", "SHAPE", "LONG_SLIP_RANGE")


def _may_have_a_unit(line: TirLine) -> bool:
    if line.section.endswith("COEFFICIENTS") or line.section in _PURE or line.key == "ASPECT_RATIO":
        return False
    if line.key:
        return isinstance(line.value, float)
    return line.text.strip()[:1].isdigit() or line.text.strip()[:1] in ("-", "+", ".")


def _line(line: TirLine) -> str:
    if not line.key:
        return line.text
    return f"{line.key:<24}= {_shown(line.value)}" + (f"  {line.text}" if line.text else "")


def _shown(value: str | float) -> str:
    # repr gives the shortest digits that read back to the same number.
    if isinstance(value, str):
        return f'"{value}"' if "'" in value else f"'{value}'"
    return repr(int(value) if value.is_integer() and abs(value) < 1e15 else value)
