"""Tire property files (.tir): sections of NAME = VALUE, units in [UNITS]; written for MF 6.1.

What is written: ISO-W axes, SI, FITTYP 61, the ranges of the fitted data, scale factors 1.
What is read: any section and key, in their order, comments dropped; an unknown key is kept.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import ConfigError, UnreadableError
from toolkit.files import write_atomic
from toolkit.tires.mf61 import ALIGNING, LATERAL
from toolkit.tires.mf61_fit import TireFit

# What other programs write: 5, 6, 21 and 52 are MF 5.2, 60 to 62 are MF 6.x.
_MF52, _MF6 = (5, 6, 21, 52), (60, 61, 62)
_SCALES = tuple(
    "LFZO LCX LMUX LEX LKX LHX LVX LCY LMUY LEY LKY LHY LVY LTR LRES "
    "LXAL LYKA LVYKA LS LKYC LKZC LVMX LMX LMY LMP".split()
)
_LINE = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\s*=\s*('[^']*'|\"[^\"]*\"|[^$!]*)")


@dataclass(frozen=True, slots=True, kw_only=True)
class TirFile:
    """A property file: ``sections`` as (name, ((key, value), ...)), values as text or number as written."""

    sections: tuple[tuple[str, tuple[tuple[str, str | float], ...]], ...]

    def section(self, name: str) -> dict[str, str | float]:
        """Return a section's entries, empty where there is none."""
        for one, entries in self.sections:
            if one == name:
                return dict(entries)
        return {}

    def get(self, key: str) -> str | float | None:
        """Return the first value of a key in any section, None where it is absent."""
        for _, entries in self.sections:
            for name, value in entries:
                if name == key:
                    return value
        return None

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number.

        Raises
        ------
        ConfigError
            the key is absent and has no default, or is no number
        """
        value = self.get(key)
        if value is None and default is not None:
            return default
        if not isinstance(value, float):
            raise ConfigError(
                f"the tire file has no number {key}", got=value, expected=f"{key} = NUMBER",
                next_step="add the entry to the tire file", rule="tir-missing-key",
            )  # fmt: skip
        return value

    @property
    def version(self) -> str:
        """The Magic Formula of the file: ``5.2`` or ``6.x``.

        Raises
        ------
        ConfigError
            FITTYP is none of 5, 6, 21, 52, 60, 61, 62
        """
        fittyp = self.get("FITTYP")
        known_format = self.get("PROPERTY_FILE_FORMAT") in ("PAC2002", "MF_05")
        if fittyp in _MF52 or (fittyp is None and known_format):
            return "5.2"
        if fittyp in _MF6:
            return "6.x"
        raise ConfigError(
            "the tire file's kind of Magic Formula is not known",
            got=f"FITTYP = {fittyp}",
            expected="5, 6, 21 or 52 for MF 5.2; 60, 61 or 62 for MF 6.x",
            next_step="correct FITTYP in [MODEL]",
            rule="tir-fittyp",
        )

    def coefficients(self) -> dict[str, float]:
        """Return every number of the coefficient and scaling sections by its name."""
        found: dict[str, float] = {}
        for name, entries in self.sections:
            if name.endswith("COEFFICIENTS"):
                found |= {key: value for key, value in entries if isinstance(value, float)}
        return found


def read_tir(path: Path) -> TirFile:
    """Read a property file.

    Raises
    ------
    UnreadableError
        the file cannot be read or has no section
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise UnreadableError(
            "the tire file cannot be read", where=path, got=error.strerror, expected="a readable .tir file",
            next_step="check the path", rule="no-file",
        ) from error  # fmt: skip
    sections: list[tuple[str, list[tuple[str, str | float]]]] = []
    for line in text.splitlines():
        bare = line.strip()
        if bare.startswith("[") and "]" in bare:
            sections.append((bare[1 : bare.index("]")].strip().upper(), []))
        elif sections and bare[:1] not in ("$", "!", "") and (match := _LINE.match(bare)):
            sections[-1][1].append((match[1].upper(), _value(match[2].strip())))
    if not sections:
        raise UnreadableError(
            "the file is no tire property file", where=path, got="no [SECTION]",
            expected="sections such as [UNITS], [MODEL], [LATERAL_COEFFICIENTS]", next_step="check the path",
            rule="not-a-tir",
        )  # fmt: skip
    return TirFile(sections=tuple((name, tuple(entries)) for name, entries in sections))


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


def _shown(value: str | float) -> str:
    # repr gives the shortest digits that read back to the same number.
    return f"'{value}'" if isinstance(value, str) else repr(int(value) if value.is_integer() else value)


def _value(text: str) -> str | float:
    if text[:1] in ("'", '"'):
        return text[1:-1]
    try:
        return float(text)
    except ValueError:
        return text
