"""From a search to the answer: verdict, mismatch, effects with intervals, errors, power."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import (
    Diagnosis,
    FoundEffect,
    FoundParameter,
    HeldOutFit,
    Mismatch,
    NominalParameter,
    Verdict,
    cut_short,
    recorded,
)
from toolkit.diagnosis.answer.classes import equivalent_to, parted
from toolkit.diagnosis.answer.locate import places
from toolkit.diagnosis.answer.power import not_found
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.fit.structure import groups
from toolkit.diagnosis.policy import PRIORS, SCREENING, VERDICT
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.search import Search
from toolkit.diagnosis.simulators.parameter_units import sense, unit_of
from toolkit.diagnosis.simulators.simulator import Active
from toolkit.effects.creep import FROM_REST
from toolkit.findings import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray


def answer_of(case: Case, found: Search, told: tuple[Finding, ...]) -> Diagnosis:
    """Return the answer of a search; ``told`` are the findings on the case itself."""
    problem = found.problem
    unknown = mostly_unknown(found)
    effects = () if unknown else tuple(_effect(found, step) for step in found.steps)
    nominal = _nominal(found, before_effects=unknown)
    verdict = _verdict(found, effects, nominal, unknown=unknown)
    # A search that did not come to its end has not shown that nothing is left.
    remaining = "unknown" if found.structure or found.skipped else "nothing"
    named = {one.name for one in effects} | {name for one in effects for name in one.equivalent_to}
    units = {
        id(one): unit_of(case, problem.model, one.active, one.active.searched[0].name)
        for one in found.scored
        if one.active.searched
    }
    tests = max(len(found.scored), 1)
    return Diagnosis(
        title=case.title,
        case_sha256=case.sha256,
        verdict=verdict,
        remaining="unknown" if verdict == "unknown" else remaining,  # type: ignore[arg-type]
        mismatch=_mismatches(found, unknown=unknown),
        effects=effects,
        nominal_parameters=nominal,
        held_out=_held_out(found, unknown=unknown),
        held_out_by=found.folds.told(len(found.problem.runs)),
        depends_on=tuple((one.output, one.variables) for one in found.structure),
        not_found=not_found(found.screen, found.scored, named, alpha=SCREENING.alpha / tests, units=units),
        next_measurements=_next(found, effects, verdict),
        findings=(*told, *_outliers(case, found)),
        complete=not found.skipped,
        skipped=found.skipped,
        recordings=recorded(case.runs),
    )


def mostly_unknown(found: Search) -> bool:
    """Tell whether what stays after the named effects outweighs them: they then only imitate it.

    By the log-likelihood, by what they take of the held-out mean square that is above the noise, and by the
    parameters of the simulation: effects beside which one of these is what nobody believes it to be are not
    what was left out.
    """
    if found.steps and implausible(found):
        return True
    if not found.structure:
        return False
    left = found.structure[0].gain / 2
    explained = sum(one.gain for one in found.steps)
    if explained < VERDICT.mostly * (explained + left):
        return True
    if all(one.active.effect.name == "quantisation" for one in found.steps):
        return False  # read off the digits: it does not imitate anything
    # Outputs that show nothing but noise do not count: of nothing, nothing is two thirds.
    shown = [
        (one.refitted_rmse**2 - one.augmented_rmse**2, one.refitted_rmse**2 - one.noise_floor**2)
        for one in _held_out(found, unknown=False)
        if one.refitted_rmse**2 > VERDICT.shown * one.noise_floor**2
    ]
    return bool(shown) and all(taken < VERDICT.taken * above for taken, above in shown)


def implausible(found: Search) -> tuple[str, ...]:
    """Return the parameters that are far off their priors beside every effect that was found."""
    values = zip(found.problem.free, found.augmented.p, strict=True)
    return tuple(
        one.name for one, p in values if one.sd is not None and abs(p - one.value) > PRIORS.far * one.sd
    )


def _verdict(
    found: Search, effects: tuple[FoundEffect, ...], nominal: tuple[NominalParameter, ...], *, unknown: bool
) -> Verdict:
    if effects:
        return "equivalent" if any(one.equivalent_to for one in effects) else "named"
    if unknown or found.structure:
        return "unknown"
    if found.skipped or any(abs(one.shift_in_sd or 0.0) > PRIORS.far for one in nominal):
        return "untestable"
    return "nothing"


def _effect(found: Search, step: Step) -> FoundEffect:
    problem, active = found.problem, step.active
    runs = None if active.runs is None else tuple(run.name for run in problem.runs if run.name in active.runs)
    same = equivalent_to(problem, step)
    rejected = {
        one.active.effect.name: one.difference
        for one in reversed(step.rivals)
        if one.active.effect.name not in (*same, active.effect.name)
    }
    return FoundEffect(
        name=active.effect.name,
        stage=active.effect.stage,
        channel=active.channel,
        statement=active.effect.statement,
        equation=active.effect.equation,
        reference=active.effect.reference,
        parameters=(*_parameters(found, active, runs), *_named(active, runs)),
        equivalent_to=same,
        rejected=tuple(rejected.items()),
        held_out_log_score_gain=step.held_out_gain,
        p_value=step.p_value,
    )


def _parameters(found: Search, active: Active, runs: tuple[str, ...] | None) -> tuple[FoundParameter, ...]:
    from scipy.stats import t as student

    problem, made = found.problem, found.augmented
    at = len(problem.free)
    for other in made.active:
        if _same(other, active):
            break
        at += len(other.searched)
    n = sum(int(one.sum()) for one in problem.kept.values())
    quantile = float(student.ppf((1 + VERDICT.interval) / 2, max(n - len(made.covariance), 1)))
    result = []
    for i, one in enumerate(active.effect.parameters):
        value = active.values.get(one.name, 0.0)
        ci: tuple[float, float] | None = None
        if active.searched:
            variance = found.variance(at + i)
            reach = quantile * math.sqrt(max(variance, 0.0))
            if math.isfinite(reach) and reach < VERDICT.open_interval * max(abs(value), 1e-300):
                ci = (max(value - reach, one.bounds[0]), min(value + reach, one.bounds[1]))
        # Read off the recorded digits, not fitted: a bound, which covers more than 95 %.
        half = active.values.get(f"_half_{one.name}")
        if half is not None:
            ci = (value - half, value + half)
        turned = sense(active, one.name, problem.case.axes)
        if turned < 0:
            value, ci = -value, None if ci is None else (-ci[1], -ci[0])
        unit = unit_of(problem.case, problem.model, active, one.name)
        if unit == "deg" and one.name.startswith("phase"):
            turns = 360.0 * math.floor(value / 360.0)
            value, ci = value - turns, None if ci is None else (ci[0] - turns, ci[1] - turns)
        result.append(FoundParameter(name=one.name, value=value, unit=unit, ci95=ci, runs=runs))
    return tuple(result)


def _named(active: Active, runs: tuple[str, ...] | None) -> tuple[FoundParameter, ...]:
    """Return what of an effect is no number: the other channel or record, its history, the runs it is in."""
    names = {"channel_swap": "with", "wrong_calibration": "record", "crosstalk": "from"}
    told = {}
    if active.effect.name in names and active.source is not None:
        told[names[active.effect.name]] = active.source
    if active.values.get(FROM_REST):
        told["history"] = "unloaded before each run"
    if not active.effect.parameters and runs is not None:
        told["runs"] = ", ".join(runs)
    return tuple(
        FoundParameter(name=name, value=value, unit="", ci95=None, runs=runs) for name, value in told.items()
    )


def _same(one: Active, other: Active) -> bool:
    return (one.effect.name, one.channel, one.source, one.runs) == (
        other.effect.name,
        other.channel,
        other.source,
        other.runs,
    )


def _nominal(found: Search, *, before_effects: bool) -> tuple[NominalParameter, ...]:
    after = found.refitted if before_effects else found.augmented
    fitted = dict(zip((one.name for one in found.problem.free), after.p, strict=True))
    return tuple(
        NominalParameter(
            name=one.name,
            before=one.value,
            after=fitted.get(one.name, one.value),
            unit=one.unit,
            prior_sd=one.sd,
        )
        for one in found.problem.model.parameters
    )


def _mismatches(found: Search, *, unknown: bool) -> tuple[Mismatch, ...]:
    problem = found.problem
    made = []
    for name in problem.names:
        kept = problem.kept[name]
        if not kept.any():
            continue
        before, after = found.refitted.residual[name], found.augmented.residual[name]
        p_values = [one.p_value for one in found.structure_before if one.output == name]
        if found.steps:
            share = max(
                0.0, 1 - float(np.sum(after[kept] ** 2)) / max(float(np.sum(before[kept] ** 2)), 1e-300)
            )
            signal = before - after
            ratio = float(np.mean(signal[kept] ** 2)) / max(
                found.augmented.noise[name].marginal_sd ** 2, 1e-300
            )
            if ratio * kept.sum() > VERDICT.telling:
                p_values.append(found.steps[0].p_value)
        else:
            share, signal = _structured(found, name)
        if not p_values:
            continue
        if unknown:
            share, signal = max((share, signal), _structured(found, name), key=lambda one: one[0])
        made.append(
            Mismatch(
                channel=name,
                p_value=min(p_values),
                share_of_variance=share,
                where=places(problem, name, signal, found.refitted.simulated[name], _depends_on(found, name)),
            )
        )
    return tuple(made)


def _depends_on(found: Search, name: str) -> tuple[str, ...]:
    """Return the variables of the most telling structure in an output's refitted residual."""
    most = max(
        (one for one in found.structure_before if one.output == name), key=lambda one: one.gain, default=None
    )
    return () if most is None else most.variables


