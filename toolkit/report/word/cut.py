"""Conditions that cut in two what they stand around: a field, a section.

Where a condition is not fulfilled, its control goes with all that is in it. Half a field left behind takes
all the text after it; a section's break that goes alone gives its pages the paper of the next section.
"""

from __future__ import annotations

from collections.abc import Iterator

from toolkit.report.word.lint import LintFinding, at_element
from toolkit.report.word.scan import Site
from toolkit.report.word.xml import SDT_CONTENT, W_P, W_SDT, W_TBL, Element, ancestor, q

_CHANGES = {"begin": 1, "end": -1}
_BLOCKS = (W_P, W_TBL, W_SDT)


def cut_in_two(sites: list[Site]) -> Iterator[LintFinding]:
    """Yield an error for each condition that holds a part of a field, or the break of a section it is in."""
    for site in sites:
        if site.tag.family != "if" or site.form != "control":
            continue
        if _holds_half_a_field(site.element):
            message = (
                f"{site.tag} holds one end of a field, and the other is outside: take the whole field in"
            )
            yield at_element("cut-by-condition", site.story, site.element, message, "error")
        if _holds_the_break_of_what_is_before(site.element):
            message = (
                f"{site.tag} holds the break of a section that begins before it: without it the section "
                "takes the paper and the headers of the next one: take the whole section in, or none of it"
            )
            yield at_element("cut-by-condition", site.story, site.element, message, "error")


def _holds_half_a_field(control: Element) -> bool:
    depth = 0
    for mark in control.iter(q("w:fldChar")):
        kind = mark.get(q("w:fldCharType")) or ""
        if depth == 0 and kind != "begin":
            return True
        depth += _CHANGES.get(kind, 0)
    return depth != 0


def _holds_the_break_of_what_is_before(control: Element) -> bool:
    if next(_breaks(control), None) is None:
        return False
    before = _block_before(control)
    return before is not None and not _ends_a_section(before)


def _breaks(element: Element) -> Iterator[Element]:
    return (section for section in element.iter(q("w:sectPr")) if ancestor(section, W_P) is not None)


def _block_before(control: Element) -> Element | None:
    """Return what stands before a control in the body, through the controls around it."""
    element = control
    while element is not None:
        for sibling in element.itersiblings(preceding=True):
            if sibling.tag in _BLOCKS:
                return sibling
        element = element.getparent()
        if element is None or element.tag not in (SDT_CONTENT, W_SDT):
            return None
    return None


def _ends_a_section(block: Element) -> bool:
    """Tell whether a block ends with a section's break; a control's properties are none."""
    paragraphs = [block] if block.tag == W_P else list(block.iter(W_P))
    return bool(paragraphs) and next(_breaks(paragraphs[-1]), None) is not None
