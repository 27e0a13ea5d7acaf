"""What templates share: lines at head and foot of a page, marks, title, widths of facts, findings.

Report, summary, certificate, comparison and audit are one house: what they share stands here once.
"""

from __future__ import annotations

from toolkit.report.design.blocks import Pieces, field, paragraph, run

WIDE = (38.0, 128.0)  # mm: a label and its text over the whole width
QUARTER = (34.0, 52.0, 31.0, 49.0)  # mm: two labels with their texts beside each other
_TAB = "<w:r><w:tab/></w:r>"


def page_header(left: str, middle: str, right: str) -> str:
    """Return a header's line; its middle is the place of marks."""
    return paragraph(left + _TAB + middle + _TAB + right, style="Header")


def page_footer(left: str, middle: str = "") -> str:
    """Return a footer's line: left, middle, and the page of the pages on the right."""
    number = run("page ") + field("PAGE") + run(" of ") + field("NUMPAGES")
    return paragraph(left + _TAB + middle + _TAB + number, style="Footer")


def mark(p: Pieces, condition: str, text: str) -> str:
    """Return a mark in red that stands where the condition holds."""
    return p.block(f"tk:if.{condition}", run(text, bold=True, style="Mark"))


def heading(text: str) -> str:
    """Return a heading of the first level."""
    return paragraph(run(text), style="Heading1")


def title_and_conclusion(p: Pieces, kind: str) -> list[str]:
    """Return title, number and conclusion of a document whose values are ``tk:<kind>.*``."""
    return [
        paragraph(p.inline(f"tk:{kind}.title", "title"), style="Title"),
        paragraph(p.inline(f"tk:{kind}.id", "id"), style="Subtitle"),
        paragraph(p.inline(f"tk:{kind}.conclusion", "conclusion")),
    ]


def findings_section(p: Pieces, name: str, *, message_mm: float) -> str:
    """Return heading and table of a document's findings, kept only where there are some."""
    return p.block(
        f"tk:if.{name}",
        heading("Findings")
        + p.table(
            name,
            "What departs from what was expected; 'toolkit explain RULE' tells more.",
            ["rule", "level", "where", "message"],
            ["rule", "level", "where", "message"],
            [34, 18, 40, message_mm],
            "llll",
        ),
    )
