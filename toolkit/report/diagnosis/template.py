"""The default template of a diagnosis, ``report_templates/diagnosis.docx``: built by code.

The first page is for a reader of ten seconds: verdict, one sentence, the chart. What is taken for the cause
stands in a place of its own, marked as an opinion.
"""

from __future__ import annotations

from toolkit.report.design.blocks import Pieces, paragraph, run
from toolkit.report.design.default import build_document
from toolkit.report.design.opening import WIDE, findings_section, heading, mark, page_footer, page_header
from toolkit.report.diagnosis.vocabulary import WHERE


def build_diagnosis() -> bytes:
    """Return the default template of a diagnosis as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Diagnosis: simulation against recording",
        body=lambda p: [*_first(p), *_evidence(p), *_rest(p)],
        header=_header,
        footer=_footer,
    )


def _header(p: Pieces) -> str:
    return page_header(
        run("Diagnosis"), mark(p, "unverified", "UNVERIFIED"), p.inline("tk:diagnosis.id", "id")
    )


def _footer(p: Pieces) -> str:
    return page_footer(p.inline("tk:diagnosis.issued", "date"))


def _first(p: Pieces) -> list[str]:
    return [
        paragraph(p.inline("tk:diagnosis.title", "title"), style="Title"),
        paragraph(p.inline("tk:diagnosis.verdict", "verdict"), style="Subtitle"),
        paragraph(p.inline("tk:diagnosis.summary", "summary")),
        p.figure("diagnosis_errors", 150),
        p.block(
            "tk:if.effects",
            paragraph(
                run("Opinion, not a result (ISO/IEC 17025, 7.8.7): ", bold=True)
                + p.inline("tk:diagnosis.opinion", "opinion")
                + run(" (")
                + p.inline("tk:diagnosis.opinion_by", "who")
                + run(")")
            )
            + paragraph(run("Basis: ", bold=True) + p.inline("tk:diagnosis.basis", "basis")),
        ),
        p.block("tk:if.incomplete", paragraph(p.inline("tk:diagnosis.complete", "what was skipped"))),
        p.facts(
            [
                [("CASE", "diagnosis.case")],
                [("CALIBRATIONS", "diagnosis.calibrations")],
                [("MODEL?", "diagnosis.model")],
                [("HELD OUT", "diagnosis.held_out_by")],
                [("SOFTWARE", "diagnosis.software")],
            ],
            WIDE,
        ),
    ]


def _evidence(p: Pieces) -> list[str]:
    return [
        p.block(
            "tk:if.diagnosis.where",
            heading("Where") + paragraph(p.inline("tk:diagnosis.where", "where")),
        ),
        *(p.figure(f"diagnosis_where_{i}", 140) for i in range(1, WHERE + 1)),
        p.figure("diagnosis_run", 150),
        p.block(
            "tk:if.effects",
            heading("Equation and parameters")
            + p.table(
                "found",
                "Effects that improve the fit, and their equations.",
                ["effect", "not told from", "statement", "equation"],
                ["effect", "class", "statement", "equation"],
                [32, 30, 56, 48],
                "llll",
            )
            + p.table(
                "found_parameters",
                "Fitted parameters with 95 % intervals.",
                ["effect", "parameter", "value", "unit", "95 % interval", "runs"],
                ["effect", "parameter", "value", "unit", "interval", "runs"],
                [32, 36, 20, 22, 36, 20],
                "llrlll",
            ),
        ),
        heading("Before and after"),
        p.table(
            "errors",
            "Root mean square errors on rows that no fit has seen, and the noise.",
            ["output", "unit", "as declared", "refitted", "with the effects", "noise"],
            ["output", "unit", "nominal", "refitted", "augmented", "noise"],
            [28, 22, 29, 29, 33, 25],
            "llrrrr",
            together=True,
        ),
        p.table(
            "rejected",
            "Alternatives in place of an effect: log-likelihood less than with it.",
            ["effect", "alternative", "less by"],
            ["effect", "alternative", "less"],
            [60, 76, 30],
            "llr",
        ),
        p.table(
            "nominal",
            "Parameters of the simulation.",
            ["parameter", "unit", "as declared", "fitted", "prior sd", "shift / sd"],
            ["parameter", "unit", "before", "after", "prior", "shift"],
            [52, 20, 26, 26, 24, 18],
            "llrrrr",
        ),
    ]


def _rest(p: Pieces) -> list[str]:
    return [
        heading("What remains"),
        paragraph(p.inline("tk:diagnosis.remains", "what remains")),
        p.block(
            "tk:if.next",
            heading("What to measure next")
            + p.table("next", "Measurements that would tell more.", ["measurement"], ["measure"], [166], "l"),
        ),
        heading("What was not found"),
        p.table(
            "not_found",
            "Smallest size that these recordings would have shown, 80 % power; below it, none is excluded.",
            ["effect", "size", "unit"],
            ["effect", "size", "unit"],
            [76, 40, 50],
            "lrl",
        ),
        p.block(
            "tk:if.diagnosis.not_observable",
            paragraph(p.inline("tk:diagnosis.not_observable", "what cannot be told")),
        ),
        heading("Recordings"),
        p.table(
            "recorded",
            "Recordings of the case.",
            ["file", "conditions", "rows", "SHA-256"],
            ["run", "conditions", "rows", "sha256"],
            [48, 58, 18, 42],
            "llrl",
        ),
        findings_section(p, "diagnosis_findings", message_mm=74),
        paragraph(run("End of diagnosis ") + p.inline("tk:diagnosis.id", "id"), style="EndMark"),
    ]
