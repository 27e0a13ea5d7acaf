"""Tire property files (.tir): sections of NAME = VALUE, comments after ``$`` and ``!``, read whole.

Every line is kept in its order, so that a conversion loses nothing: entries that are known and that are
not, comments, and the rows of tables. Names count without regard to case. Nothing is mirrored for TYRESIDE.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import CellError, ConfigError, UnreadableError
from toolkit.findings import Finding
from toolkit.inputs import TIRE_FILE, read_input

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
            if line.key and line.section.endswith("COEFFICIENTS") and isinstance(line.value, float)
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


def _value(text: str, where: str, key: str, section: str) -> str | float:
    if text[:1] in ("'", '"'):
        return text[1:-1]
    if _NUMBER.fullmatch(text):
        number = float(text.lower().replace("d", "e"))
        if math.isfinite(number):
            return number
    if section.endswith("COEFFICIENTS") or _NUMBER.fullmatch(text) or text.lower().strip("+-") in _NO_NUMBERS:
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
        coefficient = line.section.endswith("COEFFICIENTS")
        key = _ALIASES.get(line.key, line.key)
        first = entries.setdefault(("COEFFICIENTS" if coefficient else line.section, key), line.value)
        if first != line.value:
            raise CellError(
                f"the tire file gives {line.key} twice", where=f"{tir.where}, [{line.section}]",
                got=f"{first!r} and {line.value!r}", expected=f"one {line.key}",
                next_step="remove the one that is wrong", rule="tir-doubled",
            )  # fmt: skip
