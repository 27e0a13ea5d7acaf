"""The default template of a comparison, ``report_templates/comparison.docx``: built by code."""

from __future__ import annotations

from toolkit.report.comparison.vocabulary import FIGURES
from toolkit.report.design.blocks import Pieces, paragraph, run
from toolkit.report.design.default import build_document
from toolkit.report.design.opening import (
    QUARTER,
    WIDE,
    findings_section,
    heading,
    mark,
    page_footer,
    page_header,
    title_and_conclusion,
)


def build_comparison() -> bytes:
    """Return the default template of a comparison as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Comparison of tests", body=lambda p: [*_first(p), *_results(p)], header=_header, footer=_footer
    )


def _header(p: Pieces) -> str:
    return page_header(
        p.inline("tk:comparison.mode", "mode"),
        mark(p, "simulated", "SIMULATED") + mark(p, "unverified", "  UNVERIFIED"),
        p.inline("tk:comparison.id", "id"),
    )


def _footer(p: Pieces) -> str:
    return page_footer(p.inline("tk:comparison.issued", "date"))


def _first(p: Pieces) -> list[str]:
    return [
        *title_and_conclusion(p, "comparison"),
        p.facts([[("REFERENCE", "comparison.reference"), ("ISSUED", "comparison.issued")]], QUARTER),
        paragraph("", style="Gap"),
        p.facts(
            [
                [("CALIBRATIONS", "comparison.calibrations")],
                [("METHOD", "comparison.method")],
                [("PRECISION?", "comparison.reproducibility")],
                [("LEFT OUT?", "comparison.left_out")],
                [("SOFTWARE", "comparison.software")],
            ],
            WIDE,
        ),
        heading("What is compared"),
        p.table(
            "compared",
            "Tests and tables, as they state their conditions.",
            ["name", "tire", "surface", "pressure", "day", "operator", "mounting", "calibration"],
            ["label", "what", "surface", "pressure", "day", "operator", "mounting", "calibration"],
            [20, 33, 22, 17, 19, 19, 16, 20],
            "llllllll",
        ),
    ]


def _differences(p: Pieces, name: str, caption: str) -> str:
    return p.table(
        name,
        caption,
        ["quantity", "load", "unit", "reference", "other", "value", "difference", "p", ""],
        ["quantity", "load", "unit", "reference", "label", "other", "difference", "p", "significant"],
        [33, 14, 17, 24, 15, 24, 22, 13, 4],
        "lrlrlrrrl",
    )


def _results(p: Pieces) -> list[str]:
    return [
        heading("Characteristics against load"),
        *(p.figure(name, 150) for name in FIGURES),
        p.block(
            "tk:if.precision",
            heading("Precision")
            + p.table(
                "factors",
                "What changed between the tests (ISO 5725-3).",
                ["factor", "in the tests", "what can be said"],
                ["factor", "levels", "note"],
                [26, 74, 66],
                "lll",
            )
            + p.table(
                "precision",
                "Repeatability and intermediate precision; * where the factor adds significantly (Holm).",
                ["quantity", "load", "unit", "n", "mean", "s", "s_r", "limit r", "intermediate"],
                ["quantity", "load", "unit", "n", "mean", "s", "s_r", "limit", "intermediate"],
                [42, 14, 17, 7, 16, 14, 14, 14, 28],
                "lrlrrrrrl",
            ),
        ),
        p.block(
            "tk:if.pattern",
            heading("Pattern effect")
            + p.table(
                "pattern",
                "Pattern and body effect from a regular and a reversed belt.",
                ["PRAT", "load", "unit", "regular", "reversed", "pattern", "body"],
                ["quantity", "load", "unit", "regular", "reversed", "pattern", "body"],
                [32, 18, 16, 26, 26, 26, 26],
                "lrlrrrr",
            ),
        ),
        heading("Differences"),
        paragraph(p.inline("tk:comparison.shown", "which rows")),
        _differences(p, "differences", "Characteristics: differences from the reference."),
        p.block(
            "tk:if.curve_differences",
            _differences(p, "curve_differences", "FY and MZ at slip angles: the significant differences."),
        ),
        findings_section(p, "comparison_findings", message_mm=76),
        p.block("tk:if.no_findings", paragraph(run("No findings."))),
        paragraph(run("End of comparison ") + p.inline("tk:comparison.id", "id"), style="EndMark"),
    ]
