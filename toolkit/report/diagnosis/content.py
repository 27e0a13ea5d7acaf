"""A diagnosis to the content of its document: texts, tables and figures of its vocabulary.

What was measured and fitted is a result; what is taken for the cause is an opinion, and stands apart as one
(ISO/IEC 17025, 7.8.7).
"""

from __future__ import annotations

import datetime as dt
import math
from typing import TYPE_CHECKING

from toolkit.report.content import Cell, ReportContent, Table, Value
from toolkit.report.diagnosis.numbers import chance, few, over
from toolkit.report.diagnosis.page import headline
from toolkit.report.diagnosis.plots import diagnosis_plots
from toolkit.report.diagnosis.vocabulary import DIAGNOSIS, TABLES
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.answer.answer import Diagnosis, FoundEffect
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.diagnose import Result
    from toolkit.report.style import Style

_BASIS = (
    "Joint fits of the simulation's parameters and the effect's by free simulation of whole runs; evidence "
    "is the log score of rows that no fit has seen, the chance is that of the whole search. Other causes "
    "with the same signature in these recordings, outside the catalogue of effects, are not excluded."
)


def build_diagnosis_content(
    case: Case,
    result: Result,
    style: Style,
    *,
    issued: dt.date,
    use: CalibrationUse | None = None,
    model_sha256: str | None = None,
    by: str | None = None,
) -> ReportContent:
    """Return everything that a template of a diagnosis can ask for.

    Parameters
    ----------
    use : the calibration that the case names, and how it stands
    model_sha256 : of the answer's model file
    by : who has released the opinion on the cause; without a name the document says that nobody has
    """
    made = result.diagnosis
    plots = diagnosis_plots(result, style)
    tables = {
        name: Table(name=name, columns=TABLES[name][1], rows=tuple(rows))
        for name, rows in _tables(case, made, style).items()
    }
    texts = _texts(case, made, style, use=use, model_sha256=model_sha256, by=by)
    values = {f"diagnosis.{name}": Value(kind="text", value=text) for name, text in texts.items()}
    values["diagnosis.issued"] = Value(kind="date", value=issued.isoformat())
    values |= {f"caption.{name}": Value(kind="text", value=plot.caption) for name, plot in plots.items()}
    unverified, draft = use is not None and use.unverified, use is not None and use.draft
    conditions = dict.fromkeys(DIAGNOSIS.conditions, False)
    conditions |= {path: not value.missing for path, value in values.items()}
    conditions |= {name: bool(table.rows) for name, table in tables.items()} | dict.fromkeys(plots, True)
    conditions |= {
        "unverified": unverified, "draft": draft,
        "effects": bool(made.effects), "no_effects": not made.effects,
        "incomplete": not made.complete,
    }  # fmt: skip
    marks = [("unverified", "UNVERIFIED: the calibration is a legacy import.")] if unverified else []
    if use is not None and use.draft:
        marks.append(("draft", f"Calibration {use.id}: {use.status}."))
    return ReportContent(
        values=values,
        tables=tables,
        plots=plots,
        conditions=conditions,
        calibrations=() if use is None else (use,),
        title=made.title,
        author=style.laboratory or "toolkit",
        identity=str(texts["id"]),
        subject="Diagnosis: simulation against recording",
        issued=issued.isoformat(),
        marks=tuple(marks),
        style=style,
        vocabulary=DIAGNOSIS,
    )


def _texts(
    case: Case,
    made: Diagnosis,
    style: Style,
    *,
    use: CalibrationUse | None,
    model_sha256: str | None,
    by: str | None,
) -> dict[str, str | None]:
    return answer_texts(made, style, by=by) | {
        "case": f"{case.path.name}, SHA-256 {made.case_sha256}",
        "calibrations": "none" if use is None else f"{use.id} ({use.sha256})"
        + (f", {use.status}" if use.draft else " UNVERIFIED" if use.unverified else ""),
        "model": None if model_sha256 is None else f"model.toml, SHA-256 {model_sha256}",
        "software": f"toolkit {__version__}",
    }  # fmt: skip


def answer_texts(made: Diagnosis, style: Style, *, by: str | None) -> dict[str, str | None]:
    """Return what an answer tells by itself, by the name of its tag."""
    released = f"released by {by}" if by else "draft: nobody authorised has released it"
    return {
        "id": f"DIA-{made.case_sha256[:8].upper()}",
        "title": made.title,
        "verdict": headline(made),
        "summary": _summary(made, style),
        "opinion": _opinion(made),
        "opinion_by": released if made.effects else None,
        "basis": _BASIS if made.effects else None,
        "where": _where(made, style),
        "held_out_by": f"Held out by {made.held_out_by}; each in turn, the fits made on the rest.",
        "remains": _remains(made),
        "not_observable": _not_observable(made),
        "case": f"SHA-256 {made.case_sha256}",
        "complete": None if made.complete else f"The budget was spent at: {', '.join(made.skipped)}.",
    }


