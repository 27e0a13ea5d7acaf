"""Tire property files (.tir): sections of NAME = VALUE, comments after ``$`` and ``!``, read whole.

Numbers of the Magic Formula are known by their names, in whatever section they stand.
Every line is kept in its order, so that a conversion loses nothing: entries that are known and that are
not, comments, and the rows of tables. Names count without regard to case. Nothing is mirrored for TYRESIDE.

[UNITS] is read, and dimensional entries are given in SI. Coefficients and scale factors are pure numbers,
those that multiply an angle per radian whatever ANGLE says. What has no known dimension keeps the file's
number.
"""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import CellError, ConfigError, UnitError, UnreadableError
from toolkit.findings import Finding
from toolkit.inputs import TIRE_FILE, read_input

_LBF = 0.45359237 * 9.80665
_INCH = 0.0254
_KNOWN: dict[str, dict[str, float]] = {
    "LENGTH": {
        "meter": 1.0, "metre": 1.0, "m": 1.0, "mm": 1e-3, "millimeter": 1e-3, "millimetre": 1e-3,
        "cm": 1e-2, "centimeter": 1e-2, "centimetre": 1e-2, "km": 1e3, "kilometer": 1e3, "kilometre": 1e3,
        "inch": _INCH, "inches": _INCH, "in": _INCH, "foot": 12 * _INCH, "feet": 12 * _INCH,
        "ft": 12 * _INCH,
    },
    "FORCE": {
        "newton": 1.0, "n": 1.0, "kn": 1e3, "knewton": 1e3, "kilonewton": 1e3,
        "lbf": _LBF, "pound_force": _LBF, "pound": _LBF, "kgf": 9.80665, "kg_force": 9.80665,
        "kilogram_force": 9.80665, "dan": 10.0,
    },
    "ANGLE": {
        "radian": 1.0, "rad": 1.0, "degree": math.pi / 180, "deg": math.pi / 180,
    },
    "MASS": {
        "kg": 1.0, "kilogram": 1.0, "g": 1e-3, "gram": 1e-3, "tonne": 1e3, "lbm": 0.45359237,
        "pound_mass": 0.45359237, "slug": _LBF / (12 * _INCH),
    },
    "TIME": {
        "second": 1.0, "sec": 1.0, "s": 1.0, "ms": 1e-3, "millisecond": 1e-3, "minute": 60.0,
        "min": 60.0, "hour": 3600.0, "h": 3600.0,
    },
    "PRESSURE": {
        "pascal": 1.0, "pa": 1.0, "kpa": 1e3, "kilopascal": 1e3, "mpa": 1e6, "bar": 1e5,
        "psi": _LBF / _INCH**2,
    },
}  # fmt: skip
SI = {
    "LENGTH": "meter", "FORCE": "newton", "ANGLE": "radians", "MASS": "kg", "TIME": "second",
    "PRESSURE": "pascal",
}  # fmt: skip

_DIMENSIONS: dict[str, tuple[str, ...]] = {
    "LENGTH": ("UNLOADED_RADIUS", "WIDTH", "RIM_RADIUS", "RIM_WIDTH", "BOTTOM_OFFST"),
    "FORCE": ("FNOMIN", "FZMIN", "FZMAX"),
    "ANGLE": ("ALPMIN", "ALPMAX", "CAMMIN", "CAMMAX"),
    "PRESSURE": ("NOMPRES", "INFLPRES", "PRESMIN", "PRESMAX"),
    "LENGTH/TIME": ("LONGVL", "VXLOW"),
    "FORCE/LENGTH": (
        "VERTICAL_STIFFNESS", "BOTTOM_STIFF", "LONGITUDINAL_STIFFNESS", "LATERAL_STIFFNESS",
    ),
    "FORCE*TIME/LENGTH": ("VERTICAL_DAMPING",),
    "MASS": ("MASS", "BELT_MASS"),
    "MASS*LENGTH*LENGTH": ("IXX", "IYY", "IZZ", "BELT_IXX", "BELT_IYY", "BELT_IZZ"),
    "LENGTH/TIME*TIME": ("GRAVITY",),
}  # fmt: skip
_DIMENSION = {key: dimension for dimension, keys in _DIMENSIONS.items() for key in keys}
# Which names of a tire file belong to which Magic Formula.


