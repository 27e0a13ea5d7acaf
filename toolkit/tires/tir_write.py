"""Tire property files written: a fit of MF 5.2, 6.1 or 6.2, or a file that was read, in SI.

A fit: ISO-W axes, SI, FITTYP 6 or 61, the ranges of the fitted data, scale factors 1. A file that was read
keeps its Magic Formula, its order, its unknown entries, its comments and the rows of its tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from toolkit.errors import ConfigError, refuse_unknown
from toolkit.findings import Finding
from toolkit.publication import write_result
from toolkit.tires.global_data import Measured
from toolkit.tires.global_model import GlobalModel, GlobalParameter, ModelFit
from toolkit.tires.tir import SI, TirFile, TirLine, factors, is_coefficient, scale

FITTYP = {"mf52": 6.0, "mf61": 61.0, "mf62": 61.0}
SIDES = ("LEFT", "RIGHT", "SYMMETRIC", "UNKNOWN")
_SCALES = {
    6.0: "LFZO LCX LMUX LEX LKX LHX LVX LGAX LCY LMUY LEY LKY LHY LVY LGAY LTR LRES LGAZ LXAL LYKA LVYKA LS",
    61.0: "LFZO LCX LMUX LEX LKX LHX LVX LCY LMUY LEY LKY LHY LVY LTR LRES "
    "LXAL LYKA LVYKA LS LKYC LKZC LVMX LMX LMY LMP",
}
_SECTIONS = {"FX": "LONGITUDINAL_COEFFICIENTS", "FY": "LATERAL_COEFFICIENTS", "MZ": "ALIGNING_COEFFICIENTS"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TireFit:
    """What a property file of a fit holds [ISO-W, SI].

    ``coefficients`` by channel (name, value); ``*_range`` smallest and largest of the fitted data;
    ``NOMPRES`` and ``LONGVL`` None where pressure and speed are not known; ``TYRESIDE`` as tested.
    """

    FITTYP: float
    coefficients: tuple[tuple[str, tuple[tuple[str, str | float], ...]], ...]
    FNOMIN: float
    UNLOADED_RADIUS: float
    SA_range: tuple[float, float]
    FZ_range: tuple[float, float]
    IA_range: tuple[float, float]
    KAPPA_range: tuple[float, float] | None = None
    P_range: tuple[float, float] | None = None
    NOMPRES: float | None = None
    LONGVL: float | None = None
    TYRESIDE: str = "UNKNOWN"


def check_side(side: str) -> None:
    """Refuse a side of the tire that no property file has.

    Raises
    ------
    ConfigError
        ``unknown-side``
    """
    refuse_unknown("side of the tire", side, SIDES, where="--side", rule="unknown-side")


def tire_fit(model: GlobalModel, fit: ModelFit, data: Measured, *, side: str = "UNKNOWN") -> TireFit:
    """Return what the property file of a fit holds; channels and slips that were not measured stay out.

    Raises
    ------
    ConfigError
        the model has no property file, the tire's side is none
    """
    if model.name not in FITTYP:
        raise ConfigError(
            f"{model.name} cannot be written to a tire file", where="--tir", got=model.name,
            expected=f"{', '.join(FITTYP)}: the Magic Formulas that .tir files hold",
            next_step="name one of those with --model", rule="tir-needs-global",
        )  # fmt: skip
    check_side(side)
    turned = data.turned("ISO-W").rows
    values = dict(zip(model.names, fit.values.tolist(), strict=True))
    slips = bool(np.ptp(turned.KAPPA))
    sections: list[tuple[str, tuple[tuple[str, str | float], ...]]] = []
    for channel in _SECTIONS:
        if fit.fit(channel) is not None:
            channel_fits = [
                parameter
                for parameter in model.parameters
                if parameter.stage == channel and (slips or not _of_slip(parameter))
            ]
            extra: list[tuple[str, str | float]] = (
                [("PKY4", 2.0)] if channel == "FY" and FITTYP[model.name] > 60 else []
            )
            sections.append(
                (channel, (*((parameter.name, values[parameter.name]) for parameter in channel_fits), *extra))
            )
    return TireFit(
        FITTYP=FITTYP[model.name],
        coefficients=tuple(sections),
        FNOMIN=turned.FNOMIN,
        UNLOADED_RADIUS=turned.UNLOADED_RADIUS,
        SA_range=_range(turned.SA),
        FZ_range=_range(turned.FZ),
        IA_range=_range(turned.IA),
        KAPPA_range=_range(turned.KAPPA) if slips else None,
        P_range=_range(turned.P) if "P" in data.recorded else None,
        NOMPRES=turned.NOMPRES if "P" in data.recorded else None,
        LONGVL=turned.LONGVL if "V" in data.recorded else None,
        TYRESIDE=side,
    )


def _of_slip(parameter: GlobalParameter) -> bool:
    return bool({"kappa", "both_kappas", "alpha_and_kappa"} & set(parameter.needs))


def _range(values: np.ndarray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def tir_text(fit: TireFit, *, comments: Sequence[str] = ()) -> str:
    """Return the property file of a fit; ``comments`` stand at its head."""
    pressures: list[tuple[str, str | float]] = (
        [] if fit.NOMPRES is None else [("INFLPRES", fit.NOMPRES), ("NOMPRES", fit.NOMPRES)]
    )
    model: list[tuple[str, str | float]] = [
        ("PROPERTY_FILE_FORMAT", "USER"),
        ("USE_MODE", 4.0 if fit.KAPPA_range else 2.0),
    ]
    model += [("FITTYP", fit.FITTYP), ("TYRESIDE", fit.TYRESIDE)]
    if fit.LONGVL is not None:
        model.append(("LONGVL", fit.LONGVL))
    sections: list[tuple[str, list[tuple[str, str | float]]]] = [
        ("MDI_HEADER", [("FILE_TYPE", "tir"), ("FILE_VERSION", 3.0), ("FILE_FORMAT", "ASCII")]),
        ("UNITS", [(key, unit) for key, unit in SI.items() if key != "PRESSURE" or fit.NOMPRES is not None]),
        ("MODEL", model),
        ("DIMENSION", [("UNLOADED_RADIUS", fit.UNLOADED_RADIUS)]),
        ("OPERATING_CONDITIONS", pressures),
        ("VERTICAL", [("FNOMIN", fit.FNOMIN)]),
        ("LONG_SLIP_RANGE", _limits("KPU", fit.KAPPA_range)),
        ("SLIP_ANGLE_RANGE", _limits("ALP", fit.SA_range)),
        ("INCLINATION_ANGLE_RANGE", _limits("CAM", fit.IA_range)),
        ("VERTICAL_FORCE_RANGE", _limits("FZ", fit.FZ_range)),
        ("INFLATION_PRESSURE_RANGE", _limits("PRES", fit.P_range)),
        ("SCALING_COEFFICIENTS", [(name, 1.0) for name in _SCALES[fit.FITTYP].split()]),
        *((_SECTIONS[channel], list(entries)) for channel, entries in fit.coefficients),
    ]
    lines = [f"! {comment}" for comment in comments]
    for name, entries in sections:
        if entries:
            lines.append(f"[{name}]")
            lines += [f"{key:<24}= {_shown(value)}" for key, value in entries]
    return "\n".join(lines) + "\n"


def _limits(name: str, limits: tuple[float, float] | None) -> list[tuple[str, str | float]]:
    return [] if limits is None else [(f"{name}MIN", limits[0]), (f"{name}MAX", limits[1])]


def write_tir(path: Path, fit: TireFit, *, comments: Sequence[str] = ()) -> None:
    """Write the property file of a fit, whole or not at all."""
    write_result(path, tir_text(fit, comments=comments))


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
    lines, preserved = [], []
    for line in tir.lines:
        value = line.value
        if line.key and line.section == "UNITS":
            value = SI.get(line.key, value)
        elif isinstance(value, float) and (factor := scale(line.key, units)) is not None:
            value = value * factor
        elif _may_have_a_unit(line):
            preserved.append(line.key or f"a row of [{line.section}]")
        lines.append(TirLine(section=line.section, key=line.key, value=value, text=line.text))
    findings: tuple[Finding, ...] = ()
    if preserved:
        names = ", ".join(dict.fromkeys(preserved))
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
    if line.section in _PURE or line.key == "ASPECT_RATIO" or is_coefficient(line.section, line.key):
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
