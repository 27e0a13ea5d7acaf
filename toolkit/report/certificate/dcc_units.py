"""Units as the D-SI writes them: SI tokens, and the factor from the record's unit.

Brochure of the D-SI (SmartCom D2): base and derived units as ``\\newton``, prefixes before them, powers as
``\\tothe{2}``, one ``\\per`` before the denominator. Units outside it (lbf, lbf*ft) are converted; bridge
ratios keep their prefix.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from toolkit.calibration.terms import INTERCEPT, parse_term
from toolkit.units import unit

_TOKENS: dict[str, tuple[tuple[str, int], ...]] = {
    "force": ((r"\newton", 1),),
    "moment": ((r"\newton", 1), (r"\metre", 1)),
    "count": (),
    "ratio": (),
}
_BRIDGE = {"mV/V": r"\milli\volt", "µV/V": r"\micro\volt", "V/V": r"\volt"}


@dataclass(frozen=True, slots=True, kw_only=True)
class DsiUnit:
    """A unit as D-SI tokens with powers; a value in it = ``factor`` x the value in the record's unit."""

    tokens: tuple[tuple[str, int], ...]
    factor: float

    @property
    def text(self) -> str:
        """The D-SI text, ``\\one`` where every token cancels."""
        up = "".join(_power(name, power) for name, power in self.tokens if power > 0)
        down = "".join(_power(name, -power) for name, power in self.tokens if power < 0)
        return (up or r"\one") + (rf"\per{down}" if down else "")


def dsi(text: str) -> DsiUnit:
    """Return a record's unit in D-SI.

    >>> dsi("lbf*ft").text, round(dsi("lbf*ft").factor, 6), dsi("mV/V").text
    ('\\\\newton\\\\metre', 1.355818, '\\\\milli\\\\volt\\\\per\\\\volt')
    """
    found = unit(text)
    if found.dimension == "bridge_ratio":
        name = text if text in _BRIDGE else "V/V"
        factor = 1.0 if name == text else found.factor
        return DsiUnit(tokens=((_BRIDGE[name], 1), (r"\volt", -1)) if name != "V/V" else (), factor=factor)
    return DsiUnit(tokens=_TOKENS[found.dimension], factor=found.factor)


def dsi_of_term(load: str, term: str, indications: Mapping[str, str]) -> DsiUnit:
    """Return the unit of a coefficient: that of the load for one unit of the term."""
    made = dsi(load)
    tokens, factor = dict(made.tokens), made.factor
    parsed = parse_term(term)
    powers = [] if term == INTERCEPT else [*parsed.powers, *((name, 1) for name in parsed.absolutes)]
    for name, power in powers:
        one = dsi(indications[name])
        factor /= one.factor**power
        for token, size in one.tokens:
            tokens[token] = tokens.get(token, 0) - size * power
    return DsiUnit(tokens=tuple((name, size) for name, size in tokens.items() if size), factor=factor)


def _power(name: str, power: int) -> str:
    return name if power == 1 else rf"{name}\tothe{{{power}}}"
