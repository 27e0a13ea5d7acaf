"""What to measure next: what parts a class, what narrows down the unknown, what a search had no time for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import DiagnosedEffect, Verdict, cut_short, untested
from toolkit.diagnosis.answer.held_out_errors import judged_unit
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import LOCATION, PRIORS, STRUCTURE, VERDICT
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.noise_floor import beyond_noise
from toolkit.diagnosis.search.unexplained import answered_input, own_swing
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects as catalogue
from toolkit.units import unit, with_unit

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Stacked
    from toolkit.diagnosis.law.learn import Laws
    from toolkit.diagnosis.search.search import Search
    from toolkit.diagnosis.search.unexplained import Line

_OF_LOADS = ("force", "moment", "mass", "bridge_ratio")
"""Dimensions of what known loads are applied to: a voltage or a count may be of anything."""

# Classes of effects that a recording cannot tell apart, and the measurement that would.


def equivalent_to(problem: Problem, step: Step) -> tuple[str, ...]:
    """Return the other names that explain a step as well, without its own; a parameter comes last."""
    names = [rival.active.effect.name for rival in step.rivals if rival.difference > -VERDICT.close]
    names += _always(problem, step.active)
    names += [] if step.parameter is None else [step.parameter.name]
    own = step.active.effect.name
    return tuple(dict.fromkeys(name for name in names if name != own))


def apart(effect: DiagnosedEffect) -> str:
    """Return the measurements that would tell an effect from its class, and of which names each speaks."""
    statements: dict[str, list[str]] = {}
    for name in (effect.name, *effect.equivalent_to):
        known = catalogue().get(name)  # a parameter of the simulation has none
        separates = f"a measurement of {name} by itself" if known is None else known.separates
        statements.setdefault(separates, []).append(name)
    return "; ".join(f"{text} ({', '.join(names)})" for text, names in statements.items() if text)


def parted(effect: DiagnosedEffect) -> str:
    """Return the sentence that says what would tell an effect from its class, or from what is like it."""
    others = effect.equivalent_to or _akin(effect.name)
    if not others:
        return ""
    return f"To tell {effect.name} from {', '.join(others)}: {apart(replace(effect, equivalent_to=others))}."


def _akin(name: str) -> tuple[str, ...]:
    """Return the other effects for which one may always be taken, however the recording parts them."""
    akin = catalogue()[name].akin
    return tuple(
        effect.name for effect in catalogue().values() if akin and effect.akin == akin and effect.name != name
    )


def _always(problem: Problem, active: AppliedEffect) -> list[str]:
    """Return the class that holds on this machine whatever the recording, the tire's effects first."""
    alike = active.effect.alike
    if alike is None or not alike.holds(CaseView(problem, active.channel, active.source)):
        return []
    members = [
        effect.name
        for effect in catalogue().values()
        if effect.alike is not None and effect.alike.group == alike.group
    ]
    return members[::-1]


def implausible(search: Search) -> tuple[str, ...]:
    """Return the parameters that are far off their priors beside every effect that was found."""
    values = zip(search.problem.declared, search.augmented.p, strict=False)
    return tuple(
        parameter.name
        for parameter, p in values
        if parameter.sd is not None and abs(p - parameter.value) > PRIORS.far * parameter.sd
    )


def next_measurements(
    search: Search,
    effects: tuple[DiagnosedEffect, ...],
    verdict: Verdict,
    *,
    rest: bool,
    skipped: tuple[str, ...],
    laws: Laws,
) -> tuple[str, ...]:
    """Return a sentence for each measurement that would say more than this case does.

    Parameters
    ----------
    rest : something is left without a name, beside the effects or without any
    laws : of what is left
    skipped : steps that a spent budget left out, the laws among them
    """
    sentences = [text for effect in effects if (text := parted(effect))]
    if search.disagreed is not None:
        (low, _, _), (high, _, _) = search.disagreed.ends
        name = search.disagreed.name
        sentences.append(
            f"The runs disagree about {name}: measure it by itself as it was in {low} and in {high}, and "
            "note what else differed between them."
        )
    elif rest:
        sentences += to_find_it(search, subject="What is left" if effects else "The mismatch")
    if rest:
        sentences += [
            *zeros_to_read(search),
            *_sensors(search, laws.fit if laws.listed else search.augmented),
        ]
    if verdict == "unknown" or effects:
        beside = ", ".join(dict.fromkeys(step.active.effect.name for step in search.steps))
        near = f"beside {beside}" if effects else f"even beside the nearest effects ({beside})"
        sentences += [
            f"Measure {name} by itself: {near} it is far off its prior."
            for name in (implausible(search) if search.steps else ())
        ]
    if untested(skipped):
        untried = "every known effect was tried" if cut_short(skipped) else "all of its tests were made"
        sentences.append(f"Give the search more time (--budget): it ended before {untried}.")
    elif verdict == "untestable":
        sentences.append(
            "Tighten the priors of the parameters that moved (certificate, data sheet), or "
            + ("vary the inputs." if search.problem.case.drivers else "begin runs from other states.")
        )
    if len(search.problem.runs) == 1:
        sentences.append("Repeat the run: with one recording alone, only blocks of it could be held out.")
    return tuple(sentences)


