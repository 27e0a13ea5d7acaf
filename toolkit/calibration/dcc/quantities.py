"""Values of a DCC with their expanded uncertainties, in SI, each with the place where it stands.

D-SI writes a list of values with a list of uncertainties, of which one stands for all; version 2 names the
elements otherwise than version 1. Read are forces and moments; numbers are converted by exact decimals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal

from toolkit.calibration.dcc.structure import DCC, SI
from toolkit.errors import SessionError

Dimension = Literal["force", "moment"]
_PREFIXES = {"": 0, r"\nano": -9, r"\micro": -6, r"\milli": -3, r"\kilo": 3, r"\mega": 6, r"\giga": 9}
_PREFIX = r"(\\nano|\\micro|\\milli|\\kilo|\\mega|\\giga)?"
_UNIT = re.compile(_PREFIX + r"\\newton(" + _PREFIX + r"\\metre)?")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d{1,2})?")
_LONGEST = 40  # characters of a number
_CHANNEL = re.compile(r"\b[FM][XYZ]\b")
# D-SI 2 and D-SI 1: the element of an expanded uncertainty, and its values and coverage factors in it.
_EXPANDED_LISTS = (
    ("si:measurementUncertaintyUnivariateXMLList/si:expandedMUXMLList", "valueExpandedMUXMLList"),
    ("si:expandedUncXMLList", "uncertaintyXMLList"),
)
_EXPANDED = (
    ("si:measurementUncertaintyUnivariate/si:expandedMU", "valueExpandedMU"),
    ("si:expandedUnc", "uncertainty"),
)
_SPACES = {"dcc": DCC, "si": SI}


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A value of a calibration, in N or N·m, with U and k, and the XPaths of value, U and k.

    ``channels`` are those that its names speak of, such as FY; none of a standard with one load.
    """

    dimension: Dimension
    value: float
    U: float
    k: float
    channels: frozenset[str]
    value_path: str
    U_path: str
    k_path: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Values:
    """A quantity's numbers, with uncertainties where it has them."""

    dimension: Dimension
    numbers: tuple[Decimal, ...]
    path: str
    U: tuple[Decimal, ...] = ()
    k: tuple[Decimal, ...] = ()
    U_path: str = ""
    k_path: str = ""


def points_of(root: Any, *, where: object) -> tuple[Point, ...]:
    """Return every force and moment of the results that has an expanded uncertainty.

    A measurement error belongs to the reference value of its row; values before an adjustment are left out.

    Raises
    ------
    SessionError
        ``dcc-quantity``: a number that cannot be, or lists of different lengths
    """
    points: list[Point] = []
    for result in root.iterfind(
        "dcc:measurementResults/dcc:measurementResult/dcc:results/dcc:result", _SPACES
    ):
        words = _words(result.find("dcc:name", _SPACES))
        for data in result.iterfind("dcc:data", _SPACES):
            points += _of_group(data, words, where)
    return tuple(points)


def _of_group(group: Any, words: str, where: object) -> Iterator[Point]:
    quantities = group.findall("dcc:quantity", _SPACES)
    references = [q for q in quantities if "basic_referenceValue" in _types(q)]
    reference = _values(references[0], where) if len(references) == 1 else None
    for quantity in quantities:
        types, values = _types(quantity), _values(quantity, where)
        if values is None or not values.U or any("Adjustment" in name for name in types):
            continue
        at = values
        if reference is not None and reference.dimension == values.dimension:
            if len(reference.numbers) != len(values.numbers):
                raise _unreadable(f"{where}: {values.path}", f"{len(values.numbers)} values",
                                  f"one for each of {len(reference.numbers)} reference values")  # fmt: skip
            at = reference
        elif "basic_measurementError" in types:
            continue  # of which load it is the error stands nowhere
        channels = frozenset(_CHANNEL.findall(f"{words} {_words(quantity.find('dcc:name', _SPACES))}"))
        yield from _points(at, values, channels)
    for inner in group.iterfind("dcc:list", _SPACES):
        yield from _of_group(inner, f"{words} {_words(inner.find('dcc:name', _SPACES))}", where)


