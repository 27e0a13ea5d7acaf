"""Whether what a document must show is printed whatever the test has, and however long it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from toolkit.report.word.lint import LintFinding
from toolkit.report.word.pages import headers_shown
from toolkit.report.word.scan import Site, control_tag
from toolkit.report.word.xml import W_SDT, Element, Story, q


def conditions_around(element: Element) -> Iterator[str]:
    """Yield the names of the ``tk:if`` controls around an element, the nearest first."""
    for control in element.iterancestors(W_SDT):
        tag = control_tag(control)
        if tag is not None and tag.family == "if":
            yield tag.name


def unprinted(
    package: Any, parts: list[Story], sites: Sequence[Site], tags: Sequence[str]
) -> Iterator[LintFinding]:
    """Yield an error for each demanded tag that stands only where a report may not print it.

    A condition that asks for the tag itself keeps it wherever there is something to print. A header that
    depends on the number of pages alone is judged when a report is made.
    """
    sections = [
        section
        for section in package.main_document_part.element.iter(q("w:sectPr"))
        if not any(conditions_around(section))
    ]
    never, _ = headers_shown(package, parts, sections)
    for tag in tags:
        places = [site for site in sites if f"tk:{site.tag.path}" == tag]
        reasons = [_why(site, never) for site in places]
        if places and all(reasons):
            site = places[0]
            yield LintFinding(
                rule="unprinted-required", level="error", part=site.story.name, place=site.place,
                message=f"{tag} is required, and may not be printed: it stands {reasons[0]}",
            )  # fmt: skip


def _why(site: Site, never: Sequence[str]) -> str:
    path = site.tag.path
    own = (path, site.tag.name)
    condition = next((name for name in conditions_around(site.element) if name not in own), None)
    if condition is not None:
        return f"in tk:if.{condition}, which goes where the test has no such result"
    return (
        f"in {site.story.name}, which no page shows without a condition" if site.story.name in never else ""
    )
