"""The one place where units are read and converted.

Inside the toolkit every array is float64 in SI (N, N·m, rad, m/s, Pa, K, s); units exist at the edges:
files in, reports out. ``lb`` in a file of this field means pound-force, and only this module says so.
A bridge output in mV/V and a digitiser's counts are dimensions of their own, so that neither can be
taken for the other or for a plain number.

pint does the arithmetic; it is imported when the first unit is read.

A column's header says its name and its unit. ``NAME [unit]`` says it whatever the name is. Spreadsheets and
other laboratories' files also write ``NAME (unit)``, ``NAME / unit``, ``NAME in unit`` or ``NAME_unit``:
these count where the file's reader knows the name and the unit is one, since each of them may be a name as
well.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import UnitError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pint import UnitRegistry

# What files, certificates and people write -> an expression of the registry. Everything else that pint
# itself reads is accepted too; spellings that pint would read as something else must stand here.
_SPELLINGS = {
    "lb": "force_pound",
    "lbs": "force_pound",
    "lbf": "force_pound",
    "lb-ft": "force_pound*foot",
    "lb*ft": "force_pound*foot",
    "lb ft": "force_pound*foot",
    "lb.ft": "force_pound*foot",
    "lbf-ft": "force_pound*foot",
    "lbf ft": "force_pound*foot",
    "lbf*ft": "force_pound*foot",
    "lbf.ft": "force_pound*foot",
    "ft-lb": "force_pound*foot",
    "ft-lbf": "force_pound*foot",
    "ft lb": "force_pound*foot",
    "ft*lb": "force_pound*foot",
    "ft lbf": "force_pound*foot",
    "ft*lbf": "force_pound*foot",
    "N-m": "newton*meter",
    "N m": "newton*meter",
    "N*m": "newton*meter",
    "kN*m": "kilonewton*meter",
    "mV/V": "1e-3*bridge_ratio",
    "µV/V": "1e-6*bridge_ratio",
    "uV/V": "1e-6*bridge_ratio",
    "V/V": "bridge_ratio",
    "°": "degree",
    "degC": "degC",
    "°C": "degC",
    "C": "degC",
    "degF": "degF",
    "°F": "degF",
    "psi": "psi",
    "km/h": "kilometer/hour",
    "1": "dimensionless",
    "-": "dimensionless",
    "none": "dimensionless",
    "": "dimensionless",
    "%": "0.01*dimensionless",
    "rev": "turn",
    "U/min": "turn/minute",
}

# What a word means inside a compound as well: pint's pound is a mass, its Nm no moment.
_WORDS = {
    **dict.fromkeys(("lb", "lbs", "lbf"), "force_pound"), "klbf": "(1000*force_pound)",
    "kip": "(1000*force_pound)", "kp": "kilogram_force", "kips": "(1000*force_pound)",
    "kph": "(kilometer/hour)", "kmh": "(kilometer/hour)", "mph": "(mile/hour)", "rev": "turn",
    "counts": "digitiser_count", "count": "digitiser_count", "PS": "metric_horsepower", "pct": "percent",
    **dict.fromkeys(("Ohm", "Ohms"), "ohm"), "kOhm": "kiloohm", "MOhm": "megaohm", "mOhm": "milliohm",
    **dict.fromkeys(("Volt", "Volts"), "volt"), **dict.fromkeys(("Amp", "Amps", "Ampere"), "ampere"),
    **dict.fromkeys(("Watt", "Watts"), "watt"), "Farad": "farad", "Henry": "henry", "Siemens": "siemens",
}  # fmt: skip
_WRITTEN = {"lb": "lbf", "lbs": "lbf", "kp": "kgf"}
_WORD = re.compile(r"[^\W\d_]+")
# A newton metre as one word, with any prefix: pint's Nm is a measure of yarn, its mNm the thousandth of one.
_MOMENT = re.compile(r"((?:da|[GMkhcmµu])?N)([ckm]?m)")
# A degree to those who speak German or French, a hundredth of a right angle to pint: not read as either.
_TWO_MEANINGS = frozenset({"grad", "Grad", "grade", "grads", "Grade"})
_AROUND = re.compile(r"\s*([*/])\s*")
_HYPHEN = re.compile(r"(?<=[^\W\d_])\s*-\s*(?![CF]\b)(?=[^\W\d_])")  # lbf-in, N-m/deg: a product

# How the toolkit writes a unit, whatever the spelling that was read.
_CANONICAL = {
    "lb": "lbf", "lbs": "lbf", "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad",
    "radians": "rad", "°C": "degC", "C": "degC", "°F": "degF", "counts": "count", "kph": "km/h",
    "kmh": "km/h", "-": "1", "": "1", "newton": "N", "newtons": "N", "second": "s", "seconds": "s",
    "none": "1", "uV/V": "µV/V",
}  # fmt: skip

# Also refused: a number to a power, which no unit needs and which can be made to compute for ever.
_NEVER_GUESSED = re.compile(r"[^\w\s*/^.()·°µ%+-]|\d\s*\)?\s*(\*\*|\^)|.{41}")

# In a compound unit (mV/degC, 1/degF) a temperature is a difference: pint would add the zero of its scale.
_SCALE = re.compile(
    r"(?<!\w)(?:°|deg(?:ree)?s?_?)?([CF])(?:elsius|ahrenheit)\b|(?<!\w)(?:°|deg(?:ree)?_?)([CF])\b", re.I
)
_DIGITS, _NAME = re.compile(r"\d+\.?\d*(?:[eE][+-]?\d+)?"), re.compile(r"[^\W\d_]|°")
_SPACED_SCALE = re.compile(r"\bdeg(?:ree)?s?\s+[CF]\b", re.I)


INTERVAL_SCALES = frozenset({"temperature"})
"""Dimensions whose scales have a zero by convention: differences mean something, and ratios of values do not.

