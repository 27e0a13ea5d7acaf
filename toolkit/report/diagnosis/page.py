"""A diagnosis as one HTML file that opens without a network; the chart of ten seconds comes first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.diagnosis.policy import SCREENING
from toolkit.diagnosis.search.screen import best_of
from toolkit.effects.catalogue import effects
from toolkit.report.content import signature_text
from toolkit.report.diagnosis import figures
from toolkit.report.diagnosis.figures import size_maps
from toolkit.report.diagnosis.numbers import chance, few, over, rounded
from toolkit.report.pages.kit import Figure, Table, number, page_parts, table
from toolkit.units import with_unit

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.answer.answer import (
        ChannelMismatch,
        DiagnosedEffect,
        DiagnosedLaw,
        Diagnosis,
        EffectEstimate,
    )
    from toolkit.diagnosis.diagnose import Result

_NEAREST = 8  # candidates that are listed as rejected
HEADLINES = {
    "named": "The missing physics has a name.",
    "equivalent": "A class of effects explains the mismatch; this recording cannot tell them apart.",
    "unknown": "Something is missing that no known effect explains.",
    "nothing": "Nothing is missing that this recording could show.",
    "untestable": "This recording cannot tell.",
}
PARTLY = {
    "named": "A part of what is missing has a name.",
    "equivalent": "A class of effects explains a part of it; this recording cannot tell them apart.",
}
RUNS_DIFFER = (
    "Runs differ by more than their noise; within the runs nothing is missing that this recording could show."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Effect:
    """An effect that was found, its parameters and why it was chosen."""

    found: DiagnosedEffect
    title: str
    parameters: Table
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """Where an output is off, as a sentence and as figures."""

    sentence: str
    figures: Sequence[Figure]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Law:
    """A law of what has no name: its sentence, parameters, curve, and what is to be known of it."""

    sentence: str
    parameters: Table
    figure: Figure | None
    notes: Sequence[str]


def headline(diagnosis: Diagnosis, *, with_cause: bool = False) -> str:
    """Return the verdict as a sentence; a search that was cut off has not tried every effect.

    Parameters
    ----------
    with_cause : the effects with their sizes stand before it
    """
    sentences = (provisional(diagnosis), cause(diagnosis) if with_cause else None, _verdict(diagnosis))
    return " ".join(filter(None, sentences))


def provisional(diagnosis: Diagnosis) -> str | None:
    """Return that names may not stand, as the budget was spent before their last test; None where they do."""
    from toolkit.diagnosis.answer.answer import untested

    steps = untested(diagnosis.skipped) if diagnosis.effects else ()
    if not steps:
        return None
    return f"Provisional: the budget was spent before all tests of these names were made ({steps[0]})."


def _first_law(diagnosis: Diagnosis) -> str:
    """Return the first law, and where those are that were learned and judged as one with it."""
    first, *others = diagnosis.laws
    alike = [law.place.channel for law in others if law.evidence == first.evidence]
    return first.sentence + (f"; with it laws in the equations of {', '.join(alike)}" if alike else "")


def _verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict as a sentence: no more than the sizes of its effects bear out."""
    from toolkit.diagnosis.answer.answer import cut_short, only_runs_differ

    if diagnosis.verdict == "unknown" and cut_short(diagnosis.skipped):
        spent = "the budget was spent before every known effect was tried"
        return f"Something is missing{_size(diagnosis)}; {spent}."
    if diagnosis.verdict == "untestable" and diagnosis.skipped:
        return "The budget was spent before this recording could be judged."
    if only_runs_differ(diagnosis):
        return RUNS_DIFFER
    if diagnosis.verdict == "unknown":
        missing = f"{HEADLINES['unknown'].removesuffix('.')}{_size(diagnosis)}."
        if not diagnosis.laws:
            return missing
        return f"{missing} Its law was learned: {_first_law(diagnosis)}."
    if diagnosis.verdict == "named" and not any(map(is_told_from_none, diagnosis.effects)):
        return "A known effect may explain the mismatch; none of its sizes is told from none."
    if diagnosis.effects and diagnosis.remaining == "unknown":
        # Who reads the first line alone must not take a name for the whole of it.
        minor = explains_a_part(diagnosis)
        verdict = (PARTLY if minor else HEADLINES)[diagnosis.verdict]
        if diagnosis.laws:
            return f"{verdict} What is left follows a law: {_first_law(diagnosis)}."
        much = "Most" if minor else "More"
        return f"{verdict} {much} is left that no known effect explains{_size(diagnosis)}."
    return HEADLINES[diagnosis.verdict]


