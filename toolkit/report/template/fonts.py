"""Which fonts a template asks for, and which of them this machine cannot show as they are."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from functools import cache

from toolkit.report.template.xml import NS, Element, Story, q

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


@cache
def installed_fonts() -> frozenset[str]:
    """Return the families that fontconfig knows, in lower case; empty where it is not installed."""
    try:
        done = subprocess.run(["fc-list", ":", "family"], capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return frozenset()
    text = done.stdout.decode("utf-8", "replace").replace("\n", ",")
    return frozenset(name.strip().lower() for name in text.split(",") if name.strip())


def missing_fonts(package: object, parts: list[Story]) -> list[str]:
    """Return the fonts of the text and its styles that are not installed, nor one of equal metrics."""
    have = installed_fonts()
    if not have:
        return []
    wanted = {name for name in _wanted(package, parts) if name}
    return sorted(
        name
        for name in wanted
        if name.lower() not in have and _EQUAL.get(name.lower()) not in have and name.lower() not in _SYMBOLS
    )


def _wanted(package: object, parts: list[Story]) -> Iterator[str]:
    main = package.main_document_part  # type: ignore[attr-defined]
    theme = _theme(main)
    used = {
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
        if default or style.get(q("w:styleId")) in used:
            for fonts in style.iter(q("w:rFonts")):
                yield from _names(fonts, theme)


def _names(fonts: Element, theme: dict[str, str]) -> Iterator[str]:
    for side in ("ascii", "hAnsi"):
        named = fonts.get(q(f"w:{side}Theme"))
        yield theme.get(named[:5], "") if named else fonts.get(q(f"w:{side}")) or ""


def _theme(main: object) -> dict[str, str]:
    from lxml import etree

    from toolkit.report.template.xml import parser

    for rel in main.rels.values():  # type: ignore[attr-defined]
        if rel.reltype.endswith("/theme") and not rel.is_external:
            root = etree.fromstring(rel.target_part.blob, parser())
            return {
                kind: latin.get("typeface") or ""
                for kind in ("minor", "major")
                if (latin := root.find(f".//a:{kind}Font/a:latin", NS)) is not None
            }
    return {}