20 degC is not twice 10 degC (Stevens, Science 103, 1946). Positions and pressures count as ratio scales:
their zero is set where a spring or a gauge is at rest, and is the same in every unit.
"""


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as read at the edge: SI value = ``factor`` x value + ``offset``, in ``si``."""

    text: str
    factor: float
    offset: float
    si: str
    dimension: str

    @property
    def is_interval(self) -> bool:
        """Tell whether its zero is one of convention; a stated difference has none.

        >>> unit("degC").is_interval, unit("K").is_interval, unit("N").is_interval
        (True, True, False)
        """
        return self.dimension in INTERVAL_SCALES and not self.text.startswith("delta_")


@cache
def registry() -> UnitRegistry[Any]:
    """Return the one pint registry, with bridge ratio and digitiser count as dimensions."""
    import pint

    made: UnitRegistry[Any] = pint.UnitRegistry(autoconvert_offset_to_baseunit=True, cache_folder=None)
    made.define("bridge_ratio = [bridge_ratio]")
    made.define("digitiser_count = [digitiser_count]")
    return made


# The units of the machine's own files, so that reading one needs no pint: the test of this module
# holds every line against pint. The international pound-force is exact: 0.45359237 kg x 9.80665 m/s^2.
_LBF = 0.45359237 * 9.80665
_EXACT = {
    "N": (1.0, 0.0, "N", "force"),
    "kN": (1e3, 0.0, "N", "force"),
    "lbf": (_LBF, 0.0, "N", "force"),
    "N*m": (1.0, 0.0, "N*m", "moment"),
    "lbf*ft": (_LBF * 0.3048, 0.0, "N*m", "moment"),
    "deg": (math.pi / 180, 0.0, "rad", "angle"),
    "rad": (1.0, 0.0, "rad", "angle"),
    "mV/V": (1e-3, 0.0, "V/V", "bridge_ratio"),
    "V/V": (1.0, 0.0, "V/V", "bridge_ratio"),
    "count": (1.0, 0.0, "count", "count"),
    "m": (1.0, 0.0, "m", "length"),
    "mm": (1e-3, 0.0, "m", "length"),
    "s": (1.0, 0.0, "s", "time"),
    "ms": (1e-3, 0.0, "s", "time"),
    "deg/s": (math.pi / 180, 0.0, "Hz", "frequency"),
    "m/s": (1.0, 0.0, "m/s", "speed"),
    "km/h": (1 / 3.6, 0.0, "m/s", "speed"),
    "Pa": (1.0, 0.0, "Pa", "pressure"),
    "kPa": (1e3, 0.0, "Pa", "pressure"),
    "bar": (1e5, 0.0, "Pa", "pressure"),
    "psi": (_LBF / 0.0254**2, 0.0, "Pa", "pressure"),
    "degC": (1.0, 273.15, "K", "temperature"),
    "K": (1.0, 0.0, "K", "temperature"),
    "1": (1.0, 0.0, "1", "ratio"),
    "Hz": (1.0, 0.0, "Hz", "frequency"),
}