def _structured(found: Search, name: str) -> tuple[float, NDArray[np.float64]]:
    """Return share and signal of the smooth structure in an output's refitted residual."""
    problem, kept = found.problem, found.problem.kept[name]
    residual = found.refitted.residual[name]
    best, signal = 0.0, np.zeros(problem.rows)
    wanted = {one.variables for one in found.structure_before if one.output == name}
    for group in groups(problem, found.refitted):
        if group.output != name or (wanted and group.variables not in wanted):
            continue
        fit = np.linalg.lstsq(group.columns[kept], residual[kept], rcond=None)[0]
        made = group.columns @ fit
        share = 1 - float(np.sum((residual - made)[kept] ** 2)) / max(
            float(np.sum(residual[kept] ** 2)), 1e-300
        )
        if share > best:
            best, signal = share, made
    return best, signal


def _held_out(found: Search, *, unknown: bool) -> tuple[HeldOutFit, ...]:
    problem = found.problem
    made = []
    augmented = found.held_refitted if unknown else found.held_augmented
    for output in problem.model.outputs:
        kept, observed = problem.kept[output.name], problem.observed[output.name]
        if not kept.any():
            continue

        def rmse(
            simulated: NDArray[np.float64], o: NDArray[np.float64] = observed, k: NDArray[np.bool_] = kept
        ) -> float:
            return math.sqrt(float(np.mean((o[k] - simulated[k]) ** 2)))

        made.append(
            HeldOutFit(
                channel=output.name,
                unit=output.unit,
                nominal_rmse=rmse(found.nominal.simulated[output.name]),
                refitted_rmse=rmse(found.held_refitted.simulated[output.name]),
                augmented_rmse=rmse(augmented.simulated[output.name]),
                # No noise is larger than an error that was reached on rows that no fit has seen.
                noise_floor=min(
                    _floor(found, output.name, output.sd),
                    math.inf if output.sd is not None else rmse(augmented.simulated[output.name]),
                ),
            )
        )
    return tuple(made)


