"""The default template's title page: the source document's Figure 5.3, and a summary."""

# ruff: noqa: E501  lines of a template's text read best whole
from __future__ import annotations

from toolkit.report.design.blocks import Pieces, literal, paragraph, run


def title_page(p: Pieces) -> list[str]:
    """Return the title page: the source document's Figure 5.3, calibration, summary and report id."""
    quarter = (31.0, 52.0, 31.0, 52.0)
    return [
        paragraph(p.inline("tk:laboratory.name", "laboratory"), style="Laboratory"),
        paragraph(run("M-15 Tire Test"), style="Title"),
        paragraph(run("Force and Moment"), style="Subtitle"),
        p.block(
            "tk:if.simulated",
            paragraph(
                run("SIMULATED DATA: made by simulation, not a measurement of a tire."), style="Notice"
            ),
        ),
        p.block(
            "tk:if.unverified",
            paragraph(
                run(
                    "UNVERIFIED CALIBRATION: the record is a legacy import; its coefficients are not reproduced from "
                    "reference data."
                ),
                style="Notice",
            ),
        ),
        p.facts(
            [
                [("TIRE SIZE", "tire.size"), ("COMPANY", "tire.company")],
                [("DOT", "tire.DOT"), ("SERIES", "tire.series")],
                [("TEST PRESSURE", "test.pressure"), ("OPERATOR", "test.operator")],
                [("REQUESTOR", "test.requestor"), ("TEST DATE", "test.date")],
                [("SPECIAL?", "test.special")],
            ],
            quarter,
        ),
        paragraph("", style="Gap"),
        paragraph(run("Calibration"), style="BoxTitle"),
        p.facts(
            [
                [("RECORD", "calibration.id"), ("STATUS", "calibration.status")],
                [("SHA-256", "calibration.hash")],
            ],
            quarter,
        ),
        paragraph("", style="Gap"),
        p.block(
            "tk:if.summary.load",
            paragraph(
                run("Results at ") + p.inline("tk:summary.load", "load") + literal(" {{tk:unit.force}}"),
                style="BoxTitle",
            )
            + _summary(p, quarter),
        ),
        paragraph("", style="Gap"),
        paragraph(run("Report"), style="BoxTitle"),
        p.facts(
            [
                [("REPORT ID", "report.id"), ("ISSUED", "report.date")],
                [("TEST", "test.name"), ("DATA", "simulated")],
            ],
            quarter,
        ),
        paragraph(
            run(
                "The results relate only to the item tested, as received. The report may be reproduced only as a whole. "
                "Expanded uncertainties have a coverage probability of about 95 %."
            ),
            style="Small",
        ),
    ]


def _summary(p: Pieces, widths: tuple[float, ...]) -> str:
    def fact(label: str, name: str, unit: str) -> tuple[str, str]:
        return label, f"{{{{tk:summary.{name}.with_U}}}} {{{{tk:unit.{unit}}}}}"

    rows = [
        p.block(
            "tk:if.summary.cornering_stiffness",
            _rows(
                p,
                [
                    [
                        fact("CORNERING", "cornering_stiffness", "force_per_angle"),
                        fact("ALIGNING", "aligning_stiffness", "moment_per_angle"),
                    ]
                ],
                widths,
            ),
        ),
        p.block(
            "tk:if.summary.conicity",
            _rows(
                p,
                [
                    [fact("CONICITY", "conicity", "force"), fact("PLYSTEER", "plysteer", "force")],
                    [fact("CRAT", "CRAT", "moment"), fact("PRAT", "PRAT", "moment")],
                ],
                widths,
            ),
        ),
    ]
    outer = p.facts([], widths)
    return outer.replace("</w:tblGrid>", "</w:tblGrid>" + "".join(rows))


def _rows(p: Pieces, rows: list[list[tuple[str, str]]], widths: tuple[float, ...]) -> str:
    made = p.facts([list(row) for row in rows], widths)
    return made.partition("</w:tblGrid>")[2].removesuffix("</w:tbl>")