def zeros_to_read(search: Search) -> list[str]:
    """Return that a zero is to be read, where most of a rest is one that every run has to the same side.

    Of a few runs that is no proof of a zero that they share, and yet the first that a laboratory looks at. An
    output that only drifts has no zero of its own to read.
    """
    problem, sentences = search.problem, []
    for output in (each for each in problem.model.outputs if each.name not in problem.rates):
        kept, residual = problem.kept[output.name], search.augmented.residual[output.name]
        runs = [residual[rows][kept[rows]] for rows in problem.slices if kept[rows].any()]
        means = sorted((float(np.mean(run)) for run in runs), key=abs)
        taken = sum(len(run) * float(np.mean(run)) ** 2 for run in runs)
        if len(set(np.sign(means))) != 1 or taken < VERDICT.taken * float(np.sum(residual[kept] ** 2)):
            continue
        side = "high" if means[0] > 0 else "low"
        low, high = f"{abs(means[0]):.2g}", with_unit(f"{abs(means[-1]):.2g}", output.unit)
        where, when = (
            (f"in every run, by {low} to", "each run") if len(runs) > 1 else ("all along, by", "the run")
        )
        sentences.append(f"{output.name} reads {side} {where} {high}: read its zero before and after {when}.")
    return sentences


def _sensors(search: Search, beside: Fit) -> list[str]:
    """Return that sensors' standard deviations are to be stated, where a rest may be their noise in part.

    Parameters
    ----------
    beside : all that is told of the mismatch, its laws too
    """
    problem = search.problem
    beyond = beyond_noise(problem, beside)
    sentences = []
    for output in problem.model.outputs:
        part = beyond.get(output.name)
        if part is None or problem.stated_sd(output.name) is not None or part.process_sd <= part.sensor_sd:
            continue
        left = with_unit(f"{part.total_sd:.2g}", judged_unit(problem, output))
        sentences.append(
            f"State the standard deviation of {output.name} (sd) in the case, from its sensor's certificate "
            f"or a run at rest: how much of the {left} that are left is noise, this recording does not tell."
        )
    return sentences


def to_find_it(search: Search, subject: str = "The mismatch") -> list[str]:
    """Return what would narrow down a mismatch that no effect explains, by what it depends on.

    What can be varied, held or applied follows from the case: how many inputs it has, and of what kind.

    Parameters
    ----------
    subject : what the sentences are about: the whole mismatch, or what the effects leave of it
    """
    case = search.problem.case
    variables = dict.fromkeys(
        name for structure in search.structure if not structure.reason for name in structure.variables
    )
    inputs = [channel.name for channel in case.drivers if channel.role == "input"]
    channels = {channel.name for channel in case.drivers}
    of = {text: name for name in channels for text in (name, f"d{name}/dt", f"way of {name}")}
    told = {f"d{name}/dt": f"the rate of {name}" for name in channels}
    told |= {f"way of {name}": f"the way of {name}" for name in channels}
    read = [name for name in variables if name in of]
    listed = ", ".join(told.get(name, name) for name in read)
    driven = next((name for name in read if of[name] in inputs), None)
    sentences = []
    if driven is not None:
        alone = "alone varied, everything else held" if len(channels) > 1 else "varied in another way"
        sentences.append(
            f"{subject} depends on {listed}: repeat the run with {told.get(driven, driven)} {alone}."
        )
    elif read:  # nobody drives what is only recorded
        sentences.append(
            f"{subject} depends on {listed}: record runs in which {of[read[0]]} takes other values."
        )
    outputs = [output for output in search.problem.model.outputs if output.name in variables]
    for is_load in (True, False):
        names = ", ".join(output.name for output in outputs if _is_load(output.unit) is is_load)
        known = (
            "apply known loads over its range" if is_load else "record it small and large, beside a reference"
        )
        if names:
            sentences.append(f"{subject} depends on the size of {names}: {known}.")
    found = (structure.line for structure in search.structure if structure.line is not None)
    swings = {(line.angle, line.told): line for line in found}.values()
    sentences += [
        f"{subject} swings {line.told.replace(' per', ' times per')} of {line.angle}: {_AT_ANOTHER_SPEED}"
        for line in swings
        if line.angle
    ]
    lines = [line for line in swings if not line.angle]
    if lines:
        sentences += _swinging(search.problem, lines, search.augmented.simulated, subject)
    if "run" in variables:
        standing = _levels(search.problem)
        levels, do = " and ".join(standing), "does" if len(standing) == 1 else "do"
        sentences.append(
            f"{subject} differs from run to run, as {levels} {do}: change {levels} within a run, or have "
            "runs at more values, each twice."
            if standing
            else f"{subject} differs from run to run: repeat one run unchanged, and note what else changed."
        )
    if "time" in variables:
        sentences.append(f"{subject} goes with time: {_TO_PART_TIME[min(len(inputs), 2)].format(*inputs)}.")
    return sentences or [_WHERE_NOTHING_TELLS[min(len(inputs), 2)].format(*inputs)]