def explains_a_part(diagnosis: Diagnosis) -> bool:
    """Tell whether effects leave more above the noise than they take, on rows that no fit has seen."""
    if not diagnosis.effects or diagnosis.remaining != "unknown":
        return False
    explained = _explained(diagnosis)
    return explained is not None and explained[0] < 1 - explained[0]


def _size(diagnosis: Diagnosis) -> str:
    """Return how large what has no name is, before any law: an output's error, beside all that it varies."""
    left = {by.channel for by in diagnosis.depends_on} or {by.channel for by in diagnosis.mismatch}
    errors = [fit for fit in diagnosis.fit.held_out if fit.channel in left or not left]
    sized = [(fit.augmented_rmse / fit.spread, fit) for fit in errors if fit.spread]
    if not sized:
        return ""
    share, fit = max(sized, key=lambda pair: pair[0])
    size = with_unit(few(fit.augmented_rmse, 2), fit.unit)
    return f": {fit.channel} is off by {size}, {few(100 * share, 2)} % of its spread"


def simulated(diagnosis: Diagnosis) -> str | None:
    """Return the mark of an answer on recordings that are simulated, None on real ones."""
    rules = {finding.rule for finding in diagnosis.findings}
    return "SIMULATED DATA: no real machine was measured" if "case-simulated" in rules else None


def cause(diagnosis: Diagnosis) -> str | None:
    """Return the effects with their sizes and the share that they explain; None where none was found."""
    if not diagnosis.effects:
        return None
    names = []
    for effect in diagnosis.effects:
        sizes = [
            with_unit(f"{parameter.name} {value}{f' ({interval})' if interval else ''}", parameter.unit)
            for parameter in effect.parameters[:1]
            if not isinstance(parameter.value, str)
            for value, interval in (rounded(parameter.value, parameter.ci95),)
        ]
        told, runs = is_told_from_none(effect), effect.parameters[0].runs if effect.parameters else None
        where = "" if runs is None else f" in {runs[0] if len(runs) == 1 else f'{len(runs)} runs'} alone"
        names.append((not told, ("" if told else "perhaps ") + ", ".join((_name(effect) + where, *sizes))))
    explained = _explained(diagnosis)
    listed = "; ".join(name for _, name in sorted(names, key=lambda entry: entry[0]))
    listed = listed[0].upper() + listed[1:] if listed.startswith("perhaps ") else listed
    if explained is None:
        return listed + "."
    share, channel = explained
    share_text = f"{100 * share:.0f} % of the mean square by which {channel} is off beyond its noise"
    return f"{listed}: explains {share_text}, on rows that no fit has seen."


def _explained(diagnosis: Diagnosis) -> tuple[float, str] | None:
    """Return the largest share of an output's mean square above its noise that effects take, and which it is.

    Of rows that no fit has seen; None where they take nothing of any.
    """
    shares = []
    for fit in diagnosis.fit.held_out:
        above = fit.refitted_rmse**2 - min(fit.noise_floor, fit.augmented_rmse) ** 2
        explained = fit.refitted_rmse**2 - fit.augmented_rmse**2
        if above > 0 and explained > 0:
            shares.append((explained / above, fit.channel))
    return max(shares, default=None)


def is_told_from_none(effect: DiagnosedEffect) -> bool:
    """Tell whether the interval of one of an effect's sizes leaves out that there is none."""
    known = effects().get(effect.name)
    off = {parameter.name: parameter.off for parameter in known.parameters} if known else {}
    intervals = [
        (zero, parameter.ci95)
        for parameter in effect.parameters
        if (zero := off.get(parameter.name)) is not None and math.isfinite(zero)
    ]
    return not intervals or any(ci is None or not ci[0] <= zero <= ci[1] for zero, ci in intervals)


