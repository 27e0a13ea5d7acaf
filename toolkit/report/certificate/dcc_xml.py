"""Elements of a DCC: texts, single values and lists with their expanded uncertainties."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lxml import etree

from toolkit.calibration.terms import INTERCEPT, parse_term
from toolkit.printable import escaped
from toolkit.report.word.xml import clean
from toolkit.units import unit

Node = Any
SPACES = {"dcc": "https://ptb.de/dcc", "si": "https://ptb.de/si"}


def node(tag: str, *children: Node | str | None, **attributes: str) -> Node:
    """Return an element; a child that is None or empty is left out, a text has its white space collapsed."""
    prefix, _, name = tag.partition(":")
    element = etree.Element(f"{{{SPACES[prefix]}}}{name}", nsmap=SPACES)
    for key, value in attributes.items():
        element.set(key, value)
    for child in children:
        if child is None or (isinstance(child, str) and not child):
            continue
        if isinstance(child, str):
            element.text = " ".join(escaped(clean(child)).split())
        else:
            element.append(child)
    return element


def text(tag: str, words: str) -> Node:
    """Return a dcc:textType in English."""
    return node(tag, node("dcc:content", words, lang="en"))


def rich(tag: str, words: str) -> Node:
    """Return a dcc:richContentType in English."""
    return text(tag, words)


def quantity(
    name: str,
    value: str,
    unit: str,
    *,
    told: str = "",
    standard: str = "",
    expanded: tuple[str, str, str] | None = None,
    kind: str = "",
) -> Node:
    """Return one value, as printed; with its standard uncertainty, or with ``expanded`` = (U, k, p)."""
    real = node("si:real", node("si:value", plain(value)), node("si:unit", unit))
    if standard:
        mu = node("si:standardMU", node("si:valueStandardMU", plain(standard)))
        real.append(node("si:measurementUncertaintyUnivariate", mu))
    if expanded:
        U, k, p = expanded
        mu = node(
            "si:expandedMU",
            node("si:valueExpandedMU", plain(U)),
            node("si:coverageFactor", k),
            node("si:coverageProbability", p),
            node("si:distribution", "studentT"),
        )
        real.append(node("si:measurementUncertaintyUnivariate", mu))
    about = rich("dcc:description", told) if told else None
    return node("dcc:quantity", text("dcc:name", name), about, real, **({"refType": kind} if kind else {}))


def quantity_list(
    name: str,
    values: Sequence[str],
    unit: str,
    *,
    U: Sequence[str] = (),
    k: Sequence[str] = (),
    p: Sequence[str] = (),
    told: str = "",
    kind: str = "",
) -> Node:
    """Return a list of values with expanded uncertainties, coverage factors and probabilities."""
    element = node(
        "si:realListXMLList",
        node("si:valueXMLList", " ".join(map(plain, values))),
        node("si:unitXMLList", unit),
    )
    if U:
        element.append(
            node(
                "si:measurementUncertaintyUnivariateXMLList",
                node(
                    "si:expandedMUXMLList",
                    node("si:valueExpandedMUXMLList", " ".join(map(plain, U))),
                    node("si:coverageFactorXMLList", " ".join(k)),
                    node("si:coverageProbabilityXMLList", " ".join(p)),
                    node("si:distributionXMLList", "studentT"),
                ),
            )
        )
    about = rich("dcc:description", told) if told else None
    return node("dcc:quantity", text("dcc:name", name), about, element, **({"refType": kind} if kind else {}))


def plain(number: str) -> str:
    """Return a number as the D-SI reads it: e-notation without a plus sign.

    >>> plain("1e-05"), plain("+0.5"), plain("2.50")
    ('1e-05', '0.5', '2.50')
    """
    return number.replace("e+", "e").lstrip("+")


def release(version: str) -> str:
    """Return a version as the DCC's rules want it: a letter and numbers.

    >>> release("0.1.0"), release("1.2.dev3")
    ('v0.1.0', 'v1.2')
    """
    match = re.match(r"\d{1,3}(\.\d{1,3}){0,3}", version)
    return f"v{match[0]}" if match else "v0"


# Units as the D-SI writes them: SI tokens, and the factor from the record's unit.


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
    declared = unit(text)
    if declared.dimension == "bridge_ratio":
        name = text if text in _BRIDGE else "V/V"
        factor = 1.0 if name == text else declared.factor
        return DsiUnit(tokens=((_BRIDGE[name], 1), (r"\volt", -1)) if name != "V/V" else (), factor=factor)
    return DsiUnit(tokens=_TOKENS[declared.dimension], factor=declared.factor)


def dsi_of_term(load: str, term: str, indications: Mapping[str, str]) -> DsiUnit:
    """Return the unit of a coefficient: that of the load for one unit of the term."""
    load_unit = dsi(load)
    tokens, factor = dict(load_unit.tokens), load_unit.factor
    parsed = parse_term(term)
    powers = [] if term == INTERCEPT else [*parsed.powers, *((name, 1) for name in parsed.absolutes)]
    for name, power in powers:
        indication_unit = dsi(indications[name])
        factor /= indication_unit.factor**power
        for token, size in indication_unit.tokens:
            tokens[token] = tokens.get(token, 0) - size * power
    return DsiUnit(tokens=tuple((name, size) for name, size in tokens.items() if size), factor=factor)


def _power(name: str, power: int) -> str:
    return name if power == 1 else rf"{name}\tothe{{{power}}}"
