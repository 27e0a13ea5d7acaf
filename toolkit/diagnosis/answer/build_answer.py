"""From a search to the answer: verdict, mismatch, effects with intervals, errors, power."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import (
    LAWS_STEP,
    ChannelMismatch,
    Dependence,
    DiagnosedEffect,
    Diagnosis,
    EffectEstimate,
    EffectEvidence,
    HeldOutFit,
    NominalParameter,
    RejectedEffect,
    Verdict,
    recorded,
    untested,
)
from toolkit.diagnosis.answer.found_laws import found_laws
from toolkit.diagnosis.answer.held_out_errors import held_out_errors, structured, with_laws
from toolkit.diagnosis.answer.locate import places
from toolkit.diagnosis.answer.naming import mostly_unknown
from toolkit.diagnosis.answer.next_measurements import equivalent_to, next_measurements
from toolkit.diagnosis.answer.power import not_found
from toolkit.diagnosis.answer.refit_findings import confounded_findings, refit_findings
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.policy import LOCATION, PRIORS, SCREENING, UNITS, VERDICT
from toolkit.diagnosis.search.channel_factors import factor_of, is_ratio
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.noise_floor import LARGE, LONG, SMOOTH
from toolkit.diagnosis.search.search import Search
from toolkit.diagnosis.search.unexplained import narrowest_line
from toolkit.diagnosis.simulators.parameter_units import channel_unit, unit_of
from toolkit.effects.applied import ORIGIN, SOURCE_ORIGIN, AppliedEffect
from toolkit.effects.unit_ratios import near_ratio
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.learn import Laws


def answer_of(case: Case, search: Search, laws: Laws, findings: tuple[Finding, ...]) -> Diagnosis:
    """Return the answer of a search and the laws of its rest; ``findings`` are those on the case itself."""
    problem = search.problem
    unknown = mostly_unknown(search)
    skipped = (*search.skipped, *(() if laws.complete else (LAWS_STEP,)))
    effects = () if unknown else tuple(_effect(search, step) for step in search.steps)
    if untested(skipped):
        effects = tuple(
            replace(effect, statement=f"Provisional, not all tests were made: {effect.statement}")
            for effect in effects
        )
    nominal = _nominal(search, laws, before_effects=unknown)
    left = bool(search.structure or laws.listed)
    verdict = _verdict(search, effects, nominal, unknown=unknown or left)
    # A search that did not come to its end has not shown that nothing is left.
    remaining = "unknown" if left or search.skipped else "nothing"
    names = {effect.name for effect in effects} | {
        name for effect in effects for name in effect.equivalent_to
    }
    units = {
        id(trial): unit_of(case, problem.model, trial.active, trial.active.searched[0].name)
        for trial in search.scored
        if trial.active.searched
    }
    tests = max(len(search.scored), 1)
    return Diagnosis(
        title=case.title,
        case_sha256=case.sha256,
        verdict=verdict,
        remaining="unknown" if verdict == "unknown" else remaining,  # type: ignore[arg-type]
        mismatch=_mismatches(search, unknown=unknown),
        effects=effects,
        nominal_parameters=nominal,
        fit=HeldOutFit(
            held_out_by=search.folds.told(len(search.problem.runs)),
            held_out=with_laws(search, laws, held_out_errors(search, unknown=unknown)),
        ),
        depends_on=tuple(
            dict.fromkeys(
                Dependence(channel=structure.output, variables=structure.variables, reason=structure.reason)
                for structure in search.structure or (search.structure_before if unknown else ())
            )
        ),
        not_found=not_found(search, names, alpha=SCREENING.alpha / tests, units=units),
        next_measurements=(
            *_factor_hints(search, effects),
            *_unit_hints(search, laws),
            *next_measurements(search, effects, verdict, rest=left or unknown, skipped=skipped, laws=laws),
        ),
        findings=(
            *findings,
            *_outliers(case, search),
            *refit_findings(case, search),
            *confounded_findings(case, search, laws, effects),
        ),
        complete=not search.skipped and laws.complete,
        skipped=skipped,
        recordings=recorded(case.runs),
        laws=found_laws(search, laws),
    )


_UNTESTED = (LARGE, LONG, SMOOTH)
"""What is said of a rest that no test tells from noise: it has a reason, and no chance."""


def _verdict(
    search: Search,
    effects: tuple[DiagnosedEffect, ...],
    nominal: tuple[NominalParameter, ...],
    *,
    unknown: bool,
) -> Verdict:
    if effects:
        return "equivalent" if any(effect.equivalent_to for effect in effects) else "named"
    if unknown:
        return "unknown"
    if search.skipped or any(abs(parameter.shift_in_sd or 0.0) > PRIORS.far for parameter in nominal):
        return "untestable"
    return "nothing"


def _effect(search: Search, step: Step) -> DiagnosedEffect:
    problem, active = search.problem, step.active
    runs = None if active.runs is None else tuple(run.name for run in problem.runs if run.name in active.runs)
    equivalent = equivalent_to(problem, step)
    rejected = {
        rival.active.effect.name: rival.difference
        for rival in reversed(step.rivals)
        if rival.active.effect.name not in (*equivalent, active.effect.name)
    }
    return DiagnosedEffect(
        name=active.key.name,
        stage=active.effect.stage,
        channel=active.key.channel,
        statement=_statement(problem, step) + ("" if runs is None else f" In {_listed(runs)} alone."),
        equation=active.effect.equation + _counted_from(problem, active),
        reference=active.effect.reference,
        parameters=(*_parameters(search, active, runs), *_named(active, runs)),
        equivalent_to=equivalent,
        rejected=tuple(
            RejectedEffect(name=name, log_likelihood_less=-difference)
            for name, difference in rejected.items()
        ),
        evidence=EffectEvidence(held_out_log_score_gain=step.held_out_gain, p_value=step.p_value),
    )


def _factor_hints(search: Search, effects: Sequence[DiagnosedEffect]) -> tuple[str, ...]:
    """Return sentences where a channel is off by a factor that no calibration misses by."""
    problem, told = search.problem, {(effect.name, effect.channel) for effect in effects}
    hints = []
    for active in (step.active for step in search.steps):
        if is_ratio(active.effect) or not active.effect.needs_signal:
            continue
        if (active.key.name, active.key.channel) in told:
            name, factor = str(active.channel), factor_of(active)
            text = channel_unit(problem.case, problem.model, name)
            near = near_ratio(factor / (1 + UNITS.told), factor * (1 + UNITS.told), text)
            unit = "" if near is None else f"; {near} is near it"
            hints.append(
                f"Check unit, range and gain of {name}: it is off by a factor of {factor:.4g}{unit}."
            )
    return tuple(hints)


def _unit_hints(search: Search, laws: Laws) -> tuple[str, ...]:
    """Return sentences where a law's factor is that of a channel in another unit, within its interval."""
    problem, hints = search.problem, list[str]()
    for law in found_laws(search, laws):
        # What is the same at every value of its variables is a factor; a wave or a bend has none.
        factors = ("a1 + a2*", f"a*{law.place.channel}")
        scaled = law.place.kind == "output" and str(law.formula).startswith(factors)
        for parameter in law.parameters[:1] if scaled else ():
            if parameter.unit != "1" or isinstance(parameter.value, str) or parameter.ci95 is None:
                continue
            low, high = sorted(1 + end for end in parameter.ci95)
            factor = 1 + parameter.value
            if factor <= 0:
                continue
            low, high = min(low, factor / (1 + UNITS.told)), max(high, factor * (1 + UNITS.told))
            if not low > 0 or high > low * UNITS.least:
                continue
            for name in (law.place.channel, *(driver.name for driver in problem.case.drivers)):
                text = channel_unit(problem.case, problem.model, name)
                ends = (low, high) if name == law.place.channel else (1 / high, 1 / low)
                ratio = near_ratio(*ends, text)
                if ratio is not None and " read as " in ratio:
                    hints.append(
                        f"Check the unit of {name}: the law's factor {factor:.4g} is that of {ratio}."
                    )
    return tuple(dict.fromkeys(hints))[:2]


