"""Which fonts and characters a document asks for, and which of them this computer cannot show.

A program that prints takes another font for a character that the named one lacks, whichever has it. Where
none has, it draws an empty box, and the PDF's text still holds the character.
"""

from __future__ import annotations

import subprocess
import unicodedata
from collections.abc import Iterable, Iterator
from functools import cache

from lxml import etree

from toolkit.report.word.xml import NS, Element, Story, parser, q

# Fonts of equal metrics: a text keeps its line breaks.
_EQUAL = {
    "calibri": "carlito",
    "cambria": "caladea",
    "arial": "liberation sans",
    "helvetica": "liberation sans",
    "times new roman": "liberation serif",
    "times": "liberation serif",
    "courier new": "liberation mono",
}
_SYMBOLS = ("symbol", "wingdings", "wingdings 2", "wingdings 3", "webdings")


def _listed(element: str) -> str:
    """Return what fontconfig says of every font; nothing where it is not installed."""
    try:
        process = subprocess.run(["fc-list", ":", element], capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return process.stdout.decode("utf-8", "replace")


@cache
def installed_fonts() -> frozenset[str]:
    """Return the families that fontconfig knows, in lower case; empty where it is not installed."""
    names = _listed("family").replace("\n", ",").split(",")
    return frozenset(name.strip().lower() for name in names if name.strip())


@cache
def _covered() -> tuple[tuple[int, int], ...]:
    """Return the ranges of characters that some installed font has, both ends included."""
    spans = {span for line in _listed("charset").splitlines() for span in line.partition("=")[2].split()}
    ends = (span.partition("-") for span in spans)
    return tuple((int(first, 16), int(last or first, 16)) for first, _, last in ends)


def undrawn(characters: Iterable[str]) -> list[str]:
    """Return the characters that no installed font has, with their codes: a box is drawn for each.

    Left out are spaces, controls and marks, and what is for private use: only its own font has it.
    """
    covered = _covered()
    return [
        f"{character!r} (U+{ord(character):04X})"
        for character in sorted(set(characters))
        if covered
        and unicodedata.category(character)[0] not in "CMZ"
        and not any(first <= ord(character) <= last for first, last in covered)
    ]


def missing_fonts(package: object, parts: list[Story]) -> list[str]:
    """Return the fonts of the text and its styles that are not installed, nor one of equal metrics."""
    have = installed_fonts()
    if not have:
        return []
    named_fonts = {name for name in _wanted(package, parts) if name}
    return sorted(
        name
        for name in named_fonts
        if name.lower() not in have and _EQUAL.get(name.lower()) not in have and name.lower() not in _SYMBOLS
    )


def _wanted(package: object, parts: list[Story]) -> Iterator[str]:
    main = package.main_document_part  # type: ignore[attr-defined]
    theme = _theme(main)
    styles = {
        e.get(q("w:val"))
        for story in parts
        for tag in ("pStyle", "rStyle", "tblStyle")
        for e in story.root.iter(q(f"w:{tag}"))
    }
    for story in parts:
        for fonts in story.root.iter(q("w:rFonts")):
            yield from _names(fonts, theme)
    root = main._styles_part.element
    for style in root.iter(q("w:style"), q("w:rPrDefault")):
        default = style.tag == q("w:rPrDefault") or style.get(q("w:default")) == "1"
        if default or style.get(q("w:styleId")) in styles:
            for fonts in style.iter(q("w:rFonts")):
                yield from _names(fonts, theme)


def _names(fonts: Element, theme: dict[str, str]) -> Iterator[str]:
    for side in ("ascii", "hAnsi"):
        theme_name = fonts.get(q(f"w:{side}Theme"))
        yield theme.get(theme_name[:5], "") if theme_name else fonts.get(q(f"w:{side}")) or ""


def _theme(main: object) -> dict[str, str]:

    for rel in main.rels.values():  # type: ignore[attr-defined]
        if rel.reltype.endswith("/theme") and not rel.is_external:
            root = etree.fromstring(rel.target_part.blob, parser())
            return {
                kind: latin.get("typeface") or ""
                for kind in ("minor", "major")
                if (latin := root.find(f".//a:{kind}Font/a:latin", NS)) is not None
            }
    return {}
