"""What a reader must know of the refit: parameters at bounds, runs that differ, rows that it makes worse."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.diagnosis.policy import LOCATION, PRIORS, VERDICT
from toolkit.diagnosis.search.run_parameters import errors_apart
from toolkit.diagnosis.search.unseen_runs import unseen_errors
from toolkit.diagnosis.simulators.run_starts import RunStart
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import DiagnosedEffect
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.search.search import Search


def refit_findings(case: Case, search: Search) -> tuple[Finding, ...]:
    """Return what is told of parameters at their bounds, runs that differ, and a refit that does harm."""
    return (
        *_at_bounds(case, search), *_alike(case, search), *_scatter(case, search),
        *_disagreed(case, search), *_worse(case, search), *_drifting(case, search), *_started(case, search),
    )  # fmt: skip


def _alike(case: Case, search: Search) -> tuple[Finding, ...]:
    listed = {parameter.name: parameter for parameter in search.problem.free}
    findings = []
    for step in search.steps:
        if step.parameter is None:
            continue
        parameter, label = listed[step.parameter.name], step.active.key.label
        found = f"{step.parameter.value:.4g} {parameter.unit}"
        sd, declared, prior = f"{step.parameter.sd:.2g}", f"{parameter.value:.4g}", f"{parameter.sd:.2g}"
        findings.append(
            Finding(
                rule="parameter-alike",
                where=f"{case.path.name}: {parameter.name}",
                level="warning",
                message=f"{found} from the recording with a standard deviation of {sd}, declared {declared} "
                f"with one of {prior}: {label} says the same",
            )
        )
    return tuple(findings)


def confounded_findings(
    case: Case, search: Search, laws: Laws, effects: tuple[DiagnosedEffect, ...]
) -> tuple[Finding, ...]:
    """Return the effects whose size a law beside them moves by more than its interval.

    A law that goes with an effect takes part of it, or gives it part of its own: neither of the two sizes is
    then that of the effect.
    """
    predicting = [law.applied.key for law in laws.listed if law.predicts]
    beside = {applied.key: applied for applied in laws.fit.active}
    findings = []
    for effect in effects if any(key in beside for key in predicting) else ():
        applied = beside.get(effect.key)
        alone = next((each for each in search.augmented.active if each.key == effect.key), None)
        if applied is None or alone is None:
            continue
        for parameter in effect.parameters:
            if parameter.ci95 is None or parameter.name not in alone.values:
                continue
            moved = applied.values[parameter.name] - alone.values[parameter.name]
            if abs(moved) > max(abs(end - float(parameter.value)) for end in parameter.ci95):
                unit = f" {parameter.unit}" if parameter.unit not in ("", "1") else ""
                findings.append(
                    Finding(
                        rule="size-confounded",
                        where=f"{case.path.name}: {effect.key.label}",
                        level="warning",
                        message=f"{parameter.name} is {alone.values[parameter.name]:.4g}{unit}, and "
                        f"{applied.values[parameter.name]:.4g}{unit} beside the law without a name: "
                        "this recording does not part the two",
                    )
                )
    return tuple(findings)


def _drifting(case: Case, search: Search) -> tuple[Finding, ...]:
    return tuple(
        Finding(
            rule="drift-limited",
            where=f"{case.path.name}: {name}",
            level="note",
            message="an integrating plant that nothing leads back: its free simulation is limited by drift, "
            f"and judged by its rates over {search.problem.rate_s(name):.3g} s",
        )
        for name in search.problem.rates
    )


def _started(case: Case, search: Search) -> tuple[Finding, ...]:
    by_run: dict[str, list[str]] = {}
    for parameter, value in zip(search.problem.free, search.augmented.p, strict=True):
        if isinstance(parameter, RunStart) and abs(value) > PRIORS.far * parameter.sd:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            by_run.setdefault(parameter.run_name, []).append(f"{parameter.state} by {value:+.3g}{unit}")
    return tuple(
        Finding(
            rule="run-starts",
            where=f"{case.path.name}: {run}",
            level="warning",
            message=f"led along its rows the run starts elsewhere than `initial` puts it: {', '.join(off)}",
        )
        for run, off in by_run.items()
    )


def _scatter(case: Case, search: Search) -> tuple[Finding, ...]:
    units = {output.name: output.unit for output in search.problem.model.outputs}
    return tuple(
        Finding(
            rule="runs-scatter",
            where=f"{case.path.name}: {each.output}",
            level="note",
            message=f"zeros of the runs scatter by {each.zero_sd:.2g} {units[each.output]}, gains by "
            f"{100 * each.gain_sd:.2g} %, both standard deviations: values and intervals have it in them",
        )
        for each in search.scatter
    )


def _disagreed(case: Case, search: Search) -> tuple[Finding, ...]:
    own = search.disagreed
    if own is None:
        return ()
    unit = next(parameter.unit for parameter in search.problem.free if parameter.name == own.name)
    listed = ", ".join(f"{run} {value:.4g}" for run, value, _ in own.values[: LOCATION.listed])
    listed += ", ..." if len(own.values) > LOCATION.listed else ""
    return (
        Finding(
            rule="runs-disagree",
            where=f"{case.path.name}: {own.name}",
            level="warning",
            message=f"every run has a value of its own that fits it, and no common one fits all [{unit}]: "
            f"{listed}; the smallest and the largest are {errors_apart(own):.2g} standard errors apart",
        ),
    )


def _at_bounds(case: Case, search: Search) -> tuple[Finding, ...]:
    findings = []
    for parameter, refitted, augmented in zip(
        search.problem.declared, search.refitted.p, search.augmented.p, strict=False
    ):
        values = {"refitted": refitted} | ({"with the effects": augmented} if search.steps else {})
        shifts = {fit: (value - parameter.value) / (parameter.sd or 1.0) for fit, value in values.items()}
        # The prior's own end; bounds that a case states are another matter.
        ends = [f"{shift:+.1f} sd {fit}" for fit, shift in shifts.items() if abs(shift) > PRIORS.end]
        if ends:
            findings.append(
                Finding(
                    rule="parameter-at-bound",
                    where=f"{case.path.name}: {parameter.name}",
                    level="warning",
                    message=f"{' and '.join(ends)}: as far off its declared value as its prior lets a fit go",
                )
            )
    return tuple(findings)


def _worse(case: Case, search: Search) -> tuple[Finding, ...]:
    findings = []
    for output in search.problem.model.outputs:
        if not search.problem.kept[output.name].any():
            continue
        refitted, declared, still = unseen_errors(
            search.problem, output.name, search.nominal.simulated, search.held_refitted
        )
        # What effects explain stands in them: without them no simulation has to be better than a mean.
        explained = unseen_errors(
            search.problem, output.name, search.nominal.simulated, search.held_augmented
        )[0]
        usual = min(declared, still if explained > still else declared)
        if refitted**2 <= VERDICT.shown * usual**2:
            continue
        harm = f"on rows that no fit has seen the refit is off by {refitted:.4g} {output.unit}"
        findings.append(
            Finding(
                rule="refit-worse",
                where=f"{case.path.name}: {output.name}",
                level="warning",
                message=f"{harm}, the simulation as declared by {declared:.4g} {output.unit}"
                if declared == usual
                else f"{harm}, an output that stands still at its mean by {still:.4g} {output.unit}",
            )
        )
    return tuple(findings)
