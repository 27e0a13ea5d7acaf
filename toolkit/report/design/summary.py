"""The one-page summary: the tire, its characteristics at one load, two curves, pull, and where it all comes from."""

# ruff: noqa: E501  lines of a template's text read best whole
from __future__ import annotations

from toolkit.report.design.blocks import Pieces, cell, field, literal, paragraph, row, run, table
from toolkit.report.design.default import build_document
from toolkit.report.design.pieces import across

_MARGINS = (20.0, 18.0, 16.0, 18.0)
_WIDE = 174.0
_HALF = _WIDE / 2


def build_summary() -> bytes:
    """Return the summary's template as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Tire force and moment test, summary",
        body=_body,
        header=_header,
        footer=_footer,
        margins_mm=_MARGINS,
    )


def _body(p: Pieces) -> list[str]:
    force, moment = "{{tk:unit.force}}", "{{tk:unit.moment}}"
    return [
        paragraph(run("Force and moment test ") + p.inline("tk:tire.size", "tire"), style="Heading1"),
        p.block(
            "tk:if.simulated",
            paragraph(
                run("SIMULATED DATA: made by simulation, not a measurement of a tire."), style="Notice"
            ),
        ),
        p.block(
            "tk:if.unverified",
            paragraph(run("UNVERIFIED CALIBRATION: the record is a legacy import."), style="Notice"),
        ),
        p.facts(
            [
                [("ITEM?", "item.description")],
                [("TEST", "test.name"), ("DATE", "test.date")],
                [("CUSTOMER", "report.customer"), ("OPERATOR", "test.operator")],
                [("PRESSURE?", "test.pressure")],
                [("LOADS", "test.loads")],
            ],
            (27.0, 60.0, 27.0, 60.0),
        ),
        p.block(
            "tk:if.summary.load",
            paragraph(
                run("At ")
                + p.inline("tk:summary.load", "load")
                + literal(f" {force}, with expanded uncertainty (95 %)"),
                style="BoxTitle",
            )
            + _figures_of_merit(),
        ),
        paragraph("", style="Gap"),
        table(
            row(
                cell(p.picture("fy_vs_slip", _HALF - 4), _HALF, style="Figure")
                + cell(p.picture("mz_vs_slip", _HALF - 4), _HALF, style="Figure")
            ),
            (_HALF, _HALF),
            rules="none",
        ),
        p.block(
            "tk:if.pull",
            p.table(
                "pull",
                "Pull by symmetry of the forward and the reversed run.",
                [
                    f"load [{force}]",
                    f"conicity [{force}]",
                    f"plysteer [{force}]",
                    f"CRAT [{moment}]",
                    f"PRAT [{moment}]",
                ],
                ["load", "conicity ± U_conicity", "plysteer ± U_plysteer", "CRAT ± U_CRAT", "PRAT ± U_PRAT"],
                [26, 37, 37, 37, 37],
                "rrrrr",
            ),
        ),
        paragraph(
            literal(
                "{{tk:test.conditions}} conditions of {{tk:test.files}} recordings; {{tk:test.findings}} findings. Forces and moments by "
                "calibration record {{tk:calibration.id}} ({{tk:calibration.status}}), SHA-256 {{tk:calibration.hash}}. All results in "
                "{{tk:test.axes}} axes. They relate only to the item tested, as received. This page is an extract; the whole report has the same id."
            ),
            style="TableText",
        ),
        paragraph(run("End of summary ") + p.inline("tk:report.id", "report id"), style="TableText"),
    ]


def _figures_of_merit() -> str:
    def value(name: str, unit: str) -> str:
        return f"{{{{tk:summary.{name}.with_U}}}} {{{{tk:unit.{unit}}}}}"

    shown = (
        ("cornering stiffness", "cornering_stiffness", "force_per_angle"),
        ("aligning stiffness", "aligning_stiffness", "moment_per_angle"),
        ("conicity", "conicity", "force"),
        ("plysteer", "plysteer", "force"),
        ("CRAT", "CRAT", "moment"),
        ("PRAT", "PRAT", "moment"),
    )
    third = _WIDE / 3
    rows = [
        row(
            "".join(
                cell(run(f"{label}  ", bold=True) + literal(value(name, unit)), third, style="TableText")
                for label, name, unit in shown[at : at + 3]
            )
        )
        for at in (0, 3)
    ]
    return table("".join(rows), (third, third, third), rules="box")


def _header(p: Pieces) -> str:
    sides = cell(p.inline("tk:laboratory.name", "laboratory"), _HALF, style="Header") + cell(
        p.inline("tk:report.id", "report id"), _HALF, style="Header", align="r"
    )
    return across(sides, (_HALF, _HALF))


def _footer(p: Pieces) -> str:
    page = run("page ") + field("PAGE") + run(" of ") + field("NUMPAGES")
    sides = cell(run("issued ") + p.inline("tk:report.date", "date"), _HALF, style="Footer") + cell(
        page, _HALF, style="Footer", align="r"
    )
    return across(sides, (_HALF, _HALF))