def page(result: Result, use: CalibrationUse | None = None) -> str:
    """Return the page's HTML; ``use`` is the calibration that the case names."""
    diagnosis, search = result.diagnosis, result.search
    chart = run_map = None
    if search is not None:
        chart = Figure(svg=figures.error_bars(diagnosis), alt="error before and after, over the noise")
        if diagnosis.mismatch and len(search.problem.runs) > 1:
            svg = figures.run_map(search, diagnosis, after=bool(diagnosis.effects))
            run_map = Figure(svg=svg, alt="residual by run and output")
    return "".join(
        page_parts(
            Path(__file__).parent,
            mark=" - ".join(filter(None, (simulated(diagnosis), None if use is None else use.mark))) or None,
            signature=signature_text(() if use is None else (use,)),
            diagnosis=diagnosis,
            headline=headline(diagnosis, with_cause=True),
            lead=_lead(diagnosis),
            chart=chart,
            effects=[_effect(result, effect) for effect in diagnosis.effects],
            laws=[_law(law) for law in diagnosis.laws],
            places=list(_places(result)),
            run_map=run_map,
            held_out=_held_out(diagnosis),
            nominal_parameters=_nominal_parameters(diagnosis),
            remaining=_remaining(diagnosis),
            rejected=_rejected(result),
            detectable=_detectable(diagnosis),
            unobservable=_unobservable(diagnosis),
            findings=table(
                ("rule", "where", "what"), [(row.rule, row.where, row.message) for row in diagnosis.findings]
            ),
        )
    )