# By the number of inputs, two of them for several.
_TO_PART_TIME = (
    "repeat the run unchanged; what drifts does not come again as it was",
    "give {} the same course twice within one run; what drifts differs the second time",
    "hold all inputs still for as long as a run takes",
)
_WHERE_NOTHING_TELLS = (
    "Begin runs from other states, and record what else may act.",
    "Vary {} slowly and fast, little and much, and record what else may act.",
    "Vary one input alone, everything else held, and record what else may act.",
)


def _is_load(text: str) -> bool:
    """Tell whether a channel is what known loads are applied to: a force, a moment, a mass, a bridge."""
    return unit(text).dimension in _OF_LOADS


_AT_ANOTHER_SPEED = (
    "repeat the run at another speed; what is of the shaft keeps its number per turn, what is of time its "
    "frequency."
)


def _levels(problem: Problem) -> list[str]:
    """Return the recorded inputs that stand still in every run, and have another value in another run."""
    standing = []
    for channel in problem.case.drivers:
        columns = [run.columns.get(channel.name, np.zeros(0)) for run in problem.runs]
        columns = [column[np.isfinite(column)] for column in columns]
        if len(columns) < 2 or not all(len(column) for column in columns):
            continue
        among = np.ptp([np.mean(column) for column in columns])
        if among > 0 and max(np.std(column) for column in columns) < LOCATION.run * among:
            standing.append(channel.name)
    return standing


def _swinging(problem: Problem, lines: Sequence[Line], simulated: Stacked, subject: str) -> list[str]:
    """Return what to do about lines in time; of one in step with a recorded angle, its number a turn."""
    sentences, unturned = [], []
    for line in lines:
        order, answered = _order(problem, line.frequency), answered_input(problem, line)
        if order is None and answered is not None:
            name, multiple = answered
            times = "as fast" if multiple == 1 else f"{multiple} times as fast"
            sentences.append(
                f"{subject} swings at {line.told}, {times} as {name}: it answers to {name}. "
                f"Repeat the run with {name} half as large, and with {name} half as fast."
            )
            continue
        if order is None and (own := own_swing(problem, line, simulated)) is not None:
            sentences.append(
                f"{subject} swings at {line.told}, where the simulated {own[0]} swings by itself: its "
                "period, its damping or its start is a little off. Repeat the run from a start half as large."
            )
            continue
        if order is None:
            unturned.append(line.told)
            continue
        name, cycles = order
        sentences.append(
            f"{subject} swings at {line.told}, {cycles:.3g} times per turn of {name}: {_AT_ANOTHER_SPEED}"
        )
    if unturned:
        listed = " and ".join(unturned)
        sentences.append(f"{subject} swings at {listed}: record what turns or swings at this frequency.")
    return sentences


def _order(problem: Problem, frequency: float) -> tuple[str, float] | None:
    """Return the recorded angle that a line [Hz] keeps step with in every run, and its cycles per turn."""
    for channel in problem.case.drivers:
        if unit(channel.unit).dimension != "angle":
            continue
        orders, parted = [], 0.0
        for run in problem.runs:
            turns = np.unwrap(run.columns[channel.name] * unit(channel.unit).factor) / (2 * np.pi)
            speed, _ = np.polyfit(run.t - run.t[0], turns, 1) if run.rows > 1 else (0.0, 0.0)
            uneven = float(np.ptp(turns - speed * (run.t - run.t[0])))
            if abs(turns[-1] - turns[0]) < 1:
                break  # it swings to and fro, or stands
            orders.append(frequency / abs(speed))
            parted = max(parted, uneven * orders[-1])
        else:
            if parted < STRUCTURE.order_cycles and np.ptp(orders) < STRUCTURE.order_cycles:
                return channel.name, float(np.mean(orders))
    return None