_DIMENSIONS = {
    "[mass] * [length] / [time] ** 2": ("force", "N"),
    "[mass] * [length] ** 2 / [time] ** 2": ("moment", "N*m"),
    "[bridge_ratio]": ("bridge_ratio", "V/V"),
    "[digitiser_count]": ("count", "count"),
    "[length]": ("length", "m"),
    "[time]": ("time", "s"),
    "[length] / [time]": ("speed", "m/s"),
    "[mass] / [length] / [time] ** 2": ("pressure", "Pa"),
    "[temperature]": ("temperature", "K"),
    "[mass]": ("mass", "kg"),
    "[mass] * [length] ** 2 / [time] ** 3 / [current]": ("voltage", "V"),
    "1 / [time]": ("frequency", "Hz"),
}


def unit(text: str, *, where: object = None) -> Unit:
    """Read a unit.

    Parameters
    ----------
    text : a spelling such as ``lbf``, ``lb-ft``, ``mV/V``, ``deg``, ``N·m``
    where : the file and column, for the message

    Raises
    ------
    UnitError
        the spelling is unknown; a unit is never guessed

    Examples
    --------
    >>> unit("lb").factor
    4.4482216152605
    >>> unit("lb-ft").si
    'N*m'
    >>> unit("lbf*m").dimension
    'moment'
    """
    try:
        return _parse(" ".join(text.split()))
    except _UnknownUnitError as error:
        raise UnitError(
            f"unknown unit {text!r}",
            where=where,
            got=text,
            expected="a unit such as N, lbf, N*m, lbf*ft, deg, rad, mV/V, V, ohm, count, degC, kPa, km/h, s",
            next_step="write the unit in the header as 'NAME [unit]' or in the machine definition",
            rule="unknown-unit",
        ) from error


class _UnknownUnitError(Exception):
    pass


@cache
def _parse(text: str) -> Unit:
    text = _AROUND.sub(r"\1", text.replace("·", "*").replace("⋅", "*").replace("μ", "µ"))
    name = _canonical(text)
    if name in _EXACT:
        factor, offset, si, dimension = _EXACT[name]
        return Unit(name, factor, offset, si, dimension)
    if _NEVER_GUESSED.search(text) or not _TWO_MEANINGS.isdisjoint(_WORD.findall(text)):
        raise _UnknownUnitError(text)
    ureg = registry()
    expression = _SPELLINGS.get(text) or _in_words(_HYPHEN.sub("*", text), _WORDS)
    # A bare number is none: "SA (2)" is a second column, "60" a value without its unit.
    if not _NAME.search(_DIGITS.sub("", expression)):
        raise _UnknownUnitError(text)
    is_scale = _SCALE.fullmatch(expression.strip("() ")) is not None
    of_scale = not is_scale and _SCALE.search(expression) is not None
    if not is_scale:
        # With a space between them pint would multiply an angle by a charge.
        if _SPACED_SCALE.search(expression):
            raise _UnknownUnitError(text)
        expression = _SCALE.sub(lambda m: f"delta_deg{(m[1] or m[2]).upper()}", expression)
    try:
        number = _quantity(expression, of_scale=of_scale)
        if dict(number.dimensionality) == {"[temperature]": 1}:
            zero = float(ureg.Quantity(0.0, number.units).to("kelvin").magnitude)
            factor = float(ureg.Quantity(1.0, number.units).to("kelvin").magnitude) - zero
            return Unit(name, factor * float(number.magnitude), zero, "K", "temperature")
        if not number.dimensionality:
            # pint counts an angle as a pure number, but one whose root is the radian.
            is_angle = dict(number.to_root_units()._units) == {"radian": 1}
            factor = float(
                number.to("radian").magnitude if is_angle else number.to("dimensionless").magnitude
            )
            return Unit(name, factor, 0.0, "rad" if is_angle else "1", "angle" if is_angle else "ratio")
        base = number.to_base_units()
        kind = _kind(dict(number.dimensionality))
        dimension, symbol = _DIMENSIONS.get(kind, (kind, f"{base.units:~}"))
        return Unit(name, float(base.magnitude), 0.0, symbol, dimension)
    except Exception as error:  # pint raises many kinds for text that is no unit
        raise _UnknownUnitError(text) from error


