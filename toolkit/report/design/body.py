"""The default template's chapters."""

# ruff: noqa: E501  lines of a template's text read best whole
from __future__ import annotations

from toolkit.report.design.blocks import Pieces, literal, paragraph, run
from toolkit.report.design.budget import budget_table
from toolkit.report.design.diagnosis import diagnosis_section
from toolkit.report.design.models import models_section
from toolkit.report.design.opening import WIDE, heading
from toolkit.report.design.pieces import contents


def chapters(p: Pieces) -> list[str]:
    """Return the chapters, from the test's facts to the end mark."""

    def text(words: str, *, keep: bool = False) -> str:
        return paragraph(literal(words), keep=keep)

    force, moment = "{{tk:unit.force}}", "{{tk:unit.moment}}"
    stiff = "{{tk:unit.force_per_angle}}", "{{tk:unit.moment_per_angle}}"
    return [
        contents("Contents").replace("</w:pPr>", "<w:pageBreakBefore/></w:pPr>", 1),
        heading("1  Item, customer and method"),
        p.facts(
            [
                [("REPLACES?", "report.amends")],
                [("REASON?", "report.amendment")],
                [("CUSTOMER?", "report.customer")],
                [("CONTACT?", "report.customer_contact")],
                [("ITEM?", "item.description")],
                [("CONDITION?", "item.condition")],
                [("RECEIVED?", "item.received")],
                [("TESTED?", "test.date")],
                [("LOCATION?", "report.location")],
                [("METHOD?", "report.method")],
                [("DEVIATIONS", "report.deviations")],
                [("SAMPLING?", "report.sampling")],
                [("CONFORMITY?", "report.conformity")],
                [("EXTERNAL?", "report.external")],
            ],
            WIDE,
        ),
        heading("2  Test"),
        p.facts(
            [
                [("MACHINE", "test.machine")],
                [("SURFACE?", "test.surface")],
                [("RIM?", "tire.rim")],
                [("CONSTRUCTION?", "tire.construction")],
                [("LOADS", "test.loads")],
                [("SLIP ANGLES?", "test.slip_angles")],
                [("DIRECTIONS", "test.directions")],
                [("AVERAGING", "test.averaging")],
                [("TARE", "test.tare")],
                [("AXES", "test.axes")],
            ],
            WIDE,
        ),
        paragraph("", style="Gap"),
        p.block("tk:if.test.speed", text("The drum's surface ran at {{tk:test.speed}} km/h.")),
        text(
            "{{tk:test.files}} recordings gave {{tk:test.conditions}} conditions. Every force and moment was computed from "
            "the load cells by calibration record {{tk:calibration.id}}; all results are in {{tk:test.axes}} axes: z down, "
            "y to the right, a positive slip angle gives a negative lateral force and a positive aligning moment."
        ),
        heading("3  Lateral force and aligning moment"),
        p.figure("fy_vs_slip", 150),
        p.figure("mz_vs_slip", 150),
        p.figure("fy_vs_load", 150),
        p.figure("mz_vs_load", 150),
        p.figure("gough", 150),
        p.block(
            "tk:if.stiffness",
            heading("4  Cornering and aligning stiffness")
            + text(
                "Both are positive in SAE axes. The secant runs through the ±1 deg steps, as the source standard has it; "
                "the slope is that of the fitted curve at 0 deg.",
                keep=True,
            )
            + p.figure("cornering_stiffness", 150)
            + p.figure("aligning_stiffness", 150)
            + p.table(
                "stiffness",
                "Cornering and aligning stiffness with expanded uncertainties (95 %).",
                [
                    f"load [{force}]",
                    "direction",
                    f"cornering, secant [{stiff[0]}]",
                    f"cornering, slope [{stiff[0]}]",
                    f"aligning, secant [{stiff[1]}]",
                    f"aligning, slope [{stiff[1]}]",
                ],
                [
                    "load",
                    "rotation",
                    "cornering_secant ± U_cornering_secant",
                    "cornering_slope ± U_cornering_slope",
                    "aligning_secant ± U_aligning_secant",
                    "aligning_slope ± U_aligning_slope",
                ],
                [20, 22, 31, 31, 31, 31],
                "rlrrrr",
            ),
        ),
        heading("5  Pull"),
        p.block(
            "tk:if.no_pull",
            text("The test has no pull characteristics: they need a forward and a reversed run."),
        ),
        p.block(
            "tk:if.pull",
            text(
                "From the forward and the reversed run at slip angle zero, read off each direction's own curve at a common "
                "load. To the machine's cells conicity keeps its sign when the drum is reversed and changes it when the tire "
                "is turned round on the hub; plysteer the other way round.",
                keep=True,
            )
            + p.figure("conicity", 150)
            + p.figure("plysteer", 150)
            + p.figure("crat", 150)
            + p.figure("prat", 150)
            + p.table(
                "pull",
                "Pull characteristics by symmetry with expanded uncertainties (95 %).",
                [
                    f"load [{force}]",
                    f"conicity [{force}]",
                    f"plysteer [{force}]",
                    f"CRAT [{moment}]",
                    f"PRAT at 0 deg [{moment}]",
                    f"PRAT at FY = 0 [{moment}]",
                ],
                [
                    "load",
                    "conicity ± U_conicity",
                    "plysteer ± U_plysteer",
                    "CRAT ± U_CRAT",
                    "PRAT ± U_PRAT",
                    "PRAT_at_FY_zero ± U_PRAT_at_FY_zero",
                ],
                [22, 28, 28, 28, 30, 30],
                "rrrrrr",
                together=True,
            )
            + p.table(
                "pull_thesis",
                "CRAT and PRAT by the formulas of the machine's source document, which pair the directions "
                "the other way round, and the moment at zero lateral force of each direction by itself.",
                [
                    f"load [{force}]",
                    f"CRAT, source [{moment}]",
                    f"PRAT, source [{moment}]",
                    f"PRAT at FY = 0, source [{moment}]",
                    f"residual, forward [{moment}]",
                    f"residual, reverse [{moment}]",
                ],
                [
                    "load",
                    "thesis_CRAT ± U_thesis_CRAT",
                    "thesis_PRAT ± U_thesis_PRAT",
                    "thesis_PRAT_at_FY_zero ± U_thesis_PRAT_at_FY_zero",
                    "residual_forward ± U_residual_forward",
                    "residual_reverse ± U_residual_reverse",
                ],
                [18, 29, 29, 32, 29, 29],
                "rrrrrr",
                together=True,
            ),
        ),
        p.block(
            "tk:if.fits",
            heading("6  Fitted curves")
            + text(
                "Magic Formula y = D sin(C arctan(Bx - E(Bx - arctan Bx))) + Sv with x = SA + Sh, one curve a load. D and Sv "
                "are in the channel's unit; below each parameter stands its standard error, n/a where the data do not "
                "determine it. The error is 100 √(Σ(model - measured)² / Σ measured²); the floor is the same for the "
                "measurements about their means."
            )
            + p.table(
                "fits",
                "Parameters of the fitted curves.",
                [
                    "",
                    "direction",
                    f"load [{force}]",
                    "B [1/rad]",
                    "C",
                    "D",
                    "E",
                    "Sh [deg]",
                    "Sv",
                    "error [%]",
                    "floor [%]",
                ],
                [
                    "channel",
                    "rotation",
                    "load",
                    "B ± u_B",
                    "C ± u_C",
                    "D ± u_D",
                    "E ± u_E",
                    "Sh ± u_Sh",
                    "Sv ± u_Sv",
                    "error",
                    "floor",
                ],
                [9, 17, 16, 17, 14.5, 18.5, 15, 15, 16, 14, 14],
                "llrrrrrrrrr",
            ),
        ),
        models_section(p),
        heading("7  Calibration"),
        p.table(
            "calibration",
            "Coefficients of the calibration record.",
            ["load", "term", "coefficient", "as issued", "standard error", "unit"],
            ["load", "term", "coefficient", "issued", "standard_error", "unit"],
            [16, 26, 30, 30, 30, 34],
            "llrrrl",
        ),
        p.table(
            "acquisition",
            "The acquisition program's own values against this report's: largest differences a file.",
            ["recording", f"FY [{force}]", f"MZ [{moment}]"],
            ["file", "FY_difference", "MZ_difference"],
            [90, 38, 38],
            "lrr",
        ),
        heading("8  Findings"),
        p.block("tk:if.no_findings", text("There are no findings.")),
        p.table(
            "findings",
            "Departures from what was expected.",
            ["rule", "level", "where", "finding"],
            ["rule", "level", "where", "message"],
            [30, 16, 36, 84],
            "llll",
        ),
        heading("9  Measured conditions"),
        p.table(
            "results",
            "Means of the load blocks as measured; U: expanded uncertainty (k = 2) from every source of the budget.",
            [
                "direction",
                "SA [deg]",
                f"FZ [{force}]",
                f"FY [{force}]",
                f"U [{force}]",
                f"MZ [{moment}]",
                f"U [{moment}]",
                "recording",
            ],
            ["rotation", "SA", "FZ", "FY", "U_FY", "MZ", "U_MZ", "file"],
            [19, 17, 19, 20, 17, 20, 17, 37],
            "lrrrrrrl",
        ),
        budget_table(p),
        heading("10  Provenance"),
        text(
            "Made by {{tk:software.name}} {{tk:software.version}} from the recordings below and calibration record "
            "{{tk:calibration.id}}, SHA-256 {{tk:calibration.hash}}."
        ),
        p.table(
            "files",
            "Recordings and their SHA-256.",
            ["recording", "direction", "SHA-256"],
            ["file", "rotation", "sha256"],
            [36, 20, 110],
            "lll",
        ),
        diagnosis_section(p),
        p.block(
            "tk:if.opinions",
            heading("Opinions and interpretations")
            + text(
                "What follows are opinions and interpretations (ISO/IEC 17025, 7.8.7). They are not results of the test, "
                "and no uncertainty is stated for them."
            )
            + p.table(
                "opinions",
                "Opinions and interpretations, and what they rest on.",
                ["opinion or interpretation", "basis"],
                ["statement", "basis"],
                [96, 70],
                "ll",
            ),
        ),
        p.block(
            "tk:if.report.authorised_by",
            paragraph(
                run("Authorised by ")
                + p.inline("tk:report.authorised_by", "name")
                + p.block(
                    "tk:if.report.authorised_function",
                    run(", ") + p.inline("tk:report.authorised_function", "function"),
                ),
                style="Signature",
                keep=True,
            ),
        ),
        paragraph(run("End of report ") + p.inline("tk:report.id", "report id"), style="EndMark"),
    ]