def _floor(found: Search, name: str, sd: float | None) -> float:
    """Return an output's noise: as stated, else what is left when smooth structure is taken out too."""
    if sd is not None:
        return sd
    kept = found.problem.kept[name]
    left = math.sqrt(float(np.mean(found.augmented.residual[name][kept] ** 2)))
    if any(one.output == name for one in found.structure):
        share, _ = _structured(found, name)
        whole = math.sqrt(float(np.mean(found.refitted.residual[name][kept] ** 2)))
        left = min(left, whole * math.sqrt(max(1 - share, 0.0)))
    return left


def _next(found: Search, effects: tuple[FoundEffect, ...], verdict: Verdict) -> tuple[str, ...]:
    said = [text for one in effects if (text := parted(one))]
    if verdict == "unknown":
        said += _to_find_it(found)
        beside = ", ".join(dict.fromkeys(one.active.effect.name for one in found.steps))
        said += [
            f"Measure {name} by itself: even beside the nearest effects ({beside}) it is far off its prior."
            for name in (implausible(found) if found.steps else ())
        ]
    if cut_short(found.skipped):
        said.append("Give the search more time (--budget): it ended before every known effect was tried.")
    elif verdict == "untestable":
        said.append(
            "Tighten the priors of the parameters that moved (certificate, data sheet), or vary the inputs."
        )
    if len(found.problem.runs) == 1:
        said.append("Repeat the run: with one recording alone, only blocks of it could be held out.")
    return tuple(said)


def _to_find_it(found: Search) -> list[str]:
    """Return what would narrow down a mismatch that no effect explains, by what it depends on."""
    told = dict.fromkeys(name for one in found.structure for name in one.variables)
    channels = {one.name for one in found.problem.case.drivers}
    rates = {f"d{name}/dt": f"the rate of {name}" for name in channels}
    varied = [rates.get(name, name) for name in told if name in channels or name in rates]
    said = []
    if varied:
        said.append(
            f"The mismatch depends on {', '.join(varied)}: repeat the run with {varied[0]} alone varied, "
            "everything else held."
        )
    own = [one.name for one in found.problem.model.outputs if one.name in told]
    if own:
        said.append(
            f"The mismatch depends on the size of {', '.join(own)}: apply known loads over its range."
        )
    lines = [name.removeprefix("time (a line at ").removesuffix(")") for name in told if "a line at" in name]
    if lines:
        said.append(
            f"The mismatch swings at {' and '.join(lines)}: record what turns or swings at this frequency."
        )
    if "run" in told:
        said.append(
            "The mismatch differs from run to run: repeat one run unchanged, and note what else changed."
        )
    if "time" in told:
        said.append("The mismatch goes with time: hold all inputs still for as long as a run takes.")
    return said or ["Vary one input alone, everything else held, and record what else may act."]


def _outliers(case: Case, found: Search) -> tuple[Finding, ...]:
    made = []
    problem = found.problem
    for name, kept in problem.kept.items():
        left_out = int(np.isfinite(problem.observed[name]).sum() - kept.sum())
        if left_out:
            made.append(
                Finding(
                    rule="case-outlier",
                    where=f"{case.path.name}: {name}",
                    level="note",
                    message=f"{left_out} single values far off all neighbours were left out of every fit",
                )
            )
    return tuple(made)