def _points(at: _Values, values: _Values, channels: frozenset[str]) -> Iterator[Point]:
    U = values.U * len(values.numbers) if len(values.U) == 1 else values.U
    k = values.k * len(values.numbers) if len(values.k) == 1 else values.k
    for number, expanded, factor in zip(at.numbers, U, k, strict=True):
        yield Point(
            dimension=values.dimension, value=float(number), U=float(expanded), k=float(factor),
            channels=channels, value_path=at.path, U_path=values.U_path, k_path=values.k_path,
        )  # fmt: skip


def _values(quantity: Any, where: object) -> _Values | None:
    """Return a quantity's numbers in SI; None where it is no force and no moment."""
    holders = [*quantity.iterfind("si:hybrid/*", _SPACES), *quantity.iterfind("*")]
    for holder in holders:
        single = holder.tag == f"{{{SI}}}real"
        if not single and holder.tag != f"{{{SI}}}realListXMLList":
            continue
        suffix = "" if single else "XMLList"
        units = (holder.findtext(f"si:unit{suffix}", "", _SPACES)).split()
        scales = [_scale(text) for text in units]
        if not scales or scales[0] is None or len(set(scales)) != 1:
            continue
        dimension, power = scales[0]
        numbers = _numbers(holder.find(f"si:value{suffix}", _SPACES), power, where)
        return _with_uncertainty(
            holder, _Values(dimension=dimension, numbers=numbers, path=_path(holder)), power, suffix, where
        )
    return None


def _with_uncertainty(holder: Any, values: _Values, power: int, suffix: str, where: object) -> _Values:
    for path, name in _EXPANDED if not suffix else _EXPANDED_LISTS:
        element = holder.find(path, _SPACES)
        if element is None:
            continue
        expanded, factor = (
            element.find(f"si:{name}", _SPACES),
            element.find(f"si:coverageFactor{suffix}", _SPACES),
        )
        U, k = _numbers(expanded, power, where), _numbers(factor, 0, where)
        if len(U) not in (1, len(values.numbers)) or len(k) not in (1, len(values.numbers)):
            raise _unreadable(f"{where}: {_path(element)}", f"{len(U)} U and {len(k)} k",
                              f"one, or one for each of {len(values.numbers)} values")  # fmt: skip
        if min(U) <= 0 or min(k) < 1:
            raise _unreadable(f"{where}: {_path(element)}", f"U = {min(U)}, k = {min(k)}",
                              "U above 0 and k from 1")  # fmt: skip
        return _Values(
            dimension=values.dimension, numbers=values.numbers, path=values.path, U=U, k=k,
            U_path=_path(expanded), k_path=_path(factor),
        )  # fmt: skip
    return values


def _numbers(element: Any, power: int, where: object) -> tuple[Decimal, ...]:
    words = [] if element is None else (element.text or "").split()
    if not words or not all(_NUMBER.fullmatch(word) and len(word) <= _LONGEST for word in words):
        place = where if element is None else f"{where}: {_path(element)}"
        raise _unreadable(place, " ".join(words)[:60] or "nothing", "decimal numbers")
    return tuple(Decimal(word).scaleb(power) for word in words)


def _scale(text: str) -> tuple[Dimension, int] | None:
    match = _UNIT.fullmatch(text)
    if match is None:
        return None
    power = _PREFIXES[match[1] or ""] + _PREFIXES[match[3] or ""]
    return ("moment" if match[2] else "force"), power


def _types(quantity: Any) -> Sequence[str]:
    return (quantity.get("refType") or "").split()


def _words(element: Any) -> str:
    return "" if element is None else " ".join("".join(part.itertext()) for part in element)


def _path(element: Any) -> str:
    path: str = element.getroottree().getelementpath(element)
    return path.replace(f"{{{DCC}}}", "dcc:").replace(f"{{{SI}}}", "si:")


def _unreadable(where: object, actual: str, expected: str) -> SessionError:
    return SessionError(
        "a quantity of the digital certificate cannot be read", where=where, got=actual, expected=expected,
        next_step="ask the issuer for a valid DCC; nothing was written", rule="dcc-quantity",
    )  # fmt: skip