def _statement(problem: Problem, step: Step) -> str:
    """Return what an effect is; of a ratio of units also of which."""
    statement = step.active.effect.statement
    if is_ratio(step.active.effect):
        ratio = factor_of(step.active)
        text = near_ratio(ratio, ratio, channel_unit(problem.case, problem.model, step.active.channel))
        statement = statement if text is None else f"{statement.removesuffix('.')}: {text}."
    others = [
        str(rival.active.channel)
        for rival in step.rivals
        if rival.difference > -VERDICT.close
        and rival.active.effect.name == step.active.effect.name
        and rival.active.channel != step.active.channel
    ]
    if others:
        statement += f" The same of {_listed(tuple(dict.fromkeys(others)))} would explain as much."
    return statement


def _counted_from(problem: Problem, active: AppliedEffect) -> str:
    """Return from where an effect counts values whose scale has a zero by convention alone."""
    ends = {active.channel: ORIGIN, active.source: SOURCE_ORIGIN}
    told = [
        f"{name} from {active.values[key]:.6g} {channel_unit(problem.case, problem.model, name)}"
        for name, key in ends.items()
        if key in active.values
    ]
    return f"; counted: {', '.join(told)}" if told else ""


def _listed(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _parameters(
    search: Search, active: AppliedEffect, runs: tuple[str, ...] | None
) -> tuple[EffectEstimate, ...]:
    from scipy.stats import t as student

    problem, augmented = search.problem, search.augmented
    at = len(problem.free)
    for applied in augmented.active:
        if applied.key == active.key:
            break
        at += len(applied.searched)
    n = sum(int(counted.sum()) for counted in problem.kept.values())
    quantile = float(student.ppf((1 + VERDICT.interval) / 2, max(n - len(augmented.covariance), 1)))
    result = []
    for i, parameter in enumerate(active.effect.parameters):
        value = active.values.get(parameter.name, 0.0)
        ci: tuple[float, float] | None = None
        if active.searched:
            variance = search.variance(at + i) + active.form_uncertainty(parameter) ** 2
            reach = quantile * math.sqrt(max(variance, 0.0))
            if math.isfinite(reach) and reach < VERDICT.open_interval * max(abs(value), 1e-300):
                ci = (max(value - reach, parameter.bounds[0]), min(value + reach, parameter.bounds[1]))
        # Read off the recorded digits, not fitted: a bound, which covers more than 95 %.
        half = active.values.get(f"_half_{parameter.name}")
        if half is not None:
            ci = (value - half, value + half)
        # What is smaller than the equation can tell acts as if it were as large as that.
        least = active.values.get(f"least_{parameter.name}")
        if active.searched and least is not None and value < least:
            ci = (parameter.bounds[0], least if ci is None else max(ci[1], least))
        turned = parameter.sign_in(problem.case.axes)
        if turned < 0:
            value, ci = -value, None if ci is None else (-ci[1], -ci[0])
        unit = unit_of(problem.case, problem.model, active, parameter.name)
        if unit == "deg" and parameter.name.startswith("phase"):
            turns = 360.0 * math.floor(value / 360.0)
            value, ci = value - turns, None if ci is None else (ci[0] - turns, ci[1] - turns)
        result.append(EffectEstimate(name=parameter.name, value=value, unit=unit, ci95=ci, runs=runs))
    return tuple(result)


def _named(active: AppliedEffect, runs: tuple[str, ...] | None) -> tuple[EffectEstimate, ...]:
    """Return what of an effect is no number: the other channel or record, its history, the runs it is in."""
    texts = {}
    if active.effect.second is not None and active.source is not None:
        texts[active.effect.second] = active.source
    if active.history:
        texts["history"] = active.history
    if not active.effect.parameters and runs is not None:
        texts["runs"] = ", ".join(runs)
    return tuple(
        EffectEstimate(name=name, value=value, unit="", ci95=None, runs=runs) for name, value in texts.items()
    )


def _nominal(search: Search, laws: Laws, *, before_effects: bool) -> tuple[NominalParameter, ...]:
    after = search.refitted if before_effects else search.augmented
    free = [parameter.name for parameter in search.problem.free]
    fitted = dict(zip(free, after.p, strict=True))
    active = {applied.key for applied in laws.fit.active}
    beside = any(law.applied.key in active for law in laws.listed)
    with_laws = dict(zip(free, laws.fit.p, strict=True)) if beside else {}
    return tuple(
        NominalParameter(
            name=parameter.name,
            before=parameter.value,
            after=fitted.get(parameter.name, parameter.value),
            unit=parameter.unit,
            prior_sd=parameter.sd,
            with_laws=with_laws.get(parameter.name),
        )
        for parameter in search.problem.model.parameters
    )


def _mismatches(search: Search, *, unknown: bool) -> tuple[ChannelMismatch, ...]:
    problem = search.problem
    mismatches = []
    for name in problem.names:
        counted = problem.kept[name]
        if not counted.any():
            continue
        before, after = search.refitted.residual[name], search.augmented.residual[name]
        mine = [structure for structure in search.structure_before if structure.output == name]
        p_values = [structure.p_value for structure in mine if structure.reason not in _UNTESTED]
        if search.steps:
            share = max(
                0.0, 1 - float(np.sum(after[counted] ** 2)) / max(float(np.sum(before[counted] ** 2)), 1e-300)
            )
            signal = before - after
            ratio = float(np.mean(signal[counted] ** 2)) / max(
                search.augmented.noise[name].marginal_sd ** 2, 1e-300
            )
            if ratio * counted.sum() > VERDICT.telling:
                p_values.append(search.steps[0].p_value)
        else:
            share, signal = structured(search, name)
        if not p_values and not mine:
            continue
        if unknown:
            share, signal = max((share, signal), structured(search, name), key=lambda pair: pair[0])
        if any(each.line is not None for each in mine):
            line = narrowest_line(problem, name, before)
            share = max(share, 0.0 if line is None else line.share)
        mismatches.append(
            ChannelMismatch(
                channel=name,
                p_value=min(p_values, default=1.0),
                share_of_variance=share,
                where=places(
                    problem, name, signal, search.refitted.simulated[name], _depends_on(search, name)
                ),
            )
        )
    return tuple(mismatches)


def _depends_on(search: Search, name: str) -> tuple[str, ...]:
    """Return the variables of the most telling structure in an output's refitted residual."""
    most = max(
        (structure for structure in search.structure_before if structure.output == name),
        key=lambda structure: structure.gain,
        default=None,
    )
    return () if most is None or most.line is not None else most.variables


def _outliers(case: Case, search: Search) -> tuple[Finding, ...]:
    findings = []
    problem = search.problem
    for name, counted in problem.kept.items():
        left_out = np.flatnonzero(np.isfinite(problem.observed[name]) & ~counted)
        if not len(left_out):
            continue
        places = [_place_of(problem, name, row) for row in left_out[: LOCATION.listed].tolist()]
        more = len(left_out) - len(places)
        listed = ", ".join(places) + (f" and {more} more" if more else "")
        findings.append(
            Finding(
                rule="case-outlier",
                where=f"{case.path.name}: {name}",
                level="note",
                message=f"single values far off all neighbours, {len(left_out)} in number, were left out of "
                f"every fit: {listed}",
            )
        )
    return tuple(findings)


def _place_of(problem: Problem, name: str, row: int) -> str:
    """Return file, row below the header, time and value of one recorded value; of a mean its rows."""
    at = next(i for i, place in enumerate(problem.slices) if place.start <= row < place.stop)
    run, inside = problem.runs[at], row - problem.slices[at].start
    time = f" at {run.t[inside]:.6g} s" if problem.case.has_time else ""
    text = channel_unit(problem.case, problem.model, name)
    value = f"{problem.observed[name][row]:.6g}" + ("" if text == "1" else f" {text}")
    first, last = (inside, inside) if run.file_rows is None else run.file_rows[inside].tolist()
    if last > first:
        return f"the mean of rows {first + 1} to {last + 1} of the file {run.name}{time} ({value})"
    return f"row {first + 1} of the file {run.name}{time} ({value})"