def _quantity(expression: str, *, of_scale: bool) -> Any:
    number: Any = registry().Quantity(registry().parse_expression(expression))
    # -N would turn a sign, 0*N make every value zero, and 2 degC is no temperature: its zero is no multiple.
    is_positive = 0 < number.magnitude < math.inf
    if not is_positive or (of_scale and dict(number.dimensionality) == {"[temperature]": 1}):
        raise _UnknownUnitError(expression)
    return number


def _kind(parts: dict[str, float]) -> str:
    # pint prints the parts in the order in which the unit was composed: N*m and lbf*m would differ.
    order = ("[bridge_ratio]", "[digitiser_count]", "[mass]", "[length]", "[temperature]", "[time]")
    names = sorted(parts, key=lambda name: (order.index(name) if name in order else len(order), name))
    powers = {name: f" ** {abs(parts[name]):g}" if abs(parts[name]) != 1 else "" for name in names}
    above = " * ".join(f"{name}{powers[name]}" for name in names if parts[name] > 0)
    return (above or "1") + "".join(f" / {name}{powers[name]}" for name in names if parts[name] < 0)


def _canonical(text: str) -> str:
    if text in _CANONICAL:
        return _CANONICAL[text]
    spelled = _SPELLINGS.get(text)
    if spelled == "force_pound*foot":
        return "lbf*ft"
    if spelled == "newton*meter":
        return "N*m"
    return text if spelled is not None else _in_words(_HYPHEN.sub("*", text), _WRITTEN)


def _in_words(text: str, meanings: Mapping[str, str]) -> str:
    def meaning(match: re.Match[str]) -> str:
        if moment := _MOMENT.fullmatch(match[0]):
            product = f"{moment[1]}*{moment[2]}"
            return product if meanings is _WRITTEN else f"({product})"
        return meanings.get(match[0], match[0])

    return _WORD.sub(meaning, text)


def to_si(values: ArrayLike, text: str) -> Array:
    """Return values in SI; the shape is kept.

    >>> to_si([1.0, 2.0], "lbf").round(3).tolist()
    [4.448, 8.896]
    >>> float(to_si(20.0, "degC"))
    293.15
    """
    stated = unit(text)
    return np.asarray(values, dtype=np.float64) * stated.factor + stated.offset


def from_si(values: ArrayLike, text: str) -> Array:
    """Return SI values in a unit for people; the inverse of `to_si`."""
    stated = unit(text)
    return (np.asarray(values, dtype=np.float64) - stated.offset) / stated.factor


def unit_examples(text: str) -> tuple[str, ...]:
    """Return units of the same dimension that files of this field have.

    >>> unit_examples("m/s")
    ('m/s', 'km/h')
    """
    dimension = unit(text).dimension
    return tuple(name for name, parts in _EXACT.items() if parts[3] == dimension)


RECORDED_IN = (
    *_EXACT, "kgf", "MN", "lbf*in", "kgf*m", "kN*m", "N*mm", "µV/V", "g", "kg", "cm", "µm", "km", "inch",
    "ft", "min", "h", "µs", "mph", "cm/s", "mm/s", "cm/s^2", "m/s^2", "standard_gravity", "MPa", "mbar",
    "hPa", "atm", "mmHg", "mV", "V", "kV", "mA", "A", "mW", "W", "kW", "turn", "mrad", "%", "rad/s", "rpm",
    "ml", "liter", "m^3", "l/min", "m^3/h",
)  # fmt: skip
"""Units in which people record, those of the machine's own files first: a number in one that is taken for
another of its dimension is off by their ratio."""
_SAME_RATIO = 0.01


def units_alike(text: str) -> tuple[str, ...]:
    """Return units of the same dimension in which people record, those of this field first.

    >>> units_alike("bar")
    ('Pa', 'kPa', 'bar', 'psi', 'MPa', 'mbar', 'hPa', 'atm', 'mmHg')
    """
    dimension = unit(text).dimension
    return tuple(name for name in RECORDED_IN if unit(name).dimension == dimension)


