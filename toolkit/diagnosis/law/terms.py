"""The laws that may be missing in the equation of a state: of its states, its inputs and the time.

An event is a pulse: of every run the stretch of time in which an input would explain most. A pulse is a step
less a later one, so that the responses to a few dozen steps give those to every pair of ends; no descent from
a coarse grid finds them where the simulation rings, each period being a hill.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.law.ranking import all_responses, at_coefficients, at_unit_size, is_one_number
from toolkit.diagnosis.law.shapes import ALIKE, BESIDE, EACH, EXCHANGE, ONE, TWO, Shape, pulse
from toolkit.diagnosis.law.trial import Signal, Trial, started, trial_at
from toolkit.diagnosis.policy import LAWS
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.simulators.parameter_units import reduced
from toolkit.diagnosis.simulators.states import term_places
from toolkit.effects.law import ITSELF, POSITION, TIME

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Run
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.screen import LinearisedFit
    from toolkit.diagnosis.simulators.simulator import Moving


def terms_of(problem: Problem) -> Iterator[Trial]:
    """Give every law that may be missing in the equation of a state, at every start, without gains."""
    motion = problem.model.capability.motion
    if motion is None or not motion.integrates:
        return
    for channel, of in entered(problem, motion).items():
        force = reduced(motion.units(channel)[0])
        listed = _signals(problem, motion, channel, of)
        steady = [signal for signal in listed if signal.steady]
        arguments: list[tuple[Shape, tuple[Signal, ...]]] = [
            (shape, (signal,)) for signal in listed for shape in ONE
        ]
        arguments += [(shape, (signal,)) for signal in steady for shape in BESIDE]
        for pair in itertools.combinations(steady, 2):
            alike = pair[0].unit == pair[1].unit
            arguments += [(shape, pair) for shape in (*TWO, *(ALIKE if alike else ()))]
        for shape, signals in arguments:
            for trial in started(problem, shape, signals, "enters", channel, force=force):
                if not _is_a_force(trial, motion):
                    yield trial


def _is_a_force(trial: Trial, motion: Moving) -> bool:
    """Tell whether a law of a state is one number wherever the state went: a force, and an effect."""
    if trial.form != "static" or len(trial.signals) != 1:
        return False
    (signal,) = trial.signals
    went = (np.array(state.quantiles) for state in motion.states if state.name == signal.name)
    return is_one_number(at_unit_size(trial, next(went, signal.values)))


def joint_terms_of(problem: Problem, base: Fit, screen: LinearisedFit) -> Iterator[Trial]:
    """Give laws that the equations of several states of one kind may lack at once, with their gains.

    What two states exchange: what one loses the other has, less or more by how much each holds; in one
    equation alone it would be a loss to nowhere. And what all of them have, each by its own state, or by how
    far that is from an input of its unit: a rod that gives heat to the room does so along all of its length,
    and of no one place does a loss explain much.
    """
    motion = problem.model.capability.motion
    if motion is None or not motion.integrates:
        return
    states = {state.name: np.array(state.quantiles) for state in motion.states}
    kinds: dict[tuple[str, str], dict[str, str]] = {}
    for name, of in entered(problem, motion).items():
        if name in states:
            kinds.setdefault((reduced(motion.units(name)[1]), reduced(motion.units(name)[0])), {})[name] = of
    for (text, force), alike in kinds.items():
        of_each = {
            name: Signal(written=f"[{name}]", name=name, unit=text, values=states[name]) for name in alike
        }
        arguments: list[tuple[Shape, dict[str, tuple[Signal, ...]]]] = [
            (shape, dict.fromkeys(pair, tuple(of_each[name] for name in pair)))
            for pair in itertools.combinations(alike, 2)
            for shape in EXCHANGE
        ]
        if len(alike) > 1:
            listed = {name: _signals(problem, motion, name, of) for name, of in alike.items()}
            arguments += [(shape, {name: (own[0],) for name, own in listed.items()}) for shape in EACH]
            others = [signal for signal in next(iter(listed.values()))[1:] if signal.name not in alike]
            arguments += [
                (shape, {name: (own[0], other) for name, own in listed.items()})
                for other in others
                if other.unit == text
                for shape in EXCHANGE
            ]
        for shape, places in arguments:
            trials = [
                trial_at(problem, shape, signals, "enters", name, {}, force=force)
                for name, signals in places.items()
            ]
            joined = _joined(problem, base, screen, trials)
            if joined is not None:
                yield joined


def _joined(problem: Problem, base: Fit, screen: LinearisedFit, trials: Sequence[Trial]) -> Trial | None:
    """Return laws as one of several equations, with its gain; None where one of them moves nothing.

    Along a rod, or in a row of cells that are alike, no place has a size of its own: where each reads its own
    state, one size is for all of them unless sizes of their own gain what these cost.
    """
    answered = [each for each in all_responses(problem, base, trials) if each is not None]
    if len(answered) < len(trials):
        return None
    own = {name: np.hstack([each[name] for each in answered]) for name in problem.names}
    gain, sizes, trust = screen.gain(own)
    tied: Trial | None = None
    if trials[0].signals != trials[1].signals:
        one = {name: column.sum(axis=1, keepdims=True) for name, column in own.items()}
        gain_of_one, size, trust_of_one = screen.gain(one)
        dearer = math.log(max(problem.values, 1.0)) * (len(trials) - 1)
        if gain * trust - dearer < gain_of_one * trust_of_one:
            gain, sizes, trust, tied = gain_of_one, size * len(trials), trust_of_one, trials[0]
    joined = None
    for trial, own_size in zip(reversed(trials), reversed(sizes), strict=True):
        as_first = None if tied is None or trial is tied else tied.applied.key
        made = at_coefficients(trial, [own_size])
        joined = replace(
            made, applied=replace(made.applied, sized_as=as_first), partner=joined, gain=gain * trust
        )
    return joined


def entered(problem: Problem, motion: Moving) -> dict[str, str]:
    """Return the states whose equation a law may enter, and of what a law is there.

    That the rate of a position is a speed is no physics that something could be left out of.
    """
    places = term_places(problem.model.places)
    positions = {motion.position(channel) for channel in places}
    return {channel: of for channel, of in places.items() if channel not in positions}


def _signals(problem: Problem, motion: Moving, channel: str, of: str) -> list[Signal]:
    """Return what a law in the equation of a state may read: itself first, then its position, then others."""
    sizes = motion.sizes(channel, lambda _: 1.0)
    _, speed, position = map(reduced, motion.units(channel))
    view = CaseView(problem, channel)

    symmetric = np.linspace(-1, 1, 41)
    grid = sizes.fastest * symmetric if of == "velocity" else np.linspace(0, sizes.level, 41)
    own = view.origin(channel)
    if own is not None:
        grid = next(np.array(state.quantiles) for state in motion.states if state.name == channel)
    listed = [Signal(written=f"[{ITSELF}]", name=channel, unit=speed, values=grid, origin=own)]
    names = {channel}
    if sizes.has_position:
        name = motion.position(channel) or POSITION
        way = sizes.farthest * symmetric
        listed.append(Signal(written=f"[{POSITION}]", name=name, unit=position, values=way))
        names.add(name)
    inputs = [
        (state.name, state.unit, np.array(state.quantiles))
        for state in motion.states
        if state.name not in names
    ]
    for driver in problem.case.drivers:
        columns = [run.columns[driver.name] for run in problem.runs if driver.name in run.columns]
        if len(columns) == len(problem.runs) and all(np.isfinite(column).all() for column in columns):
            inputs.append((driver.name, reduced(problem.case.unit(driver.name)), np.concatenate(columns)))
    times = np.concatenate([run.t for run in problem.runs])
    moving = [
        Signal(
            written=f"[{name}]", name=name, unit=text, values=values, steady=name != TIME,
            origin=view.origin(name),
        )
        for name, text, values in (*inputs, (TIME, "s", times))
        if np.ptp(values) > 1e-9 * np.abs(values).max(initial=0.0)
    ]  # fmt: skip
    return listed + moving


def pulses_of(problem: Problem, base: Fit, screen: LinearisedFit) -> Iterator[Trial]:
    """Give for every state that an input may enter, and every run, the pulse that explains most."""
    motion = problem.model.capability.motion
    if motion is None or not motion.integrates:
        return
    for channel in entered(problem, motion):
        force = reduced(motion.units(channel)[0])
        for run in problem.runs:
            if run.rows >= LAWS.event_rows:
                yield from _strongest(problem, base, screen, run, channel, force)


def _strongest(
    problem: Problem, base: Fit, screen: LinearisedFit, run: Run, channel: str, force: str
) -> Iterator[Trial]:
    """Give the pulse of one run, its ends on rows: first on a coarse grid, then on all rows nearby."""
    row = float(np.median(np.diff(run.t)))
    grid = run.t[np.unique(np.linspace(0, run.rows - 1, LAWS.ends).astype(int))]
    best = _best_pair(problem, base, screen, run, channel, force, grid)
    if best is not None:
        near = np.abs(run.t[:, None] - np.array(best)).min(axis=1) <= np.diff(grid).max()
        best = _best_pair(problem, base, screen, run, channel, force, run.t[near])
    if best is not None:
        best_pulse = _pulse(problem, run, channel, force, *best, row)
        yield replace(best_pulse, looked=len(grid) * (len(grid) - 1) // 2)


def _pulse(
    problem: Problem, run: Run, channel: str, force: str, start: float, end: float, row: float
) -> Trial:
    time = Signal(written=f"[{TIME}]", name=TIME, unit="s", values=run.t, steady=False)
    trial = trial_at(problem, pulse(start, end, row), (time,), "enters", channel, {}, force=force)
    return replace(trial, applied=replace(trial.applied, runs=frozenset({run.name})))


def _best_pair(
    problem: Problem, base: Fit, screen: LinearisedFit, run: Run, channel: str, force: str, ends: Array
) -> tuple[float, float] | None:
    """Return the two of some times between which a pulse explains most, None where none is of use."""
    row = float(np.median(np.diff(run.t)))
    after = float(2 * run.t[-1] - run.t[0])  # a step lasts beyond the last row
    trials = [_pulse(problem, run, channel, force, end, after, row) for end in ends.tolist()]
    none = {name: np.zeros((problem.rows, 1)) for name in problem.names}
    steps = [none if step is None else step for step in all_responses(problem, base, trials)]
    whitened = screen.rows({name: np.hstack([step[name] for step in steps]) for name in problem.names})
    under = screen.coloured
    whitened -= under.span @ (under.span.T @ whitened)
    along, gram = whitened.T @ under.left, whitened.T @ whitened
    first, last = np.triu_indices(len(ends), 1)
    lasts = ends[last] - ends[first]
    size = gram[first, first] + gram[last, last] - 2 * gram[first, last]
    usable = (lasts >= LAWS.event_least * row) & (lasts <= LAWS.event_most * (run.t[-1] - run.t[0]))
    usable &= size > LAWS.apart * float(np.diag(gram).max(initial=0.0))
    if not usable.any():
        return None
    strength = np.where(usable, (along[first] - along[last]) ** 2 / np.where(usable, size, 1.0), 0.0)
    at = int(np.argmax(strength))
    return float(ends[first[at]]), float(ends[last[at]])
