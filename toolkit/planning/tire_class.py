"""A class of tires: a tire that stands for it, and how far the others may be from it.

A class is a range of two factors, of cornering stiffness and of friction, on the tire of an earlier test.
Its members are the corners of that range as similar tires (`expectation.EarlierTest.similar`), and the tire
itself where the range holds it: what a plan reaches on each of them it reaches between them.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.planning.expectation import EarlierTest

FACTORS = ("stiffness", "friction")
PASSENGER: Mapping[str, tuple[float, float]] = {"stiffness": (0.41, 1.11)}
"""Radial passenger tires, on the published one (1003 N/deg at 3700 N, 27 % of the load a degree).

Their cornering stiffness is 11 to 19 % of the load a degree, of low aspect ratio 25 to 30 % (Gillespie,
Fundamentals of Vehicle Dynamics, SAE 1992, pp. 347-355, as the manual of McHenry's m-smac gives it).
"""
_FORM = re.compile(r"\s*(?P<name>\w+)\s*=\s*(?P<low>[\d.eE+-]+?)\s*\.\.\s*(?P<high>[\d.eE+-]+)\s*")
_SMALLEST, _LARGEST = 0.1, 10.0


def parse_spread(texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the range of each factor, by its name.

    Raises
    ------
    ConfigError
        ``plan-spread``: no such form or factor, a factor twice, a range that is empty or beyond 0.1 to 10

    Examples
    --------
    >>> parse_spread(["stiffness=0.7..1.3"])
    {'stiffness': (0.7, 1.3)}
    """
    spread: dict[str, tuple[float, float]] = {}
    for text in texts:
        match = _FORM.fullmatch(text)
        ends = (math.nan, math.nan) if match is None else (_number(match["low"]), _number(match["high"]))
        if match is None or match["name"] not in FACTORS or match["name"] in spread:
            raise _wrong(text, f"{' or '.join(FACTORS)}, each once: stiffness=0.7..1.3")
        if not _SMALLEST <= ends[0] <= ends[1] <= _LARGEST:
            raise _wrong(text, f"factors from {_SMALLEST:g} to {_LARGEST:g}, the smaller first")
        spread[match["name"]] = ends
    return spread


def members(earlier: EarlierTest, spread: Mapping[str, tuple[float, float]]) -> tuple[EarlierTest, ...]:
    """Return the earlier test of each member of a class, of the tire itself first; no spread: of it alone."""
    ranges = [spread.get(name, (1.0, 1.0)) for name in FACTORS]
    own = (1.0, 1.0)
    corners = dict.fromkeys(itertools.product(*(dict.fromkeys(ends) for ends in ranges)))
    if all(low <= 1.0 <= high for low, high in ranges):
        corners = {own: None} | corners
    return tuple(
        earlier
        if corner == own
        else earlier.similar(
            stiffness=corner[0], friction=corner[1], tire=f"{earlier.tire} with {_factors(corner)}"
        )
        for corner in corners
    )


def _factors(corner: Sequence[float]) -> str:
    return " and ".join(
        f"{size:g} of its {name}" for name, size in zip(FACTORS, corner, strict=True) if size != 1.0
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _wrong(got: str, expected: str) -> ConfigError:
    return ConfigError(
        "a spread cannot be read", where="--spread", got=got, expected=expected,
        next_step="state how far tires of the class are from the earlier test's, as factors",
        rule="plan-spread",
    )  # fmt: skip