def _summary(made: Diagnosis, style: Style) -> str:
    told = []
    for one in made.held_out:
        if made.effects:
            ends = f"from {_n(one.refitted_rmse, style)} to {_n(one.augmented_rmse, style)} {_unit(one.unit)}"
        else:
            ends = f"is {_n(one.refitted_rmse, style)} {_unit(one.unit)}"
        told.append(f"{one.channel} {ends} (noise {_n(one.noise_floor, style)})")
    if not told:
        return "Nothing was fitted."
    what = (
        "With the effects the error on held-out rows falls: " if made.effects else "Error on held-out rows: "
    )
    return f"{what}{'; '.join(told)}."


def _opinion(made: Diagnosis) -> str | None:
    if not made.effects:
        return None
    return " ".join(
        f"{_label(one)}" + (f", or {', '.join(one.equivalent_to)}" if one.equivalent_to else "")
        + f": {one.statement}"
        for one in made.effects
    )  # fmt: skip


def _where(made: Diagnosis, style: Style) -> str | None:
    told = []
    for one in made.mismatch:
        share = _n(100 * one.share_of_variance, style)
        text = f"{one.channel}: {share} % of the residual's variance is structure"
        if one.share_of_variance < 0.005:
            text = f"{one.channel}: the residual is more than noise, and no variable alone explains it"
        for at in one.where[:1]:
            ends = at.ends(lambda value: _n(value, style, 4))
            much = f"over all of {at.variable}," if at.whole else f"most of it where {at.variable} is"
            text += f", {much} {ends} {_unit(at.unit)}".rstrip()
        told.append(f"{text} ({chance(one.p_value, decimal_comma=style.decimal_comma)}).")
    return " ".join(told) or None


def _remains(made: Diagnosis) -> str:
    if made.depends_on:
        listed = "; ".join(over(channel, names) for channel, names in made.depends_on[:6])
        return f"Structure that no named effect explains, a description and not physics: {listed}."
    if made.remaining == "unknown":
        return "Not judged: no search was made, or none to its end."
    return (
        "Nothing that stands out of the noise, down to the sizes that the answer lists for effects not found."
    )


def _not_observable(made: Diagnosis) -> str | None:
    why: dict[str, list[str]] = {}
    for one in made.not_found:
        if not one.observable:
            why.setdefault(one.why or "not told by these recordings", []).append(one.name)
    return " ".join(f"{reason.capitalize()}: {', '.join(names)}." for reason, names in why.items()) or None


def _tables(case: Case, made: Diagnosis, style: Style) -> dict[str, list[tuple[Cell, ...]]]:
    return answer_tables(made, style) | {
        "recorded": [
            (
                run.name, ", ".join(f"{key} {value}" for key, value in run.conditions.items()) or "-",
                str(run.rows), run.sha256[:16],
            )
            for run in case.runs
        ],
    }  # fmt: skip


def answer_tables(made: Diagnosis, style: Style) -> dict[str, list[tuple[Cell, ...]]]:
    """Return the rows of every table that an answer fills by itself."""
    return {
        "found": [
            (_label(one), ", ".join(one.equivalent_to) or "-", one.statement, one.equation)
            for one in made.effects
        ],
        "found_parameters": [row for one in made.effects for row in _parameters(one, style)],
        "errors": [
            (
                one.channel, _unit(one.unit), _n(one.nominal_rmse, style), _n(one.refitted_rmse, style),
                _n(one.augmented_rmse, style) if made.effects else "-", _n(one.noise_floor, style),
            )
            for one in made.held_out
        ],
        "rejected": [
            (_label(one), name, _n(-less, style)) for one in made.effects for name, less in one.rejected[:6]
        ],
        "nominal": [
            (
                one.name, _unit(one.unit), _n(one.before, style, 6), _n(one.after, style, 6),
                "known exactly" if one.prior_sd is None else _n(one.prior_sd, style),
                "-" if one.shift_in_sd is None else _n(one.shift_in_sd, style, 2),
            )
            for one in made.nominal_parameters
        ],
        "not_found": [
            (
                one.name, "-" if one.minimum_detectable is None else _n(one.minimum_detectable, style),
                _unit(one.unit) or "-",
            )
            for one in made.not_found
            if one.observable
        ],
        "next": [(text,) for text in made.next_measurements],
        "diagnosis_findings": [(one.rule, one.level, one.where, one.message) for one in made.findings],
    }  # fmt: skip


def _parameters(one: FoundEffect, style: Style) -> list[tuple[Cell, ...]]:
    return [
        (
            one.name, each.name,
            each.value if isinstance(each.value, str) else _n(each.value, style, 4), _unit(each.unit) or "-",
            "-" if each.ci95 is None else f"{_n(each.ci95[0], style, 4)} to {_n(each.ci95[1], style, 4)}",
            "all" if each.runs is None else ", ".join(each.runs),
        )
        for each in one.parameters
    ]  # fmt: skip


def _label(one: FoundEffect) -> str:
    return f"{one.name} on {one.channel}" if one.channel else one.name


def _unit(text: str) -> str:
    return text.replace("*", "·")


def _n(value: float, style: Style, digits: int = 3) -> str:
    if not math.isfinite(value):
        return "-"
    text = few(value, digits)
    return text.replace(".", ",") if style.decimal_comma else text
