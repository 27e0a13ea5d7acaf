"""The default certificate template, ``report_templates/certificate.docx``: built by code, changed in Word."""

# ruff: noqa: E501  lines of a template's text read best whole
from __future__ import annotations

import re

from toolkit.report.certificate.vocabulary import FIGURES
from toolkit.report.design.blocks import Pieces, literal, paragraph, run
from toolkit.report.design.default import build_document
from toolkit.report.design.opening import QUARTER, WIDE, heading, mark, page_footer, page_header

_UNKEPT = re.compile(r'(<w:pPr><w:pStyle w:val="[^"]*"/>)(?!<w:keepNext/>)')


def build_certificate() -> bytes:
    """Return the default certificate template as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Calibration certificate",
        body=lambda p: [*_first_page(p), *_results(p), *_statements(p)],
        header=_header,
        footer=_footer,
    )


def _header(p: Pieces) -> str:
    return page_header(
        p.inline("tk:certificate.laboratory", "laboratory"),
        mark(p, "draft", "DRAFT, NO CERTIFICATE")
        + mark(p, "simulated", "  SIMULATED")
        + mark(p, "withdrawn", "  WITHDRAWN"),
        p.inline("tk:certificate.id", "certificate id"),
    )


def _footer(p: Pieces) -> str:
    return page_footer(
        run("certificate ") + p.inline("tk:certificate.id", "certificate id"),
        run("issued ") + p.inline("tk:certificate.issued", "date"),
    )


def _kept(fragment: str) -> str:
    """Return a fragment whose every paragraph, in tables too, stays on a page with what follows it."""
    return _UNKEPT.sub(r"\1<w:keepNext/>", fragment)


def _value(p: Pieces, name: str) -> str:
    return paragraph(p.inline(f"tk:certificate.{name}", name))


def _first_page(p: Pieces) -> list[str]:
    return [
        paragraph(p.inline("tk:certificate.laboratory", "laboratory"), style="BoxTitle"),
        paragraph(p.inline("tk:certificate.address", "address"), style="Small"),
        paragraph(p.inline("tk:certificate.title", "title"), style="Title"),
        paragraph(run("No. ") + p.inline("tk:certificate.id", "certificate id"), style="Subtitle"),
        p.block(
            "tk:if.draft",
            paragraph(
                run("DRAFT: the record is not approved. This paper is not a calibration certificate."),
                style="Notice",
            ),
        ),
        p.block(
            "tk:if.simulated",
            paragraph(
                run("SIMULATED: the instrument is a virtual machine. No real load cell was calibrated."),
                style="Notice",
            ),
        ),
        p.block(
            "tk:if.withdrawn",
            paragraph(run("WITHDRAWN: ") + p.inline("tk:certificate.withdrawn", "why"), style="Notice"),
        ),
        p.block(
            "tk:if.amended",
            paragraph(
                run("This certificate replaces certificate ")
                + p.inline("tk:certificate.replaces", "replaced certificate")
                + run(". Reason: ")
                + p.inline("tk:certificate.amendment", "reason"),
                style="Notice",
            ),
        ),
        p.facts(
            [
                [("CUSTOMER", "certificate.customer")],
                [("ITEM", "certificate.item")],
                [("METHOD", "certificate.method")],
                [("PLACE", "certificate.place")],
                [("ACCREDITATION?", "certificate.accreditation")],
            ],
            WIDE,
        ),
        paragraph("", style="Gap"),
        p.facts(
            [
                [("CALIBRATED", "certificate.calibrated"), ("ISSUED", "certificate.issued")],
                [("RECEIVED?", "certificate.received")],
                [("CONDITION", "certificate.phase"), ("TEMPERATURE", "certificate.temperature")],
            ],
            QUARTER,
        ),
        paragraph("", style="Gap"),
        p.facts(
            [
                [("CALIBRATED BY", "certificate.entered_by"), ("CHECKED BY", "certificate.checked_by")],
                [("AUTHORISED BY", "certificate.approved_by")],
            ],
            QUARTER,
        ),
        p.block(
            "tk:if.gaps",
            paragraph(run("Not stated: ") + p.inline("tk:certificate.not_stated", "gaps"), style="Small"),
        ),
        paragraph(
            run(
                "The results relate only to the items calibrated. The certificate may be reproduced only as a whole, except with the laboratory's written approval."
            ),
            style="Small",
        ),
    ]


def _results(p: Pieces) -> list[str]:
    return [
        heading("1  Items and reference"),
        p.table(
            "cells",
            "Load cells and the range of their indications during the calibration.",
            ["cell", "serial", "unit", "minimum", "maximum", "resolution"],
            ["cell", "serial", "unit", "minimum", "maximum", "resolution"],
            [26, 44, 24, 24, 24, 24],
            "lllrrr",
        ),
        _value(p, "traceability"),
        heading("2  Expanded uncertainty"),
        _value(p, "uncertainty"),
        # U is read as a whole: the table does not break where a page can hold it.
        _kept(
            p.table(
                "uncertainty",
                "Expanded uncertainty over the calibrated range and at full scale.",
                ["load", "value", "% of full scale", "U", "unit", "k", "p [%]", "dof"],
                ["load", "at", "percent_fs", "U", "unit", "k", "p", "dof"],
                [16, 26, 26, 24, 22, 16, 16, 20],
                "lrrrlrrr",
            )
        ),
        heading("3  Calibration equation"),
        _value(p, "model"),
        p.table(
            "coefficients",
            "Coefficients in full precision and as issued.",
            ["load", "term", "coefficient", "as issued", "standard error", "unit"],
            ["load", "term", "full", "issued", "standard_error", "unit"],
            [14, 28, 46, 28, 24, 26],
            "llrrrl",
        ),
        p.table(
            "fit",
            "Reference loads and the residuals of the equation.",
            ["load", "unit", "from", "to", "points", "dof", "residual sd", "largest residual"],
            ["load", "unit", "minimum", "maximum", "n", "dof", "residual_sd", "largest"],
            [16, 18, 22, 22, 16, 16, 26, 30],
            "llrrrrrr",
        ),
        *(p.figure(name, 160) for name in FIGURES),
        heading("4  Check loads and conformity"),
        p.table(
            "check",
            "Check loads, which were not part of the fit: the load from the equation against the reference.",
            ["load", "no.", "reference", "result", "deviation", "U", "tolerance", "unit", "statement"],
            ["load", "row", "reference", "result", "deviation", "U", "tolerance", "unit", "verdict"],
            [12, 11, 25, 23, 21, 18, 20, 14, 22],
            "lrrrrrrll",
        ),
        paragraph(
            run("Decision rule. ", bold=True) + p.inline("tk:certificate.decision_rule", "decision rule")
        ),
        paragraph(run("Conformity. ", bold=True) + p.inline("tk:certificate.conformity", "conformity")),
        _value(p, "unverifiable"),
        p.table(
            "unverifiable",
            "Terms that the check loads could not verify.",
            ["load", "term"],
            ["load", "term"],
            [30, 60],
            "ll",
        ),
    ]


def _statements(p: Pieces) -> list[str]:
    return [
        heading("5  Before and after adjustment"),
        _value(p, "adjustment"),
        p.table(
            "adjustment",
            "Largest deviations as found, by the record then in force, and as left.",
            ["load", "record", "at load", "as found", "U", "as left", "U", "tolerance", "unit"],
            ["load", "found_by", "at", "as_found", "U_found", "as_left", "U_left", "tolerance", "unit"],
            [12, 32, 18, 21, 17, 21, 17, 18, 14],
            "llrrrrrrl",
        ),
        heading("6  Uncertainty budget at full scale"),
        p.table(
            "budget",
            "Standard uncertainties of the components and their shares of the variance.",
            ["load", "component", "type", "distribution", "u", "unit", "dof", "share [%]"],
            ["load", "component", "evaluation", "distribution", "u", "unit", "dof", "share"],
            [16, 36, 14, 26, 24, 18, 16, 16],
            "llllrlrr",
        ),
        p.block(
            "tk:if.certificate.opinions",
            heading("7  Opinions and interpretations")
            + paragraph(
                run("Opinion, not a result: ", bold=True) + p.inline("tk:certificate.opinions", "opinion")
            ),
        ),
        p.block("tk:if.interval_agreed", heading("Agreed with the customer") + _value(p, "interval")),
        # The end mark never stands on a page of its own.
        _kept(
            heading("Record")
            + paragraph(
                literal(
                    "Made by {{tk:certificate.software}} from calibration record {{tk:certificate.record}} of {{tk:certificate.instrument}}, made with {{tk:certificate.record_software}}."
                )
            )
            + p.facts(
                [
                    [("RECORD SHA-256", "certificate.record_hash")],
                    [("LEDGER HEAD", "certificate.ledger_head")],
                ],
                WIDE,
            )
        ),
        paragraph(
            run("End of certificate ") + p.inline("tk:certificate.id", "certificate id"), style="EndMark"
        ),
    ]
