"""What a run may be, as options and the case state it; what cannot be is refused with the nearest."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError
from toolkit.files import number_of

if TYPE_CHECKING:
    from toolkit.diagnosis.answer.answer import DiagnosedEffect
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.planning.next_run import NextRun, RunSearch
    from toolkit.planning.run_changes import RunLimits

_SLACK = 1e-3  # of a rate: times of rows are printed


def stated_limits(spans: Sequence[str], rates: Sequence[str], case: Case) -> RunLimits:
    """Return what options state of inputs (``NAME=LOW..HIGH``) and of their rates (``NAME=MOST``).

    Raises
    ------
    ConfigError
        ``plan-next``: one cannot be read, or is stated twice
    """
    from toolkit.planning.run_changes import RunLimits

    names = {channel.name: channel.unit for channel in case.drivers}
    named = ", ".join(f"{name} [{unit}]" for name, unit in names.items())
    for option, texts in (("--limit", spans), ("--rate", rates)):
        stated = [text.partition("=")[0].strip() for text in texts]
        if twice := sorted({name for name in stated if stated.count(name) > 1}):
            raise wrong("a limit is stated twice", option, ", ".join(twice), "each input once",
                         "leave all but one out")  # fmt: skip

    def read(text: str, option: str, form: str, count: int) -> tuple[str, tuple[float, ...]]:
        name, _, numbers = text.partition("=")
        read_ends = [number_of(number) for number in numbers.split("..")]
        ends = tuple(end for end in read_ends if end is not None)
        rising = len(ends) == len(read_ends) == count and (ends[0] < ends[-1] or count == 1)
        if name.strip() not in names or not rising or (count == 1 and ends[0] <= 0):
            example = f"{case.drivers[0].name}={'-10..10' if count > 1 else '5'}"
            raise wrong(
                "a limit cannot be read", option, text, f"{form} of {named}, numbers alone",
                f"write for example {example}",
            )  # fmt: skip
        return name.strip(), ends

    values = dict(read(text, "--limit", "NAME=LOW..HIGH, the lower one first,", 2) for text in spans)
    fastest = dict(read(text, "--rate", "NAME=MOST, above 0,", 1) for text in rates)
    return RunLimits(
        values={name: (low, high) for name, (low, high) in values.items()},
        rates={name: most for name, (most,) in fastest.items()},
    )


def least_step(sample_rate_Hz: float | None, problem: Problem) -> float:
    """Return the least time from row to row [s] that can be recorded: as it was, where nothing is said of it.

    Raises
    ------
    ConfigError
        ``plan-next``: the case has no time, or its recordings are denser
    """
    from toolkit.machine import load_machine
    from toolkit.planning.members import row_step

    case = problem.case
    stated = case.sample_rate_Hz if sample_rate_Hz is None else sample_rate_Hz
    where = str(case.path) if sample_rate_Hz is None else "--sample-rate"
    recorded = 1 / min(row_step(run) for run in problem.runs) if case.has_time else math.inf
    if stated is None:
        machine = load_machine(case.simulation.machine) if case.simulation.kind == "machine" else None
        return 1 / ((machine and machine.sample_rate_Hz) or recorded)
    if not stated >= recorded * (1 - _SLACK):
        raise wrong(
            "rows cannot be recorded so seldom", where, f"sample rate {stated:g} Hz",
            f"{recorded:.6g} Hz at least, as recorded" if case.has_time else "a case with a time",
            "leave the sample rate out, or state what can be recorded",
        )  # fmt: skip
    return 1 / stated


def longest_run(minutes: float | None, problem: Problem) -> float:
    """Return the longest that a run may take [s]: as a recording, where nothing is said of it.

    Raises
    ------
    ConfigError
        ``plan-next``: the case has no time, or every recording takes longer
    """
    case = problem.case
    stated = case.longest_run_s if minutes is None else 60 * minutes
    if stated is None:
        return 0.0
    shortest = min(float(run.t[-1] - run.t[0]) for run in problem.runs) if case.has_time else math.inf
    if not stated >= shortest * (1 - _SLACK):
        raise wrong(
            "no run is so short", str(case.path) if minutes is None else "--minutes", f"{stated / 60:g} min",
            f"{shortest / 60:.4g} min at least, as recorded" if case.has_time else "a case with a time",
            "leave it out, or state how long a run may be",
        )  # fmt: skip
    return stated


def denser_rows(search: RunSearch, until: Callable[[], bool]) -> tuple[float, NextRun] | None:
    """Return the rate of rows [Hz] beyond what is stated at which a run would part a pair, and that run."""
    from toolkit.planning.members import row_step

    if not search.problem.case.has_time:
        return None
    limits = dataclasses.replace(search.limits, step_s=0.0)
    wider = dataclasses.replace(search, limits=limits, judged={}, runs={}, dense={}, until=until)
    chosen = wider.judge(wider.best())
    if chosen is None or not chosen.parts:
        return None
    return 1 / row_step(chosen.run), chosen


def nothing_parts(
    search: RunSearch,
    chosen: NextRun,
    effect: DiagnosedEffect,
    denser: tuple[float, NextRun] | None,
    *,
    complete: bool,
) -> ConfigError:
    """Return the error of a class that no run within the limits parts, with what would."""
    from toolkit.diagnosis.answer.next_measurements import apart
    from toolkit.diagnosis.policy import VERDICT
    from toolkit.planning.next_run import MOST_RECORDINGS

    most = max(0.0, *(gain for _, _, gain in chosen.pairs))
    steps = [] if complete else ["search longer with --budget"]
    steps.append("allow more")
    nearest = "; ".join(chosen.change.words())
    if denser is not None:
        rate, parting = math.ceil(denser[0] * (1 - 1e-6)), denser[1]
        nearest = (
            f"{'; '.join(parting.change.words())}, which names the true one in {100 * parting.power:.0f} %"
        )
        steps.append(f"--sample-rate {rate} where rows can be recorded so densely")
    if search.problem.case.has_time:
        often, sure = search.repeated(chosen), search.repeated(chosen, power=VERDICT.interval)
        nearest += f"; {_needed(search, chosen, often, sure)}"
        possible = [made for made in (sure, often) if made is not None and made.times <= MOST_RECORDINGS]
        if possible:
            steps.append(f"--minutes {_up(possible[0].seconds / 60)} where it may take so long")
    return ConfigError(
        "no run within the limits parts the class", where="--limit, --rate, --minutes",
        got=f"{' and '.join((effect.name, *effect.equivalent_to))}: expected log-evidence {most:.2g}",
        expected=f"more than {VERDICT.close:g}; nearest: {nearest}",
        next_step=f"{', '.join(steps)}, or measure by itself: {apart(effect)}",
        rule="plan-infeasible",
    )  # fmt: skip


def _needed(search: RunSearch, chosen: NextRun, often: NextRun | None, sure: NextRun | None) -> str:
    """Return how long a run would have to be: as the nearest goes on, and at least, whatever its course.

    ``often`` is as often as it parts a pair, ``sure`` as often as it names the true member nearly always.
    """
    from toolkit.diagnosis.policy import VERDICT

    why = (
        "by their own predictions the members' fits of it may end elsewhere"
        if any(predicted.lost for predicted in chosen.predicted)
        else "each member's parameters follow the other"
    )
    said = (
        f"made again and again it parts no pair, as {why}"
        if often is None
        else f"it would take {_long(often.seconds)} of it ({often.times} times as many rows; "
        f"power {100 * often.power:.0f} %)"
    )
    if sure is not None:
        said += f", and {_long(sure.seconds)} for {100 * sure.power:.0f} %"
    if VERDICT.close < search.farthest * chosen.seconds:
        return said  # no more than is known: a run of that time was looked for, and parts nothing
    return (
        f"{said}, and by no course less than {_long(VERDICT.close / search.farthest)}, were every row as far "
        f"apart as the farthest of the {len(search.judged)} runs that were tried, and nothing fitted beside"
    )


def _up(size: float) -> str:
    """Return a number that is larger by less than a hundredth.

    >>> _up(12.341), _up(120341.0)
    ('12.4', '121000')
    """
    step = 10.0 ** (math.floor(math.log10(size)) - 2)
    return f"{math.ceil(size / step) * step:.12g}"


def _long(seconds: float) -> str:
    """Return a time for people.

    >>> _long(41.2), _long(1500.0), _long(9e4), _long(4e7)
    ('41 s', '25 min', '25 h', '460 days')
    """
    for limit, unit, name in ((120, 1, "s"), (7200, 60, "min"), (4 * 86400, 3600, "h")):
        if seconds < limit:
            return f"{seconds / unit:.2g} {name}"
    return f"{float(f'{seconds / 86400:.2g}'):,.0f} days".replace(",", " ")


def infeasible(problem: Problem, limits: RunLimits) -> ConfigError:
    """Return the error of limits that no change of a recording keeps, with the nearest."""
    from toolkit.planning.run_changes import nearest_limits

    run, nearest = nearest_limits(problem, limits)

    # Rounded outward: the recording itself lies on the limit.
    def stated(of: RunLimits, ends: Callable[[float, float], str]) -> str:
        spans = [f"--limit {name}={ends(*span)}" for name, span in of.values.items()]
        return " ".join(spans + [f"--rate {name}={ends(0.0, most)[3:]}" for name, most in of.rates.items()])

    return ConfigError(
        "no run stays within the limits", where="--limit, --rate",
        got=stated(limits, lambda low, high: f"{low:g}..{high:g}"),
        expected=f"nearest: what was recorded in {run}",
        next_step=f"ask with {stated(nearest, _ends)}; nothing was written",
        rule="plan-infeasible",
    )  # fmt: skip


def _ends(low: float, high: float) -> str:
    step = 10.0 ** (math.floor(math.log10(high - low)) - 3)
    return f"{math.floor(low / step) * step:.6g}..{math.ceil(high / step) * step:.6g}"


def wrong(problem: str, where: object, actual: object, expected: str, next_step: str) -> ConfigError:
    """Return the error of a run that cannot be asked for so (``plan-next``)."""
    return ConfigError(
        problem, where=where, got=actual, expected=expected, next_step=next_step, rule="plan-next"
    )