def _lead(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return what stands under the headline: pairs of an effect's name, or none, and a statement."""
    if diagnosis.effects:
        return [(_name(effect), effect.statement) for effect in diagnosis.effects]
    if diagnosis.verdict == "unknown" and diagnosis.laws:
        share = f"{100 * diagnosis.laws[0].evidence.share_of_gap:.0f} %"
        return [("", f"It takes {share} of what was left; it is a description, and no known effect's name.")]
    if diagnosis.verdict == "unknown":
        parts = [over(by.channel, by.variables, by.reason) for by in diagnosis.depends_on[:3]]
        return [("", f"What remains: {'; '.join(parts)}.")]
    if diagnosis.skipped and diagnosis.verdict == "untestable":
        return [("", f"The budget was spent at: {diagnosis.skipped[0]}. Nothing can be said yet.")]
    if diagnosis.verdict == "untestable":
        return [("", "The outputs do not vary, or the parameters take up everything; see below.")]
    slow = [
        f"{fit.channel} is {few(fit.noise.total_sd / fit.noise.sensor_sd, 2)} times its sensor's noise"
        for fit in diagnosis.fit.held_out
        if fit.is_slow and fit.noise is not None
    ]
    left = f"noise; what is left of {', of '.join(slow)}, and follows nothing recorded" if slow else "noise"
    return [("", f"What is left is {left}. The list below says how large each effect would have had to be.")]


def _name(effect: DiagnosedEffect) -> str:
    where = f" on {effect.channel}" if effect.channel else ""
    return effect.name + where + (f" (or {', '.join(effect.equivalent_to)})" if effect.equivalent_to else "")


def _effect(result: Result, effect: DiagnosedEffect) -> _Effect:
    rows = [
        (
            parameter.name,
            parameter.value
            if isinstance(parameter.value, str)
            else rounded(parameter.value, parameter.ci95)[0],
            parameter.unit,
            _interval(effect, parameter),
            "all runs"
            if parameter.runs is None
            else ", ".join(parameter.runs) + condition(result, parameter.runs),
        )
        for parameter in effect.parameters
    ]
    return _Effect(
        found=effect,
        title=f"{effect.name} on {effect.channel}" if effect.channel else effect.name,
        parameters=table(("parameter", "value", "unit", "95 % interval", "in"), rows, numbers=(1,)),
        reason=_reason(effect),
    )


def _interval(effect: DiagnosedEffect, parameter: EffectEstimate) -> str:
    """Return an interval as it is printed, or why there is none of a level that a state cannot pass."""
    if isinstance(parameter.value, str):
        return ""
    declared = effects().get(effect.name)
    if parameter.ci95 is None and declared is not None and declared.term is not None:
        off = next((each.off for each in declared.parameters if each.name == parameter.name), None)
        if off is not None and math.isinf(off):
            return "none: its likelihood has a kink at every row that reaches it"
    return rounded(parameter.value, parameter.ci95)[1]


def _law(law: DiagnosedLaw) -> _Law:
    rows = [  # the heights of a curve are its figure, and a phase that differs from run to run has no number
        (parameter.name, value, parameter.unit, interval)
        for parameter in law.parameters
        if law.formula is not None and not isinstance(parameter.value, str) and math.isfinite(parameter.value)
        for value, interval in (rounded(parameter.value, parameter.ci95),)
    ]
    svg = figures.law_curve(law)
    gain = law.evidence.held_out_log_score_gain
    notes = [f"It takes {100 * law.evidence.share_of_gap:.0f} % of the mean square that was left"]
    if gain is None:
        notes[0] += ", on rows that were fitted: of others it says nothing."
    else:
        notes[0] += f" on rows that no fit has seen; their log score rose by {gain:.1f}."
    notes += [
        f"{name} was recorded from {few(low, 4)} to {few(high, 4)}." for name, (low, high) in law.ranges
    ]
    if law.confounded_with:
        notes.append(f"It may be taken for {', '.join(law.confounded_with)}, which moved far because of it.")
    if law.resembles:
        notes.append(f"It {law.likeness}.")
    return _Law(
        sentence=law.sentence,
        parameters=table(("parameter", "value", "unit", "95 % interval"), rows, numbers=(1,)),
        figure=None if svg is None else Figure(svg=svg, alt=f"the law over {law.variables[0]}"),
        notes=notes,
    )


def condition(result: Result, runs: Sequence[str]) -> str:
    """Return the conditions that these runs have and no other: people know a surface, not a file's name."""
    if result.search is None:
        return ""
    recorded = result.search.problem.runs
    inside = [run.conditions for run in recorded if run.name in runs]
    outside = [run.conditions for run in recorded if run.name not in runs]
    shared = [
        f"{key} {level}"
        for key, level in (inside[0].items() if inside else ())
        if all(conditions.get(key) == level for conditions in inside)
        and all(conditions.get(key) != level for conditions in outside)
    ]
    return f" ({', '.join(shared)})" if shared else ""


def _reason(effect: DiagnosedEffect) -> str:
    text = (
        f"On rows that no fit had seen the log score rose by {effect.evidence.held_out_log_score_gain:.1f}; "
        f"the chance that a search of this size finds as much in noise: {chance(effect.evidence.p_value)}."
    )
    if effect.equivalent_to:
        text += f" {', '.join(effect.equivalent_to)} would explain the same: they are one class here."
    if effect.rejected:
        rivals = ", ".join(
            f"{other.name} (by {other.log_likelihood_less:.1f})" for other in effect.rejected[:5]
        )
        text += f" Rejected, as they explain the recordings worse (log-likelihood less): {rivals}."
    elif not effect.equivalent_to and not effects()[effect.name].from_digits:
        text += " No other effect came near enough in the screening to be tried in its place."
    return text


def _places(result: Result) -> Iterator[_Place]:
    diagnosis, search = result.diagnosis, result.search
    if search is None:
        return
    after = bool(diagnosis.effects)
    for mismatch in diagnosis.mismatch:
        channel = mismatch.channel
        drawn = []
        for place in mismatch.where:
            svg = figures.mismatch_map(search, channel, place, after=after)
            if svg is not None:
                drawn.append(Figure(svg=svg, alt=f"residual of {channel} over {place.variable}"))
                break
        sizes = size_maps(search, diagnosis, channel, after=after)
        if sizes is not None:
            drawn.append(Figure(svg=sizes, alt=f"size of the residual of {channel} over each variable"))
        in_time = figures.run_in_time(search, channel, after=after, laws=result.laws)
        drawn.append(Figure(svg=in_time, alt=f"{channel} in one run"))
        yield _Place(sentence=_place_sentence(mismatch), figures=drawn)
    if not diagnosis.mismatch:
        # "Nothing" is believed by whoever sees that the lines lie on each other.
        for fit in diagnosis.fit.held_out:
            in_time = figures.run_in_time(search, fit.channel, after=after, laws=result.laws)
            yield _Place(
                sentence=f"{fit.channel}: nothing stands out of the noise"
                f"{', which is larger than the sensor has from row to row' if fit.is_slow else ''}. "
                "The run with the largest error:",
                figures=[Figure(svg=in_time, alt=f"{fit.channel} in one run")],
            )


def _place_sentence(mismatch: ChannelMismatch) -> str:
    channel, share = mismatch.channel, 100 * mismatch.share_of_variance
    text = f"{channel}: {share:.0f} % of the refitted residual's variance is structure"
    if share < 0.5:
        text = f"{channel}: the refitted residual is more than noise, and no variable alone explains it"
    if mismatch.untested:
        return f"{channel}: the residual is too large to be taken for noise, and no test tells it from noise."
    for place in mismatch.where[:1]:
        ends = place.ends(lambda value: few(value, 4))
        over_it = place.over(channel)
        extent = f"over all of {over_it}," if place.whole else f"most of it where {over_it} is"
        text += with_unit(f", {extent} {ends}", place.unit)
    return f"{text} ({chance(mismatch.p_value)})."


def _held_out(diagnosis: Diagnosis) -> Table:
    errors = {"as declared": "nominal_rmse", "refitted": "refitted_rmse"}
    if diagnosis.effects:  # without an effect there is no error with it
        errors["with the effects"] = "augmented_rmse"
    if any(fit.with_laws_rmse is not None for fit in diagnosis.fit.held_out):
        errors["with the laws"] = "with_laws_rmse"
    errors |= {"noise": "noise_floor", "sensor's noise": "sensor_sd"}
    rows = [
        (fit.channel, fit.unit, *(number(getattr(fit, field), ".4g", "–") for field in errors.values()))
        for fit in diagnosis.fit.held_out
    ]
    return table(("output", "unit", *errors), rows, numbers=tuple(range(2, 2 + len(errors))))


def _nominal_parameters(diagnosis: Diagnosis) -> Table:
    listed = diagnosis.nominal_parameters
    lawful = ("with the laws",) if any(each.with_laws is not None for each in listed) else ()
    rows = [
        (
            parameter.name,
            parameter.unit,
            f"{parameter.before:.6g}",
            f"{parameter.after:.6g}",
            *("" if parameter.with_laws is None else f"{parameter.with_laws:.6g}" for _ in lawful),
            "known exactly" if parameter.prior_sd is None else f"{parameter.prior_sd:.3g}",
            "" if parameter.shift_in_sd is None else f"{parameter.shift_in_sd:+.2f}",
        )
        for parameter in listed
    ]
    titles = ("parameter", "unit", "before", "after", *lawful, "prior sd", "shift/sd")
    return table(titles, rows, numbers=tuple(range(2, len(titles))))


def _remaining(diagnosis: Diagnosis) -> Table:
    rows = [(over(by.channel, by.variables, by.reason),) for by in diagnosis.depends_on[:8]]
    return table(("what is left",), rows)


def _rejected(result: Result) -> Table:
    """Return the candidates that come nearest to what has no name, and why none of them is the name."""
    from scipy.stats import chi2

    search, rows = result.search, []
    if search is not None and result.diagnosis.verdict == "unknown":
        tests = max(len(search.scored), 1)
        for trial in best_of(search.scored)[:_NEAREST]:
            gain = trial.gain * trial.trust
            shows = trial.candidate.name in search.undecided
            if not shows and gain < float(chi2.isf(SCREENING.alpha / tests, trial.dof)):
                why = "no more than chance gives in a search of this size"
            elif search.skipped:
                why = "the budget was spent before it was tried to the end"
            else:
                why = "it does not explain rows that no fit has seen, or not enough of them to matter"
            rows.append((trial.candidate.key.label, f"{gain / 2:.1f}", why))
    return table(
        ("candidate", "log-likelihood gained, linearised", "why it is not named"), rows, numbers=(1,)
    )


def _detectable(diagnosis: Diagnosis) -> Table:
    rows = [
        (
            effect.name,
            effect.why if effect.minimum_detectable is None else f"{effect.minimum_detectable:.3g}",
            "" if effect.minimum_detectable is None else effect.unit,
        )
        for effect in diagnosis.not_found
        if effect.observable
    ]
    return table(("effect", "smallest size seen with 80 % power", "unit"), rows, numbers=(1,))


def _unobservable(diagnosis: Diagnosis) -> dict[str, list[str]]:
    """Return the effects that these recordings can tell nothing of, by the reason."""
    names: dict[str, list[str]] = {}
    for effect in diagnosis.not_found:
        if not effect.observable:
            names.setdefault(effect.why or "not told by these recordings", []).append(effect.name)
    return names
