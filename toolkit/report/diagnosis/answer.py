"""What a diagnosis' answer tells by itself, each part declared with what builds it.

It is the greater part of the document of a diagnosis, and a chapter of the report of the test whose
recordings the answer rests on. What was measured and fitted is a result; what is taken for the cause is an
opinion, and stands apart as one (ISO/IEC 17025, 7.8.7).
"""

from __future__ import annotations

import datetime as dt
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.report.content import Plot
from toolkit.report.diagnosis.numbers import chance, few, over, rounded
from toolkit.report.diagnosis.page import headline
from toolkit.report.diagnosis.plots import errors_plot
from toolkit.report.document import Document, Rows, finding_table
from toolkit.units import printed

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.answer.answer import DiagnosedEffect, Diagnosis
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.search.search import Search
    from toolkit.report.style import Style

_BASIS = (
    "Joint fits of the simulation's parameters and the effect's by free simulation of whole runs; evidence "
    "is the log score of rows that no fit has seen, the chance is that of the whole search. Other causes "
    "with the same signature in these recordings, outside the catalogue of effects, are not excluded."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """An answer, and who releases its opinion on the cause; None for nobody.

    The document of a diagnosis has its case, the search and the calibration too, and the SHA-256 of the
    answer's model file; a chapter of a report has none of them.
    """

    answer: Diagnosis
    by: str | None = None
    case: Case | None = None
    search: Search | None = None
    use: CalibrationUse | None = None
    model_sha256: str | None = None
    issued: dt.date | None = None

    @property
    def id(self) -> str:
        """Identification, made from the case."""
        return f"DIA-{self.answer.case_sha256[:8].upper()}"


DIAGNOSIS: Document[Told] = Document(
    name="diagnosis",
    family="diagnosis",
    package=__package__,
    required=("tk:diagnosis.case", "tk:diagnosis.id"),
)


def _summary(source: Told, style: Style) -> str:
    sentences = []
    for fit in source.answer.fit.held_out:
        if source.answer.effects:
            ends = (
                f"from {_n(fit.refitted_rmse, style)} to {_n(fit.augmented_rmse, style)} {printed(fit.unit)}"
            )
        else:
            ends = f"is {_n(fit.refitted_rmse, style)} {printed(fit.unit)}"
        sensor = "" if fit.sensor_sd is None else f", from row to row {_n(fit.sensor_sd, style)}"
        sentences.append(f"{fit.channel} {ends} (noise {_n(fit.noise_floor, style)}{sensor})")
    fell = "With the effects the error on held-out rows falls: " if source.answer.effects else None
    text = f"{fell or 'Error on held-out rows: '}{'; '.join(sentences)}."
    return " ".join([text if sentences else "Nothing was fitted.", *_rests_on(source)])


def _rests_on(source: Told) -> list[str]:
    # On which calibration a cause rests stands beside it also where a report has no table of its findings.
    if source.case is not None:
        return []
    rests = (finding for finding in source.answer.findings if finding.rule == "case-calibration")
    return [f"{finding.message.capitalize()}." for finding in rests]


def _opinion(source: Told, _style: Style) -> str | None:
    if not source.answer.effects:
        return None
    return " ".join(
        f"{_label(effect)}" + (f", or {', '.join(effect.equivalent_to)}" if effect.equivalent_to else "")
        + f": {effect.statement}"
        for effect in source.answer.effects
    )  # fmt: skip


def _where(source: Told, style: Style) -> str | None:
    sentences = []
    for mismatch in source.answer.mismatch:
        share = _n(100 * mismatch.share_of_variance, style)
        text = f"{mismatch.channel}: {share} % of the residual's variance is structure"
        if mismatch.share_of_variance < 0.005:
            text = f"{mismatch.channel}: the residual is more than noise, and no variable alone explains it"
        if mismatch.untested:
            sentences.append(
                f"{mismatch.channel}: the residual is too large to be taken for noise, "
                "and no test tells it from noise."
            )
            continue
        for at in mismatch.where[:1]:
            ends = at.ends(lambda value: _n(value, style, 4))
            over_it = at.over(mismatch.channel)
            extent = f"over all of {over_it}," if at.whole else f"most of it where {over_it} is"
            text += f", {extent} {ends} {printed(at.unit)}".rstrip()
        sentences.append(f"{text} ({style.decimal(chance(mismatch.p_value))}).")
    return " ".join(sentences) or None


def _remains(source: Told, _style: Style) -> str:
    if source.answer.depends_on:
        listed = "; ".join(over(by.channel, by.variables, by.reason) for by in source.answer.depends_on[:6])
        return f"Structure that no named effect explains, a description and not physics: {listed}."
    if source.answer.remaining == "unknown":
        return "Not judged: no search was made, or none to its end."
    return (
        "Nothing that stands out of the noise, down to the sizes that the answer lists for effects not found."
    )


def _not_observable(source: Told, _style: Style) -> str | None:
    why: dict[str, list[str]] = {}
    for effect in source.answer.not_found:
        if not effect.observable:
            why.setdefault(effect.why or "not told by these recordings", []).append(effect.name)
    return " ".join(f"{reason.capitalize()}: {', '.join(names)}." for reason, names in why.items()) or None


def _case(source: Told, _style: Style) -> str:
    digest = f"SHA-256 {source.answer.case_sha256}"
    return digest if source.case is None else f"{source.case.path.name}, {digest}"


def _released(source: Told, _style: Style) -> str | None:
    released = f"released by {source.by}" if source.by else "draft: nobody authorised has released it"
    return released if source.answer.effects else None


def _held_out_by(source: Told, _style: Style) -> str:
    return f"Held out by {source.answer.fit.held_out_by}; each in turn, the fits made on the rest."


def _complete(source: Told, _style: Style) -> str | None:
    answer = source.answer
    return None if answer.complete else f"The budget was spent at: {', '.join(answer.skipped)}."


_text = DIAGNOSIS.text
VALUES = (
    _text("id", "identification of the diagnosis, made from its case", lambda source, _: source.id),
    _text("title", "title of the case", lambda source, _: source.answer.title),
    _text("verdict", "verdict in one sentence", lambda source, _: headline(source.answer)),
    _text("summary", "what was found, in one sentence with numbers; a result", _summary),
    _text(
        "opinion", "what is taken for the cause: an opinion, not a result (ISO/IEC 17025, 7.8.7)", _opinion
    ),
    _text("opinion_by", "who has released the opinion", _released),
    _text("basis", "what the opinion rests on", lambda source, _: _BASIS if source.answer.effects else None),
    _text("where", "where the mismatch is", _where),
    _text("held_out_by", "what was held out", _held_out_by),
    _text("remains", "what remains unexplained", _remains),
    _text("not_observable", "effects of which these recordings can tell nothing, and why", _not_observable),
    _text("case", "case file and its hash, which covers the recordings", _case),
    _text("complete", "what a spent budget left out", _complete),
    finding_table(DIAGNOSIS, "diagnosis_findings", "file or channel", lambda source: source.answer.findings),
)


@DIAGNOSIS.table(
    "found",
    "effects that were found: statement and equation",
    """
    effect|effect and the channel it acts on
    class|effects that this recording cannot tell it from
    statement|what it says, in words
    equation|its equation
    """,
)
def found(source: Told, _style: Style) -> Rows:
    """Return the effects."""
    for effect in source.answer.effects:
        yield _label(effect), ", ".join(effect.equivalent_to) or "-", effect.statement, effect.equation


@DIAGNOSIS.table(
    "found_parameters",
    "fitted parameters of the effects",
    """
    effect|effect
    parameter|parameter
    value|fitted value
    unit|unit
    interval|95 % interval
    runs|runs in which it acts
    """,
)
def found_parameters(source: Told, style: Style) -> Rows:
    """Return the parameters of the effects."""
    for effect in source.answer.effects:
        for parameter in effect.parameters:
            value = parameter.value
            texts = (
                (value, "")
                if isinstance(value, str)
                else tuple(map(style.decimal, rounded(value, parameter.ci95)))
            )
            yield (
                effect.name, parameter.name, texts[0], printed(parameter.unit) or "-", texts[1] or "-",
                "all" if parameter.runs is None else ", ".join(parameter.runs),
            )  # fmt: skip


@DIAGNOSIS.table(
    "errors",
    "root mean square errors on rows that no fit has seen",
    """
    output|output
    unit|unit
    nominal|simulation as declared
    refitted|its parameters refitted, no new physics
    augmented|with the effects
    noise|noise floor
    """,
)
def errors(source: Told, style: Style) -> Rows:
    """Return the errors of every output."""
    for fit in source.answer.fit.held_out:
        yield (
            fit.channel, printed(fit.unit), _n(fit.nominal_rmse, style), _n(fit.refitted_rmse, style),
            _n(fit.augmented_rmse, style) if source.answer.effects else "-", _n(fit.noise_floor, style),
        )  # fmt: skip


@DIAGNOSIS.table(
    "rejected",
    "alternatives that explain the recordings worse",
    """
    effect|effect that was found
    alternative|effect that was tried in its place
    less|log-likelihood less than with the effect
    """,
)
def rejected(source: Told, style: Style) -> Rows:
    """Return the alternatives to each effect, the best six."""
    for effect in source.answer.effects:
        for other in effect.rejected[:6]:
            yield _label(effect), other.name, _n(other.log_likelihood_less, style)


@DIAGNOSIS.table(
    "nominal",
    "parameters of the simulation before and after",
    """
    parameter|parameter
    unit|unit
    before|as declared
    after|with the effects
    prior|prior standard deviation
    shift|change over the prior standard deviation
    """,
)
def nominal(source: Told, style: Style) -> Rows:
    """Return the parameters of the simulation."""
    for parameter in source.answer.nominal_parameters:
        prior, shift = parameter.prior_sd, parameter.shift_in_sd
        yield (
            parameter.name, printed(parameter.unit), _n(parameter.before, style, 6),
            _n(parameter.after, style, 6),
            "known exactly" if prior is None else _n(prior, style),
            "-" if shift is None else _n(shift, style, 2),
        )  # fmt: skip


@DIAGNOSIS.table(
    "not_found",
    "effects that were not found, and how large each would have had to be",
    """
    effect|effect
    size|smallest size seen with 80 % power
    unit|unit
    """,
)
def not_found(source: Told, style: Style) -> Rows:
    """Return the effects that these recordings could have shown."""
    for effect in source.answer.not_found:
        if effect.observable:
            size = effect.minimum_detectable
            told = effect.why or "-" if size is None else _n(size, style)
            yield effect.name, told, printed(effect.unit) or "-"


@DIAGNOSIS.table("next", "what to measure next", "measure|measurement")
def next_measurements(source: Told, _style: Style) -> Rows:
    """Return the measurements that the answer advises."""
    return ((text,) for text in source.answer.next_measurements)


@DIAGNOSIS.figures(
    {"diagnosis_errors": "error on held-out rows over the noise, before and after: the chart of ten seconds"},
    charts=False,
)
def errors_chart(source: Told, style: Style) -> Iterator[Plot]:
    """Return the chart, where something was fitted; the document of a case without a search has none."""
    if source.answer.fit.held_out and (source.case is None or source.search is not None):
        yield errors_plot(source.answer, style)


def _label(effect: DiagnosedEffect) -> str:
    return f"{effect.name} on {effect.channel}" if effect.channel else effect.name


def _n(value: float, style: Style, digits: int = 3) -> str:
    if not math.isfinite(value):
        return "-"
    return style.decimal(few(value, digits))
