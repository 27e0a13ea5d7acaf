"""From a search to the answer: verdict, mismatch, effects with intervals, errors, power."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import (
    LAWS_STEP,
    Diagnosis,
    FoundEffect,
    FoundParameter,
    HeldOutFit,
    Mismatch,
    NominalParameter,
    Verdict,
    recorded,
)
from toolkit.diagnosis.answer.found_laws import found_laws
from toolkit.diagnosis.answer.locate import places
from toolkit.diagnosis.answer.next_measurements import (
    equivalent_to,
    implausible,
    next_measurements,
    outsized,
)
from toolkit.diagnosis.answer.power import not_found
from toolkit.diagnosis.answer.refit_findings import refit_findings
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.fit.sensor_noise import noise_parts, spread
from toolkit.diagnosis.fit.structure import RUNS, groups
from toolkit.diagnosis.policy import PRIORS, SCREENING, VERDICT
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.search import Search
from toolkit.diagnosis.simulators.parameter_units import unit_of
from toolkit.effects.applied import AppliedEffect
from toolkit.findings import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.learn import Laws


def answer_of(case: Case, search: Search, laws: Laws, findings: tuple[Finding, ...]) -> Diagnosis:
    """Return the answer of a search and the laws of its rest; ``findings`` are those on the case itself."""
    problem = search.problem
    unknown = mostly_unknown(search)
    effects = () if unknown else tuple(_effect(search, step) for step in search.steps)
    nominal = _nominal(search, before_effects=unknown)
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
        held_out=_with_laws(search, laws, _held_out(search, unknown=unknown)),
        held_out_by=search.folds.told(len(search.problem.runs)),
        depends_on=tuple(
            (structure.output, structure.variables)
            for structure in search.structure or (search.structure_before if unknown else ())
        ),
        not_found=not_found(search.screen, search.scored, names, alpha=SCREENING.alpha / tests, units=units),
        next_measurements=next_measurements(search, effects, verdict),
        findings=(*findings, *_outliers(case, search), *refit_findings(case, search)),
        complete=not search.skipped and laws.complete,
        skipped=search.skipped if laws.complete or search.skipped else (LAWS_STEP,),
        recordings=recorded(case.runs),
        laws=found_laws(search, laws),
    )


def mostly_unknown(search: Search) -> bool:
    """Tell whether what stays after the named effects outweighs them: they then only imitate it.

    By the log-likelihood, by what they take of the held-out mean square that is above the noise, and by the
    parameters of the simulation: effects beside which one of these is what nobody believes it to be are not
    what was left out, unless they take nearly all of it. Nor is a cell's law beside an unexplained rest, with
    a size that no cell has.
    """
    if search.steps and implausible(search) and not _takes_nearly_all(search):
        return True
    shown = _taken(search)
    if search.steps and not shown and _is_smooth(search):
        return True
    if search.steps and _is_within_accuracy(search):
        return True
    if not search.structure:
        return False
    if outsized(search):
        return True
    if any(removed > VERDICT.nearly * above for removed, above in shown):
        return False
    unexplained = max(
        (structure.gain / 2 for structure in search.structure if not structure.rest), default=0.0
    )
    explained = sum(step.gain for step in search.steps)
    if explained < VERDICT.mostly * (explained + unexplained):
        return True
    if all(step.active.effect.from_digits for step in search.steps):
        return not search.steps  # read off the digits: it does not imitate anything
    return bool(shown) and all(removed < VERDICT.taken * above for removed, above in shown)


def _is_smooth(search: Search) -> bool:
    """Tell whether a smooth discrepancy without a name explains more than the effects, parameters counted.

    A simulation is never exact: what it misses by a part in a thousand is smooth, and some effect imitates a
    share of it. Asked of effects that show in no output above the noise; a larger one has a law of its own.
    """
    if all(step.active.effect.from_digits for step in search.steps):
        return False
    n = sum(int(counted.sum()) for counted in search.problem.kept.values())
    cost = 0.5 * math.log(n)  # of a parameter (BIC)
    named = sum(step.gain - cost * len(step.active.searched) for step in search.steps)
    nameless = (
        structure.gain / 2 - cost * structure.columns
        for structure in search.structure_before
        if structure.columns and not structure.rest
    )
    return max(nameless, default=-math.inf) > named + VERDICT.close


def _is_within_accuracy(search: Search) -> bool:
    """Tell whether effects move every output by less than a simulation is off without any.

    Another integrator or a tire's formula misses its plant by as much, and some effect takes a share of that.
    One that takes most of what is above the noise is what was left out, however small: within the runs, or of
    their zeros more than it would of zeros that move by chance.
    """
    if all(step.active.effect.from_digits for step in search.steps):
        return False
    problem = search.problem
    if _takes_nearly_all(search) and _foretells_zeros(search):
        return False
    for name, kept in problem.kept.items():
        # about every run's own mean: zeros that move are no effect's to take
        before, after, floor = (
            _within_runs(problem, error, kept)
            for error in (
                problem.observed[name] - search.held_refitted.simulated[name],
                problem.observed[name] - search.held_augmented.simulated[name],
                search.augmented.residual[name],
            )
        )
        shown = before > VERDICT.shown * floor
        if shown and before - after > VERDICT.taken * (before - floor):
            return False
        moved = (search.held_augmented.simulated[name] - search.held_refitted.simulated[name])[kept]
        if len(moved) and math.sqrt(float(np.mean(moved**2))) > VERDICT.accuracy * spread(problem, name):
            return False
    return True


def _foretells_zeros(search: Search) -> bool:
    """Tell whether effects take more of the runs' zeros, on unseen rows, than of as many that move by chance.

    Zeros that move are one independent value a run: of three a constant takes nine tenths in one case of
    twenty, and the best of all that were tried in most. The share that q parameters take of k such values is
    a beta variable with q and k - q degrees of freedom (the F test, one-sided).
    """
    from scipy.stats import beta

    problem, shares = search.problem, []
    for name, kept in problem.kept.items():
        before, after = (
            sum(
                float((problem.observed[name] - held.simulated[name])[rows][kept[rows]].mean()) ** 2
                for rows in problem.slices
                if kept[rows].any()
            )
            for held in (search.held_refitted, search.held_augmented)
        )
        shares.append((before - after) / max(before, 1e-300))
    taken = sum(max(len(step.active.searched), 1) for step in search.steps)
    free = len(problem.runs) - taken
    tests = max(len(search.scored), 1)
    return free > 0 and tests * float(beta.sf(max(shares), taken / 2, free / 2)) < SCREENING.alpha


def _taken(search: Search) -> list[tuple[float, float]]:
    """Return what effects take of each output's held-out mean square, and what of it is above the noise.

    Outputs that show nothing but noise do not count: of nothing, nothing is two thirds. Where the runs have
    zeros of their own, these are no effect's to take, and every run counts about its own mean.
    """
    problem, shown = search.problem, []
    for output in _held_out(search, unknown=False):
        name, counted = output.channel, problem.kept[output.channel]
        before, after, floor = output.refitted_rmse**2, output.augmented_rmse**2, output.noise_floor**2
        if any(each.output == name and each.variables == RUNS for each in search.structure):
            errors = (
                problem.observed[name] - search.held_refitted.simulated[name],
                problem.observed[name] - search.held_augmented.simulated[name],
                search.augmented.residual[name],
            )
            before, after, floor = (_within_runs(problem, error, counted) for error in errors)
        if before > VERDICT.shown * floor:
            shown.append((before - after, before - floor))
    return shown


def _takes_nearly_all(search: Search) -> bool:
    """Tell whether effects take nearly all that is above the sensor's own noise on unseen rows.

    What foretells all else is not withdrawn for a parameter that is far off beside it: its prior is as likely
    wrong, and the answer gives the parameter with its shift.
    """
    shares = []
    for output in _held_out(search, unknown=False):
        before, after = output.refitted_rmse**2, output.augmented_rmse**2
        sensor = noise_parts(search.problem, search.augmented, output.channel).sensor_sd ** 2
        if before > VERDICT.shown * sensor:
            shares.append((before - after) / (before - sensor))
    return bool(shares) and min(shares) > VERDICT.nearly


def _within_runs(problem: Problem, error: NDArray[np.float64], counted: NDArray[np.bool_]) -> float:
    """Return the mean square of an error about its mean in every run."""
    parts = [error[rows][counted[rows]] for rows in problem.slices if counted[rows].any()]
    return float(np.mean(np.concatenate([part - part.mean() for part in parts]) ** 2))


def _verdict(
    search: Search, effects: tuple[FoundEffect, ...], nominal: tuple[NominalParameter, ...], *, unknown: bool
) -> Verdict:
    if effects:
        return "equivalent" if any(effect.equivalent_to for effect in effects) else "named"
    if unknown:
        return "unknown"
    if search.skipped or any(abs(parameter.shift_in_sd or 0.0) > PRIORS.far for parameter in nominal):
        return "untestable"
    return "nothing"


def _effect(search: Search, step: Step) -> FoundEffect:
    problem, active = search.problem, step.active
    runs = None if active.runs is None else tuple(run.name for run in problem.runs if run.name in active.runs)
    equivalent = equivalent_to(problem, step)
    rejected = {
        rival.active.effect.name: rival.difference
        for rival in reversed(step.rivals)
        if rival.active.effect.name not in (*equivalent, active.effect.name)
    }
    return FoundEffect(
        key=active.key,
        stage=active.effect.stage,
        statement=active.effect.statement + ("" if runs is None else f" In {_listed(runs)} alone."),
        equation=active.effect.equation,
        reference=active.effect.reference,
        parameters=(*_parameters(search, active, runs), *_named(active, runs)),
        equivalent_to=equivalent,
        rejected=tuple(rejected.items()),
        held_out_log_score_gain=step.held_out_gain,
        p_value=step.p_value,
    )


def _listed(names: tuple[str, ...]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _parameters(
    search: Search, active: AppliedEffect, runs: tuple[str, ...] | None
) -> tuple[FoundParameter, ...]:
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
        turned = parameter.sign_in(problem.case.axes)
        if turned < 0:
            value, ci = -value, None if ci is None else (-ci[1], -ci[0])
        unit = unit_of(problem.case, problem.model, active, parameter.name)
        if unit == "deg" and parameter.name.startswith("phase"):
            turns = 360.0 * math.floor(value / 360.0)
            value, ci = value - turns, None if ci is None else (ci[0] - turns, ci[1] - turns)
        result.append(FoundParameter(name=parameter.name, value=value, unit=unit, ci95=ci, runs=runs))
    return tuple(result)


def _named(active: AppliedEffect, runs: tuple[str, ...] | None) -> tuple[FoundParameter, ...]:
    """Return what of an effect is no number: the other channel or record, its history, the runs it is in."""
    texts = {}
    if active.effect.second is not None and active.source is not None:
        texts[active.effect.second] = active.source
    if active.history:
        texts["history"] = active.history
    if not active.effect.parameters and runs is not None:
        texts["runs"] = ", ".join(runs)
    return tuple(
        FoundParameter(name=name, value=value, unit="", ci95=None, runs=runs) for name, value in texts.items()
    )


def _nominal(search: Search, *, before_effects: bool) -> tuple[NominalParameter, ...]:
    after = search.refitted if before_effects else search.augmented
    fitted = dict(zip((parameter.name for parameter in search.problem.free), after.p, strict=True))
    return tuple(
        NominalParameter(
            name=parameter.name,
            before=parameter.value,
            after=fitted.get(parameter.name, parameter.value),
            unit=parameter.unit,
            prior_sd=parameter.sd,
        )
        for parameter in search.problem.model.parameters
    )


def _mismatches(search: Search, *, unknown: bool) -> tuple[Mismatch, ...]:
    problem = search.problem
    mismatches = []
    for name in problem.names:
        counted = problem.kept[name]
        if not counted.any():
            continue
        before, after = search.refitted.residual[name], search.augmented.residual[name]
        p_values = [structure.p_value for structure in search.structure_before if structure.output == name]
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
            share, signal = _structured(search, name)
        if not p_values:
            continue
        if unknown:
            share, signal = max((share, signal), _structured(search, name), key=lambda pair: pair[0])
        mismatches.append(
            Mismatch(
                channel=name,
                p_value=min(p_values),
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
    return () if most is None else most.variables


def _structured(search: Search, name: str) -> tuple[float, NDArray[np.float64]]:
    """Return share and signal of the smooth structure in an output's refitted residual."""
    problem, counted = search.problem, search.problem.kept[name]
    residual = search.refitted.residual[name]
    best, signal = 0.0, np.zeros(problem.rows)
    dependences = {structure.variables for structure in search.structure_before if structure.output == name}
    for group in groups(problem, search.refitted):
        if group.output != name or (dependences and group.variables not in dependences):
            continue
        fit = np.linalg.lstsq(group.columns[counted], residual[counted], rcond=None)[0]
        smooth = group.columns @ fit
        share = 1 - float(np.sum((residual - smooth)[counted] ** 2)) / max(
            float(np.sum(residual[counted] ** 2)), 1e-300
        )
        if share > best:
            best, signal = share, smooth
    return best, signal


