"""The default template of an audit's summary, ``report_templates/audit.docx``: built by code."""

from __future__ import annotations

from collections.abc import Sequence

from toolkit.report.design.blocks import Pieces, paragraph, run
from toolkit.report.design.default import build_document
from toolkit.report.design.opening import (
    QUARTER,
    WIDE,
    heading,
    page_footer,
    page_header,
    title_and_conclusion,
)


def build_audit() -> bytes:
    """Return the default template of an audit's summary as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Audit of an archive", body=lambda p: [*_first(p), *_results(p)], header=_header, footer=_footer
    )


def _header(p: Pieces) -> str:
    return page_header(p.inline("tk:audit.title", "title"), "", p.inline("tk:audit.id", "id"))


def _footer(p: Pieces) -> str:
    return page_footer(run("as known on ") + p.inline("tk:audit.known_at", "date"))


def _first(p: Pieces) -> list[str]:
    return [
        *title_and_conclusion(p, "audit"),
        p.facts(
            [
                [("FILES", "audit.files"), ("AS KNOWN ON", "audit.known_at")],
                [("RIGHT", "audit.right"), ("NOT RIGHT", "audit.not_right")],
                [("UNREADABLE", "audit.unreadable"), ("WITHOUT A DATE", "audit.undated")],
            ],
            QUARTER,
        ),
        paragraph("", style="Gap"),
        p.facts(
            [
                [("LEDGERS", "audit.heads")],
                [("LEFT OUT?", "audit.refused")],
                [("REPORTS?", "audit.reports")],
                [("SINCE GOOD?", "audit.since_good")],
                [("SOFTWARE", "audit.software")],
            ],
            WIDE,
        ),
    ]


def _results(p: Pieces) -> list[str]:
    return [
        _titled(
            p,
            "Grades",
            "audit_grades",
            "Files by their grade, the first that applies.",
            ["grade", "files", "%", "what it means"],
            ["grade", "files", "share", "meaning"],
            [30, 18, 18, 100],
            "lrrl",
        ),
        p.figure("audit_years", 150),
        _titled(
            p,
            "Tests that change most",
            "audit_tests",
            "Largest changes by the record in force: of any row, and of the characteristics at any load.",
            [
                "test",
                "date",
                "not right",
                "Fy [N]",
                "Mz [N·m]",
                "stiffness [%]",
                "conicity [N]",
                "plysteer [N]",
            ],
            ["test", "date", "files", "FY", "MZ", "stiffness", "conicity", "plysteer"],
            [34, 22, 18, 18, 18, 20, 18, 18],
            "llrrrrrr",
        ),
        p.block(
            "tk:if.reports_to_amend",
            heading("Reports that rest on them")
            + p.table(
                "audit_reports",
                "Reports to be amended (ISO/IEC 17025:2017, 7.8.8).",
                ["report", "linked by", "tests", "not right"],
                ["report", "linked_by", "tests", "files"],
                [58, 26, 58, 24],
                "lllr",
            ),
        ),
        _titled(
            p,
            "Findings",
            "audit_findings",
            "What was found, by rule.",
            ["rule", "count", "what it means", "what to do"],
            ["rule", "count", "means", "do"],
            [36, 14, 60, 56],
            "lrll",
        ),
    ]


def _titled(
    p: Pieces,
    title: str,
    name: str,
    caption: str,
    head: Sequence[str],
    cells: Sequence[str],
    widths_mm: Sequence[float],
    align: str,
) -> str:
    # A heading goes with its table where that has no row: no file, no dated test, nothing found.
    table = p.table(name, caption, head, cells, widths_mm, align)
    return p.block(f"tk:if.{name}", heading(title) + table)
