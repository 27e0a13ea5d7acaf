"""The chapter of a diagnosis in a report: kept only where an answer was given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from toolkit.report.design.blocks import Pieces, paragraph, run
from toolkit.report.design.opening import heading

_FOUND = ("effect", "class", "statement", "equation")
_PARAMETERS = ("effect", "parameter", "value", "unit", "interval", "runs")
_ERRORS = ("output", "unit", "nominal", "refitted", "augmented", "noise")
_FINDINGS = ("rule", "where", "message")


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """The chapter's words in a language; ``figure``, ``table`` are the labels of captions."""

    title: str
    opinion: str
    basis: str
    case: str
    where: str
    remains: str
    chart: str | None
    found: tuple[str, Sequence[str]]
    parameters: tuple[str, Sequence[str]]
    errors: tuple[str, Sequence[str]]
    next: tuple[str, Sequence[str]]
    findings: tuple[str, Sequence[str]]
    figure: str = "Figure"
    table: str = "Table"


ENGLISH = Words(
    title="Diagnosis: simulation against recording",
    opinion="Opinion, not a result (ISO/IEC 17025, 7.8.7): ",
    basis="Basis: ",
    case="Case of the diagnosis: ",
    where="Where: ",
    remains="What remains: ",
    chart=None,
    found=(
        "Effects that improve the fit, and their equations.",
        ("effect", "not told from", "statement", "equation"),
    ),
    parameters=(
        "Fitted parameters with 95 % intervals.",
        ("effect", "parameter", "value", "unit", "95 % interval", "runs"),
    ),
    errors=(
        "Root mean square errors on rows that no fit has seen, and the noise.",
        ("output", "unit", "as declared", "refitted", "with the effects", "noise"),
    ),
    next=("What to measure next.", ("measurement",)),
    findings=("Findings of the diagnosis.", ("rule", "where", "finding")),
)
GERMAN = Words(
    title="Diagnose: Simulation und Messung",
    opinion="Meinung, kein Prüfergebnis (ISO/IEC 17025, 7.8.7): ",
    basis="Grundlage: ",
    case="Fall der Diagnose (Texte des Programms im Wortlaut, englisch): ",
    where="Ort der Abweichung: ",
    remains="Was bleibt: ",
    chart="Fehler auf zurückgehaltenen Zeilen über dem Rauschen, vorher und nachher.",
    found=(
        "Effekte, die die Anpassung verbessern, und ihre Gleichungen.",
        ("Effekt", "nicht trennbar von", "Aussage", "Gleichung"),
    ),
    parameters=(
        "Angepasste Parameter mit 95-%-Vertrauensbereichen.",
        ("Effekt", "Parameter", "Wert", "Einheit", "95-%-Bereich", "Messungen"),
    ),
    errors=(
        "Quadratische Mittel der Fehler auf Zeilen, die keine Anpassung gesehen hat, und das Rauschen.",
        ("Ausgang", "Einheit", "wie angegeben", "angepasst", "mit den Effekten", "Rauschen"),
    ),
    next=("Was als Nächstes zu messen ist.", ("Messung",)),
    findings=("Feststellungen der Diagnose.", ("Regel", "Ort", "Feststellung")),
    figure="Abbildung",
    table="Tabelle",
)


def diagnosis_section(p: Pieces, words: Words = ENGLISH, *, width_mm: float = 166) -> str:
    """Return the chapter as one block: headline, sentence, chart, where, opinion, equations, what is left."""
    share = width_mm / 166

    def line(label: str, name: str) -> str:
        tag = f"tk:diagnosis.{name}"
        return p.block(f"tk:if.diagnosis.{name}", paragraph(run(label, bold=True) + p.inline(tag, name)))

    def table(
        name: str, told: tuple[str, Sequence[str]], cells: Sequence[str], widths: Sequence[float]
    ) -> str:
        align = "".join("r" if one in ("value", *_ERRORS[2:]) else "l" for one in cells)
        return p.table(
            name,
            told[0],
            list(told[1]),
            list(cells),
            [one * share for one in widths],
            align,
            kind=words.table,
        )

    return p.block(
        "tk:if.diagnosis.verdict",
        heading(words.title)
        + paragraph(p.inline("tk:diagnosis.verdict", "verdict"), keep=True)
        + paragraph(p.inline("tk:diagnosis.summary", "summary"))
        + p.figure("diagnosis_errors", 140, kind=words.figure, caption=words.chart)
        + line(words.where, "where")
        + p.block(
            "tk:if.diagnosis.opinion",
            paragraph(
                run(words.opinion, bold=True)
                + p.inline("tk:diagnosis.opinion", "opinion")
                + run(" (")
                + p.inline("tk:diagnosis.opinion_by", "who")
                + run(")")
            )
            + line(words.basis, "basis"),
        )
        + table("found", words.found, _FOUND, [32, 30, 56, 48])
        + table("found_parameters", words.parameters, _PARAMETERS, [32, 36, 20, 22, 36, 20])
        + table("errors", words.errors, _ERRORS, [28, 22, 29, 29, 33, 25])
        + line(words.remains, "remains")
        + line("", "not_observable")
        + line("", "complete")
        + table("next", words.next, ["measure"], [166])
        + table("diagnosis_findings", words.findings, _FINDINGS, [34, 44, 88])
        + paragraph(
            run(words.case, bold=True)
            + p.inline("tk:diagnosis.id", "id")
            + run(", ")
            + p.inline("tk:diagnosis.title", "title")
            + run(", ")
            + p.inline("tk:diagnosis.case", "hash")
        ),
    )