def _held_out(search: Search, *, unknown: bool) -> tuple[HeldOutFit, ...]:
    problem = search.problem
    errors = []
    augmented = search.held_refitted if unknown else search.held_augmented
    for output in problem.model.outputs:
        counted, observed = problem.kept[output.name], problem.observed[output.name]
        if not counted.any():
            continue

        def rmse(
            simulated: NDArray[np.float64], o: NDArray[np.float64] = observed, k: NDArray[np.bool_] = counted
        ) -> float:
            return math.sqrt(float(np.mean((o[k] - simulated[k]) ** 2)))

        errors.append(
            HeldOutFit(
                channel=output.name,
                unit=output.unit,
                nominal_rmse=rmse(search.nominal.simulated[output.name]),
                refitted_rmse=rmse(search.held_refitted.simulated[output.name]),
                augmented_rmse=rmse(augmented.simulated[output.name]),
                # No noise is larger than an error that was reached on rows that no fit has seen.
                noise_floor=min(
                    _floor(search, output.name, output.sd),
                    math.inf if output.sd is not None else rmse(augmented.simulated[output.name]),
                ),
                noise=noise_parts(problem, search.augmented, output.name),
            )
        )
    return tuple(errors)


def _with_laws(search: Search, laws: Laws, errors: tuple[HeldOutFit, ...]) -> tuple[HeldOutFit, ...]:
    """Return held-out errors with those that the laws leave beside them; an event tells nothing there."""
    if not any(law.predicts for law in laws.listed):
        return errors
    problem = search.problem
    told = []
    for output in errors:
        counted = problem.kept[output.channel]
        away = (problem.observed[output.channel] - laws.held_out.simulated[output.channel])[counted]
        rmse = math.sqrt(float(np.mean(away**2)))
        stated = problem.sd_of(output.channel) is not None
        floor = output.noise_floor if stated else min(output.noise_floor, rmse)
        told.append(replace(output, with_laws_rmse=rmse, noise_floor=floor))
    return tuple(told)


def _floor(search: Search, name: str, sd: float | None) -> float:
    """Return an output's noise: as stated, else what is left when smooth structure is taken out too."""
    if sd is not None:
        return sd
    counted = search.problem.kept[name]
    noise = math.sqrt(float(np.mean(search.augmented.residual[name][counted] ** 2)))
    if any(structure.output == name and not structure.rest for structure in search.structure):
        share, _ = _structured(search, name)
        refitted = math.sqrt(float(np.mean(search.refitted.residual[name][counted] ** 2)))
        noise = min(noise, refitted * math.sqrt(max(1 - share, 0.0)))
    return noise


def _outliers(case: Case, search: Search) -> tuple[Finding, ...]:
    findings = []
    problem = search.problem
    for name, counted in problem.kept.items():
        left_out = int(np.isfinite(problem.observed[name]).sum() - counted.sum())
        if left_out:
            findings.append(
                Finding(
                    rule="case-outlier",
                    where=f"{case.path.name}: {name}",
                    level="note",
                    message=f"{left_out} single values far off all neighbours were left out of every fit",
                )
            )
    return tuple(findings)