_ONLY_6X = frozenset(
    "PPX1 PPX2 PPX3 PPX4 RBX3 PEY5 PKY4 PKY5 PKY6 PKY7 PPY1 PPY2 PPY3 PPY4 PPY5 RBY4 QDZ10 QDZ11 PPZ1 PPZ2 "
    "LKYC LKZC LMUV".split()
)
_ONLY_52 = frozenset(["PHY3", "LGAX", "LGAY", "LGAZ"])
FOREIGN: Mapping[str, frozenset[str]] = {"5.2": _ONLY_6X, "6.x": _ONLY_52}
"""By the version of a file: names of forces and moments that only the other version has."""

# What a number is where a name changes nothing: a scale factor 1, a coefficient 0.
_NEUTRAL = {"PKY4": 2.0, "LMUV": 0.0}


def factors(tir: TirFile) -> dict[str, float]:
    """Return the factor to SI of each kind of unit; SI where the file names none.

    The keys that every program writes are LENGTH, FORCE, ANGLE, MASS and TIME. What they make is coherent: a
    pressure without a PRESSURE of its own is a FORCE over a LENGTH squared.

    Raises
    ------
    UnitError
        a unit's spelling is not known
    """
    stated = tir.section("UNITS")
    scales: dict[str, float] = {}
    for kind, table in _KNOWN.items():
        if kind == "PRESSURE" and kind not in stated:
            scales[kind] = scales["FORCE"] / scales["LENGTH"] ** 2
            continue
        text = stated.get(kind, SI[kind])
        spelt = str(text).strip().lower()
        factor = table.get(spelt, table.get(spelt.removesuffix("s")))
        if factor is None:
            raise UnitError(
                f"the tire file's unit of {kind} is not known", where=f"{tir.where}, [UNITS]", got=text,
                expected=", ".join(table), next_step=f"correct {kind} in [UNITS]", rule="unknown-unit",
            )  # fmt: skip
        scales[kind] = factor
    return scales


def scale(key: str, units: dict[str, float]) -> float | None:
    """Return the factor to SI of an entry, None where its dimension is not known."""
    dimension = _DIMENSION.get(key)
    if dimension is None:
        return None
    above, _, below = dimension.partition("/")
    product = math.prod(units[kind] for kind in above.split("*"))
    return product / math.prod(units[kind] for kind in below.split("*")) if below else product


def si_number(tir: TirFile, key: str, default: float | None = None) -> float:
    """Return a dimensional entry in SI; errors as `TirFile.number`."""
    if tir.get(key) is None and default is not None:
        return default
    return tir.number(key) * (scale(key, factors(tir)) or 1.0)