def ratio_of_units(ratio: float, text: str) -> str | None:
    """Return which units, one taken for another, make numbers too large by a ratio; None where none do.

    ``text`` is the unit that the numbers are stated in: a unit taken for it is named first.

    >>> ratio_of_units(0.2249, "N"), ratio_of_units(4.45, "N"), ratio_of_units(1.3, "N")
    ('lbf against N', 'N against lbf', None)
    """
    if not ratio > 0:
        return None
    names = units_alike(text)
    pairs = [(right, wrong) for right in names for wrong in names if right != wrong]
    pairs.sort(key=lambda pair: _canonical(text) != pair[1])
    for right, wrong in pairs:
        if abs(ratio * unit(right).factor / unit(wrong).factor - 1) < _SAME_RATIO:
            return f"{right} against {wrong}"
    return None


def with_unit(number: str, text: str) -> str:
    """Return a printed number with its unit; a ratio has none.

    >>> with_unit("0.11", "1"), with_unit("2.5", "N*m")
    ('0.11', '2.5 N*m')
    """
    return number if text in ("", "1") else f"{number} {text}"


def printed(text: str) -> str:
    """Return a unit as it is printed for people.

    >>> printed("lbf*ft/(mV/V)")
    'lbf·ft/(mV/V)'
    """
    return text.replace("*", "·")


_BESIDE = {"N": "lbf", "lbf": "N", "N*m": "lbf*ft", "lbf*ft": "N*m"}


def in_both(values: ArrayLike, text: str, spec: str = ".4g") -> str:
    """Return forces [N] or moments [N·m] in a unit, and behind them in that of the other system.

    What a finding says stands as it is in reports in SI and in reports in pounds.

    >>> in_both([1112.06, 2522.2], "lbf", ".0f")
    '250, 567 lbf (1112, 2522 N)'
    """
    texts = [
        f"{', '.join(f'{one:{spec}}' for one in np.atleast_1d(from_si(values, unit_text)).tolist())} "
        + printed(unit_text)
        for unit_text in (text, _BESIDE[text])
    ]
    return f"{texts[0]} ({texts[1]})"


def si_scale(text: str, dimension: str | None = None, *, where: object = None) -> float:
    """Return the factor to SI of a unit without an offset, optionally of a demanded dimension.

    Raises
    ------
    UnitError
        the unit is unknown, of another dimension, or has an offset
    """
    stated = unit(text, where=where)
    if (dimension is not None and stated.dimension != dimension) or stated.offset:
        raise UnitError(
            f"unit {text!r} is not one of {dimension or 'a plain scale'}",
            where=where,
            got=f"{text} ({stated.dimension})",
            expected=dimension or "a unit without an offset",
            next_step="correct the unit in the file or the machine definition",
            rule="unit-dimension",
        )
    return stated.factor


_BRACKETS = re.compile(r"(.*?\S)\s*\[([^\[\]]*)\]")
_OTHERS = tuple(
    map(
        re.compile,
        (r"(.*?\S)\s*\(([^()]+)\)", r"(.*?\S)\s*/\s*(.+)", r"(.*\S)\s+in\s+(\S.*)", r"(.+)_([^_]+)"),
    )
)
_LONGEST = 200


def split_header(header: str, is_name: Callable[[str], bool] | None = None) -> tuple[str, str | None]:
    """Return a header's name and its unit as written, None where it states none.

    Parameters
    ----------
    is_name : tells a name that the reader knows; without it square brackets alone hold a unit

    Examples
    --------
    >>> split_header("FY [N]"), split_header("FY_N")
    (('FY', 'N'), ('FY_N', None))
    >>> known = {"FY", "SA"}.__contains__
    >>> [split_header(text, known) for text in ("FY_N", "SA in deg", "FY / kN", "FY (lbf)")]
    [('FY', 'N'), ('SA', 'deg'), ('FY', 'kN'), ('FY', 'lbf')]
    >>> [split_header(text, known) for text in ("FY_raw", "FY (Filtered)", "gain_N")]
    [('FY_raw', None), ('FY (Filtered)', None), ('gain_N', None)]
    """
    text = header.strip()
    if len(text) > _LONGEST:
        return text[:_LONGEST], None
    if match := _BRACKETS.fullmatch(text):
        return match[1], match[2]
    if is_name is None or is_name(text):
        return text, None
    for form in _OTHERS:
        if (match := form.fullmatch(text)) and is_name(match[1]) and is_unit(match[2]):
            return match[1], match[2]
    return text, None


def is_unit(text: str) -> bool:
    """Tell whether a text is a unit that is known.

    >>> is_unit("mV/V"), is_unit("Filtered")
    (True, False)
    """
    try:
        unit(text)
    except UnitError:
        return False
    return True
