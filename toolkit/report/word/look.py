"""How a tag's text will look by a template's own properties, and whether people could read it.

Only what the tag's run, styles and surroundings state is read; what the printed page shows is judged once
more when a report is made (`toolkit.report.word.legible`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from lxml import etree

from toolkit.report.content import SIGNATURE
from toolkit.report.style import Style
from toolkit.report.vocabulary import Vocabulary
from toolkit.report.word.controls import TC_PR, run_properties
from toolkit.report.word.lint import LintFinding
from toolkit.report.word.scan import LITERAL, Site, visible_texts
from toolkit.report.word.styles import paragraph_styles, style_chain, style_defaults
from toolkit.report.word.xml import P_PR, R_PR, W_P, W_R, W_TC, Element, ancestor, parser, q, switch_is_on

LEAST_SIZE = 7  # half-points
_LEAST_SCALE = 30  # percent
_LEAST_LINE = 80  # twips, of a line of exact height
_CONTRAST = 1.5
_HIDDEN = ("w:vanish", "w:webHidden", "w:specVanish")
_HEX = re.compile(r"[0-9A-Fa-f]{6}")
_DEFAULT_SIZE = 20  # half-points, of a document that states none
# Names of theme colours in a document -> in the theme.
_THEME = {
    "text1": "dk1", "dark1": "dk1", "text2": "dk2", "dark2": "dk2", "background1": "lt1", "light1": "lt1",
    "background2": "lt2", "light2": "lt2", "hyperlink": "hlink", "followedHyperlink": "folHlink",
}  # fmt: skip
_HIGHLIGHTS = {
    "black": "000000", "blue": "0000FF", "cyan": "00FFFF", "green": "00FF00", "magenta": "FF00FF",
    "red": "FF0000", "yellow": "FFFF00", "white": "FFFFFF", "darkBlue": "000080", "darkCyan": "008080",
    "darkGreen": "008000", "darkMagenta": "800080", "darkRed": "800000", "darkYellow": "808000",
    "darkGray": "808080", "lightGray": "C0C0C0",
}  # fmt: skip


def must_be_read(vocabulary: Vocabulary, style: Style) -> frozenset[str]:
    """Return the tags whose text a reader must not miss: required ones, those of marks, the signatures."""
    marks = {f"tk:{path}" for paths in vocabulary.marks.values() for path in paths}
    return frozenset({*vocabulary.demanded(style.required), *marks, f"tk:{SIGNATURE}"})


def unreadable(package: Any, sites: list[Site], tags: frozenset[str]) -> Iterator[LintFinding]:
    """Yield an error for each of the tags that stands in no place where it could be read."""
    looks = _Looks(package)
    reasons: dict[str, list[tuple[Site, str]]] = {}
    for site in sites:
        if f"tk:{site.tag.path}" in tags:
            reasons.setdefault(f"tk:{site.tag.path}", []).append((site, looks.why(site)))
    for tag, places in reasons.items():
        site, why = places[0]
        if all(reason for _, reason in places):
            message = f"{tag} could not be read in the report: {why}"
            yield LintFinding(
                rule="unreadable-tag", level="error", part=site.story.name, place=site.place, message=message
            )


@dataclass(slots=True)
class _Looks:
    """The styles, defaults and theme of a document."""

    package: Any

    def why(self, site: Site) -> str:
        """Return why the text of a tag could not be read, empty where nothing is seen against it."""
        properties = [*self._of_run(site)]
        paragraph = site.element if site.element.tag == W_P else ancestor(site.element, W_P)
        paragraph = next(site.element.iter(W_P), None) if paragraph is None else paragraph
        styles = [] if paragraph is None else [*self._of_paragraph(paragraph)]
        for name in _HIDDEN:
            if (hidden := self._first(name, properties)) is not None and switch_is_on(hidden):
                return f"its text is hidden ({name})"
        size = self._number("w:sz", properties, _DEFAULT_SIZE)
        if size < LEAST_SIZE:
            return f"its letters are {size / 2:g} pt high"
        if (scale := self._number("w:w", properties, 100)) < _LEAST_SCALE:
            return f"its letters are {scale:g} % wide"
        spacing = self._first("w:spacing", styles)
        if spacing is not None and spacing.get(q("w:lineRule")) == "exact":
            line = _number(spacing.get(q("w:line")), 240)
            if line < _LEAST_LINE:
                return f"its line is {line / 20:g} pt high"
        colour = self._colour(self._first("w:color", properties), "val")
        behind = self._behind(properties, styles, paragraph)
        if colour is not None and _ratio(colour, behind) < _CONTRAST:
            return f"its colour is {colour} on {behind}"
        return ""

    def _of_run(self, site: Site) -> Iterator[Element]:
        """Yield the run properties that hold for a tag, the nearest first."""
        own, paragraph = self._own_run(site)
        if own is not None:
            yield own
            named = own.find(q("w:rStyle"))
            if named is not None:
                yield from style_chain(self.package, named.get(q("w:val")), R_PR)
        if paragraph is not None:
            yield from paragraph_styles(self.package, paragraph, R_PR)
        yield from style_defaults(self.package, "w:rPrDefault", R_PR)

    def _own_run(self, site: Site) -> tuple[Element | None, Element | None]:
        if site.form == "control":
            paragraph = ancestor(site.element, W_P)
            inner = next(site.element.iter(W_P), None)
            return run_properties(site.element), inner if paragraph is None else paragraph
        texts, at = visible_texts(site.element), 0
        joined = "".join(text.text or "" for text in texts)
        begin = next(
            (m.start() for m in LITERAL.finditer(joined) if m[1].partition("|")[0] == f"tk:{site.tag.path}"),
            0,
        )
        for text in texts:
            at += len(text.text or "")
            if begin < at:
                run = ancestor(text, W_R)
                return (None if run is None else run.find(R_PR)), site.element
        return None, site.element

    def _of_paragraph(self, paragraph: Element) -> Iterator[Element]:
        own = paragraph.find(P_PR)
        if own is not None:
            # A line of exact height is set free where a value stands (`pictures.free_height`).
            spacing = own.find(q("w:spacing"))
            if spacing is None or spacing.get(q("w:lineRule")) != "exact":
                yield own
        yield from paragraph_styles(self.package, paragraph, P_PR)
        yield from style_defaults(self.package, "w:pPrDefault", P_PR)

    def _first(self, name: str, properties: list[Element]) -> Element | None:
        return next((e for p in properties if (e := p.find(q(name))) is not None), None)

    def _number(self, name: str, properties: list[Element], default: float) -> float:
        element = self._first(name, properties)
        return default if element is None else _number(element.get(q("w:val")), default)

    def _behind(self, properties: list[Element], styles: list[Element], paragraph: Element | None) -> str:
        """Return the colour behind a text: its highlight, or the shading of run, paragraph or cell."""
        highlight = self._first("w:highlight", properties)
        if highlight is not None and (highlight.get(q("w:val")) or "none") in _HIGHLIGHTS:
            return _HIGHLIGHTS[highlight.get(q("w:val"))]
        own = None if paragraph is None else paragraph.find(P_PR)
        cells = [] if paragraph is None else [cell.find(TC_PR) for cell in paragraph.iterancestors(W_TC)]
        for place in ([*properties], [own, *styles], cells):
            shading = self._first("w:shd", [p for p in place if p is not None])
            if shading is not None and (fill := self._colour(shading, "fill")) is not None:
                return fill
        return "FFFFFF"

    def _colour(self, element: Element | None, key: str) -> str | None:
        """Return a colour in six digits; None where it follows from what is behind it."""
        if element is None:
            return None
        themed = element.get(q("w:themeColor" if key == "val" else "w:themeFill"))
        value = element.get(q(f"w:{key}")) or "auto"
        if _HEX.fullmatch(value):
            return str(value).upper()  # Word writes what a theme's colour comes to beside its name
        return None if themed is None else self._theme().get(_THEME.get(themed, themed))

    def _theme(self) -> dict[str, str]:
        for rel in self.package.main_document_part.rels.values():
            if rel.reltype.endswith("/theme") and not rel.is_external:
                root = etree.fromstring(rel.target_part.blob, parser())
                return {
                    entry.tag.rpartition("}")[2]: colour.get("lastClr") or colour.get("val") or ""
                    for scheme in root.iter("{*}clrScheme")
                    for entry in scheme
                    for colour in entry
                    if _HEX.fullmatch(colour.get("lastClr") or colour.get("val") or "")
                }
        return {}


def _number(text: str | None, default: float) -> float:
    try:
        return float((text or "").removesuffix("%") or default)
    except ValueError:
        return default


def _ratio(colour: str, other: str) -> float:
    """Return the contrast of two colours, by WCAG 2: 1 to 21.

    >>> round(_ratio("000000", "FFFFFF")), _ratio("FFFFFF", "FFFFFF")
    (21, 1.0)
    """
    low, high = sorted(map(_luminance, (colour, other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    levels = (int(colour[at : at + 2], 16) / 255 for at in (0, 2, 4))
    linear = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in levels]
    return sum(weight * one for weight, one in zip((0.2126, 0.7152, 0.0722), linear, strict=True))