def ignored(version: str, coefficients: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names that a file's Magic Formula has not, and whose numbers would change a force.

    >>> ignored("5.2", {"PCY1": 1.3, "RBX3": -2.0, "RBY4": 0.0, "PKY4": 2.0})
    ('RBX3',)
    """
    return tuple(
        name
        for name, value in coefficients.items()
        if name in FOREIGN[version] and value != _NEUTRAL.get(name, 1.0 if name.startswith("L") else 0.0)
    )


# What other programs write: 5, 6, 21 and 52 are MF 5.2, 60 to 62 are MF 6.x.
_MF52, _MF6 = (5, 6, 21, 52), (60, 61, 62)
_LINE = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\s*=\s*('[^']*'|\"[^\"]*\"|[^$!]*)(.*)")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eEdD][+-]?[0-9]{1,4})?")
_ALIASES = {"LFZ0": "LFZO"}
# How the Magic Formula names its numbers: P, Q, R or S, what of the curve it makes, the axis, a number; scale
# factors begin with L.
_NAMED = re.compile(r"[PQRS][BCDEHKPSTV][XYZ][0-9]{1,2}|L[A-Z]{2,5}0?")
_SHAPE = "sections such as [UNITS], [MODEL], [LATERAL_COEFFICIENTS]"


@dataclass(frozen=True, slots=True, kw_only=True)
class TirLine:
    """One line: an entry with ``key`` and its comment in ``text``, else the whole line in ``text``."""

    section: str
    key: str = ""
    value: str | float = ""
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TirFile:
    """A property file, line by line; values are text or number as written, in the file's own units."""

    lines: tuple[TirLine, ...]
    where: str = ""

    @property
    def sections(self) -> tuple[tuple[str, tuple[tuple[str, str | float], ...]], ...]:
        """Entries as (section, ((key, value), ...)), in their order."""
        sections: dict[str, list[tuple[str, str | float]]] = {}
        for line in self.lines:
            if line.section:
                sections.setdefault(line.section, [])
            if line.key:
                sections[line.section].append((line.key, line.value))
        return tuple((name, tuple(entries)) for name, entries in sections.items())

    def comment(self, begins: str) -> str | None:
        """Return the first comment that begins with a text, without its sign; None where there is none."""
        comments = (line.text.lstrip("!$ ") for line in self.lines if not line.key and line.text)
        return next((text.rstrip() for text in comments if text.startswith(begins)), None)

    def section(self, name: str) -> dict[str, str | float]:
        """Return a section's entries, empty where there is none."""
        return {line.key: line.value for line in self.lines if line.key and line.section == name}

    def get(self, key: str) -> str | float | None:
        """Return the first value of a key in any section, None where it is absent."""
        return next((line.value for line in self.lines if line.key == key), None)

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
                f"the tire file has no number {key}", where=self.where or None,
                got="nothing" if value is None else value,
                expected=f"{key} = NUMBER", next_step="add the entry to the file", rule="tir-missing-key",
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
        if isinstance(fittyp, str) and _NUMBER.fullmatch(fittyp.strip()):
            fittyp = float(fittyp)
        known_format = str(self.get("PROPERTY_FILE_FORMAT")).upper() in ("PAC2002", "MF_05")
        if fittyp in _MF52 or (fittyp is None and known_format):
            return "5.2"
        if fittyp in _MF6:
            return "6.x"
        raise ConfigError(
            "the tire file's kind of Magic Formula is not known",
            where=self.where or None,
            got=self._kind_as_written(fittyp),
            expected="5, 6, 21 or 52 for MF 5.2; 60, 61 or 62 for MF 6.x",
            next_step="correct FITTYP in [MODEL]",
            rule="tir-fittyp",
        )

    def _kind_as_written(self, fittyp: object) -> str:
        if fittyp is not None:
            return f"FITTYP = {fittyp:g}" if isinstance(fittyp, float) else f"FITTYP = {fittyp}"
        file_format = self.get("PROPERTY_FILE_FORMAT")
        return "no FITTYP" + (
            f", and PROPERTY_FILE_FORMAT = {file_format}" if file_format is not None else ""
        )

    def coefficients(self) -> dict[str, float]:
        """Return the numbers of the coefficient and scaling sections by their names; LFZ0 is LFZO.

        Names that only the other Magic Formula has stay out (`mf_versions`).

        Raises
        ------
        ConfigError
            as `version`
        """
        foreign = FOREIGN[self.version]
        return {name: value for name, value in self._written().items() if name not in foreign}

    def findings(self) -> tuple[Finding, ...]:
        """Return what of the file is not evaluated although its number would change a force.

        Raises
        ------
        ConfigError
            as `version`
        """
        names = ignored(self.version, self._written())
        if not names:
            return ()
        version = {"5.2": "6.x", "6.x": "5.2"}[self.version]
        text = (
            f"the file is of MF {self.version} ({self._kind_as_written(self.get('FITTYP'))}): "
            f"{', '.join(names)} of MF {version} {'is' if len(names) == 1 else 'are'} not evaluated"
        )
        return (Finding(rule="tir-foreign-names", where=self.where, message=text),)

    def _written(self) -> dict[str, float]:
        return {
            _ALIASES.get(line.key, line.key): line.value
            for line in self.lines
            if line.key and is_coefficient(line.section, line.key) and isinstance(line.value, float)
        }


def read_tir(path: Path) -> TirFile:
    """Read a property file.

    Raises
    ------
    UnreadableError
        the file cannot be read, is no text or has no section
    CellError
        a coefficient that is no finite number, or one that stands twice with different values
    """
    data = read_input(path, TIRE_FILE)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeDecodeError as error:
            raise _no_tir(path, "bytes that are no text") from error
    if b"\0" in data:
        raise _no_tir(path, "bytes that are no text")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # comments of older programs; keys and numbers are ASCII
    return parse_tir(text, where=str(path))


def parse_tir(text: str, *, where: str = "") -> TirFile:
    """Return the property file of a text; errors as `read_tir`."""
    section, lines = "", []
    for number, line in enumerate(text.splitlines(), start=1):
        bare = line.strip()
        if bare.startswith("[") and "]" in bare:
            section = bare[1 : bare.index("]")].strip().upper()
            lines.append(TirLine(section=section, text=bare))
        elif section and bare[:1] not in ("$", "!", "") and (match := _LINE.match(bare)):
            key = match[1].upper()
            value = _value(match[2].strip(), f"{where}, line {number}", key, section)
            lines.append(TirLine(section=section, key=key, value=value, text=match[3].strip()))
        else:
            lines.append(TirLine(section=section, text=line.rstrip()))
    if not section:
        raise _no_tir(where, "no [SECTION]")
    tir_file = TirFile(lines=tuple(lines), where=where)
    _refuse_contradictions(tir_file)
    return tir_file


def _no_tir(where: object, actual: str) -> UnreadableError:
    return UnreadableError(
        "the file is no tire property file", where=where, got=actual, expected=_SHAPE,
        next_step="check the path", rule="not-a-tir",
    )  # fmt: skip


def is_coefficient(section: str, key: str) -> bool:
    """Tell whether an entry is a number of the equations: programs name the sections as they like."""
    if section.endswith("COEFFICIENTS"):
        return True
    return _NAMED.fullmatch(key) is not None and key not in _DIMENSION and key not in _KNOWN


def _value(text: str, where: str, key: str, section: str) -> str | float:
    coefficient = is_coefficient(section, key)
    if text[:1] in ("'", '"'):
        if not coefficient:
            return text[1:-1]
        text = text[1:-1].strip()
    if _NUMBER.fullmatch(text):
        number = float(text.lower().replace("d", "e"))
        if math.isfinite(number):
            return number
    if coefficient or _NUMBER.fullmatch(text) or text.lower().strip("+-") in _NO_NUMBERS:
        raise CellError(
            f"the tire file's {key} is no number", where=where, got=repr(text) if text else "nothing",
            expected="a finite number with a decimal point", next_step="mend that line", rule="tir-number",
        )  # fmt: skip
    return text


_NO_NUMBERS = ("nan", "inf", "infinity", "1.#inf", "1.#qnan", "1.#ind")


def _refuse_contradictions(tir: TirFile) -> None:
    entries: dict[tuple[str, str], str | float] = {}
    for line in tir.lines:
        if not isinstance(line.value, float):
            continue
        coefficient = is_coefficient(line.section, line.key)
        key = _ALIASES.get(line.key, line.key)
        first = entries.setdefault(("COEFFICIENTS" if coefficient else line.section, key), line.value)
        if first != line.value:
            raise CellError(
                f"the tire file gives {line.key} twice", where=f"{tir.where}, [{line.section}]",
                got=f"{first!r} and {line.value!r}", expected=f"one {line.key}",
                next_step="remove the one that is wrong", rule="tir-doubled",
            )  # fmt: skip
