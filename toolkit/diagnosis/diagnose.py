"""A case from end to end: simulation as declared, search, answer, predictions; within a budget."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import Diagnosis
from toolkit.diagnosis.answer.build_answer import answer_of
from toolkit.diagnosis.answer.case_findings import calibration_findings, case_findings
from toolkit.diagnosis.answer.failed_runs import FailedRuns
from toolkit.diagnosis.answer.naming import kept_beside_laws, mostly_unknown
from toolkit.diagnosis.answer.truncated_answer import STEPS, does_not_vary, without_search
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.fit.averages import (
    averages_findings,
    is_smooth,
    moved_by_inputs,
    noisy_inputs,
    of_kept_rows,
    rows_averaged,
)
from toolkit.diagnosis.fit.predict import prediction_csv, prediction_names
from toolkit.diagnosis.fit.problem import Problem, problem_of, without_outliers
from toolkit.diagnosis.fit.row_order import by_inputs, seed_of
from toolkit.diagnosis.law.foretelling import before_nothing
from toolkit.diagnosis.law.learn import Laws, learned, learned_by_size
from toolkit.diagnosis.law.resembling import with_resemblances
from toolkit.diagnosis.law.rivals import judged_by_laws, without_imitations, without_untested
from toolkit.diagnosis.policy import BUDGET
from toolkit.diagnosis.search.between_rows import with_readings_between_rows
from toolkit.diagnosis.search.parameters_alike import with_parameters_alike
from toolkit.diagnosis.search.run_parameters import with_disagreement
from toolkit.diagnosis.search.search import Search, search
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.diagnosis.simulators.averaged import MeansOf, averaged, smoothed
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.diagnosis.simulators.built_in import built_in_findings
from toolkit.diagnosis.simulators.case_code import WORKER_LIMITS, CaseCode, running
from toolkit.diagnosis.simulators.simulator import Model, Supervised
from toolkit.errors import FitError
from toolkit.findings import Finding
from toolkit.worker.posix import Limits
from toolkit.worker.worker import LateError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """An answer, the search that it came from and the laws of its rest; None without a search, or no time.

    ``predictions`` are name and content of the files that the case asks for, in its order.
    """

    diagnosis: Diagnosis
    search: Search | None
    laws: Laws | None = None
    predictions: tuple[tuple[str, str], ...] = ()


def diagnose(
    case: Case,
    calibrations: Path | None,
    *,
    budget_s: float = 600.0,
    tell: Callable[[str], None] = lambda _: None,
    limits: Limits | None = WORKER_LIMITS,
) -> Result:
    """Diagnose a case.

    Parameters
    ----------
    calibrations : folder of the registry, None without one
    budget_s : seconds after which a partial answer is given
    tell : told what is searched
    limits : of the worker in which the case's own code runs; None runs it in this process, with all that it
        may do to it

    Raises
    ------
    ConfigError
        the case cannot be used; FitError: its simulation gives no usable output as declared
    """
    with running(case, limits) as code:
        budget = TimeBudget(budget_s, tell, alarm=code is None)
        if code is not None:
            code.until = budget.until
        return _diagnosed(case, calibrations, budget, budget_s, code)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Posed:
    """A case as a problem: its simulation ends with the budget until released, its failures are counted."""

    case: Case
    problem: Problem
    failed: FailedRuns
    supervised: Supervised


def _posed(case: Case, model: Model, budget: TimeBudget) -> _Posed:
    failed = FailedRuns(model.simulate)
    supervised = Supervised(model, failed, budget.guarded)
    return _Posed(case=case, problem=problem_of(case, supervised), failed=failed, supervised=supervised)


def _diagnosed(
    case: Case, calibrations: Path | None, budget: TimeBudget, budget_s: float, code: CaseCode | None
) -> Result:
    try:
        posed = _posed(case, budget.guarded(model_of)(case, calibrations, code), budget)
    except BudgetSpentError:
        return Result(diagnosis=_too_late(case, None, None, (), budget.step), search=None)
    findings: tuple[Finding, ...] = (
        *case_findings(posed.problem),
        *built_in_findings(case),
        *calibration_findings(case, calibrations),
    )
    declared, outcome, laws = None, None, None
    try:
        declared = _first_look(posed.problem, budget)
        ordered = _of_readings(posed.problem, declared, calibrations, budget, code)
        if ordered is not None:
            posed, declared = ordered
        means = _of_means(posed.problem, declared, calibrations, budget, code)
        if means is not None:
            posed, told = means
            findings, declared = (*findings, *told), _first_look(posed.problem, budget)
        if does_not_vary(posed.problem):
            answer = without_search(
                posed.case, posed.problem, declared, why="the outputs do not vary", findings=findings,
                next_measurements=("Vary the inputs: an output that stands still tells nothing.",),
            )  # fmt: skip
        else:
            seed = seed_of(posed.case)
            with budget.limited():
                outcome = search(posed.problem, seed=seed, budget=budget)
                outcome = before_nothing(outcome, seed=seed, budget=budget)
                laws = learned(outcome, withdrawn=mostly_unknown(outcome), budget=budget)
                outcome = kept_beside_laws(outcome, laws)
                if outcome.kept:
                    laws = learned(outcome, withdrawn=False, budget=budget)
                if mostly_unknown(outcome) or not outcome.steps:
                    outcome, laws = learned_by_size(outcome, laws, budget)
                outcome, laws = without_imitations(outcome, laws, budget)
                outcome, laws = judged_by_laws(outcome, laws, seed=seed, budget=budget)
                outcome = without_untested(outcome, laws)
                laws = with_resemblances(outcome, laws, budget)
                outcome = with_readings_between_rows(outcome)
                outcome = with_parameters_alike(outcome)
                outcome = with_disagreement(outcome, laws.held_out, budget)
            answer = answer_of(posed.case, outcome, laws, findings)
    except BudgetSpentError as error:
        answer = _too_late(posed.case, posed.problem, declared, findings, str(error))
    finally:
        posed.supervised.release()
    deaths = () if code is None else code.findings()
    answer = replace(answer, findings=(*answer.findings, *posed.failed.findings(case), *deaths))
    files, late = _predictions(posed.problem, outcome, laws, budget, budget_s, code)
    if late:
        answer = replace(answer, complete=False, skipped=(*answer.skipped, late))
    return Result(diagnosis=answer, search=outcome, laws=laws, predictions=files)


def _of_readings(
    problem: Problem,
    declared: dict[str, Array],
    calibrations: Path | None,
    budget: TimeBudget,
    code: CaseCode | None,
) -> tuple[_Posed, dict[str, Array]] | None:
    """Return a case without an order of rows by its inputs; None where rows have one.

    They have one to a simulation too whose rows are others where they stand in another order.
    """
    readings = by_inputs(problem.case)
    if readings is None:
        return None
    case, orders = readings
    if code is not None:
        code.learn(case.runs)
    posed = _posed(case, budget.guarded(model_of)(case, calibrations, code), budget)
    if len(posed.problem.runs) != len(orders):  # some have the phase of a tare, and are no part of it
        return None
    at = np.concatenate([rows.start + order for rows, order in zip(problem.slices, orders, strict=True)])
    simulated = posed.problem.simulate(_values(posed.problem), ())
    same = all(
        np.allclose(simulated[name], column[at], rtol=1e-9, atol=0, equal_nan=True)
        for name, column in declared.items()
    )
    return (posed, simulated) if same else None


def _of_means(
    problem: Problem,
    declared: dict[str, Array],
    calibrations: Path | None,
    budget: TimeBudget,
    code: CaseCode | None,
) -> tuple[_Posed, tuple[Finding, ...]] | None:
    """Return the case with its rows averaged; None where single rows tell something, or have no means."""
    problem = without_outliers(problem, {name: problem.observed[name] - declared[name] for name in declared})
    rows = rows_averaged(problem, declared)
    if rows == 1:
        return None
    whole = of_kept_rows(problem, rows)
    even, means = smoothed(whole, rows, noisy_inputs(problem.case)), averaged(whole, rows)
    if code is not None:
        code.learn((*whole.runs, *even.runs))
    build = budget.guarded(model_of)
    plain, smooth = build(whole, calibrations, code), build(even, calibrations, code)
    of_rows, steady = _posed(whole, plain, budget).problem, _posed(even, smooth, budget).problem
    try:
        as_recorded, as_smooth = (each.simulate(_values(each), ()) for each in (of_rows, steady))
    except FitError:  # it does not take inputs between those that were recorded
        return None
    shown = moved_by_inputs(of_rows, as_recorded, as_smooth, rows)
    if not (shown and is_smooth(of_rows, as_recorded, as_smooth, rows)):
        return None
    told = averages_findings(problem.case, rows)
    return _posed(means, MeansOf(plain, smooth, (whole, even, means), rows), budget), told


def _values(problem: Problem) -> tuple[float, ...]:
    return tuple(parameter.value for parameter in problem.free)


def _first_look(problem: Problem, budget: TimeBudget) -> dict[str, Array]:
    """Return the simulation as declared; what cannot be simulated ends here."""
    budget.tell("the simulation as declared")
    started = time.monotonic()
    simulated = problem.simulate(_values(problem), ())
    quick = time.monotonic() - started < BUDGET.quick_s * len(problem.runs)
    repeats = problem.model.capability.repeats
    if quick and repeats is not None:
        repeats(problem.runs[0], problem.known)
    for run in problem.case.predict if quick else ():
        problem.model.simulate(run, problem.known, ())
    return simulated


def _predictions(
    problem: Problem,
    outcome: Search | None,
    laws: Laws | None,
    budget: TimeBudget,
    budget_s: float,
    code: CaseCode | None,
) -> tuple[tuple[tuple[str, str], ...], str]:
    """Return the files of predictions, or what was skipped where the time is up."""
    runs = problem.case.predict
    seconds = max(budget.until - time.monotonic(), BUDGET.grace * budget_s)
    if not runs or len(runs) * 3 * budget.last_s > seconds:
        return (), "predictions" if runs else ""
    fits: list[Fit | None] = [None, None, None]
    if outcome is not None:
        fits[1] = outcome.refitted
        fits[2] = outcome.refitted if mostly_unknown(outcome) else outcome.augmented
    if laws is not None and laws.listed:
        fits[2] = laws.fit
    budget.tell("predictions")
    if code is not None:
        code.until = time.monotonic() + seconds
    try:
        return tuple(
            (name, prediction_csv(problem, run, fits))
            for name, run in zip(prediction_names(runs), runs, strict=True)
        ), ""
    except LateError:
        return (), "predictions"


def _too_late(
    case: Case,
    problem: Problem | None,
    declared: dict[str, Array] | None,
    findings: tuple[Finding, ...],
    at: str,
) -> Diagnosis:
    """Return the partial answer of a budget that was spent before anything could be judged."""
    return without_search(
        case, problem, declared, why="the budget was spent before the search", findings=findings,
        next_measurements=("Give a larger --budget, fewer rows, or a faster simulation.",),
        skipped=tuple(dict.fromkeys((at, *STEPS))),
    )  # fmt: skip
