"""A diagnosis as a chapter of a test's report: the tags of its own document, from the answer alone.

What was found is a result; what is taken for the cause is an opinion, and is marked as one (ISO/IEC 17025,
7.8.7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.report.content import Plot, Table, Value
from toolkit.report.diagnosis.entries import REPORT_FIGURES, REPORT_TABLES, REPORT_VALUES

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import Diagnosis
    from toolkit.report.style import Style


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """An answer, and who releases its opinion on the cause; None for nobody."""

    answer: Diagnosis
    by: str | None = None


def diagnosis_values(told: Told | None, style: Style) -> dict[str, Value]:
    """Return the values ``diagnosis.*`` of a report and captions; without an answer they are missing."""
    texts: dict[str, str | None] = {}
    if told is not None:
        from toolkit.report.diagnosis.content import answer_texts

        texts = answer_texts(told.answer, style, by=told.by)
        # On which calibration a cause rests stands beside it also where a template has no table of findings.
        rests = [one.message for one in told.answer.findings if one.rule == "case-calibration"]
        if rests:
            texts["summary"] = " ".join([str(texts["summary"]), *(f"{one.capitalize()}." for one in rests)])
    names = (one.path.partition(".")[2] for one in REPORT_VALUES)
    captions = {f"caption.{name}": Value(kind="text", value=None) for name in REPORT_FIGURES}
    return captions | {f"diagnosis.{name}": Value(kind="text", value=texts.get(name)) for name in names}


def diagnosis_tables(told: Told | None, style: Style) -> dict[str, Table]:
    """Return the tables of a diagnosis; without an answer they have no rows."""
    rows = {}
    if told is not None:
        from toolkit.report.diagnosis.content import answer_tables

        rows = answer_tables(told.answer, style)
    return {
        name: Table(name=name, columns=columns, rows=tuple(rows.get(name, ())))
        for name, (_, columns) in REPORT_TABLES.items()
    }


def told_plots(told: Told | None, style: Style) -> dict[str, Plot]:
    """Return the figure of errors before and after; none without an answer, or where nothing was fitted."""
    if told is None or not told.answer.held_out:
        return {}
    from toolkit.report.diagnosis.plots import errors_plot

    plot = errors_plot(told.answer, style)
    return {plot.name: plot}
