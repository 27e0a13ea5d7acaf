"""The laws that may be missing in the equation of a state: of its states, its inputs and the time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.law.shapes import ALIKE, ONE, TWO, Shape
from toolkit.diagnosis.law.trial import Signal, Trial, started
from toolkit.diagnosis.simulators.parameter_units import reduced
from toolkit.diagnosis.simulators.states import term_places
from toolkit.effects.law import ITSELF, POSITION, TIME

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.problem import Problem
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
        made: list[tuple[Shape, tuple[Signal, ...]]] = [
            (shape, (signal,)) for signal in listed for shape in ONE
        ]
        for pair in itertools.combinations(steady, 2):
            alike = pair[0].unit == pair[1].unit
            made += [(shape, pair) for shape in (*TWO, *(ALIKE if alike else ()))]
        for shape, signals in made:
            yield from started(problem, shape, signals, "enters", channel, force=force)


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
    both_ways = np.linspace(-1, 1, 41)
    own = sizes.fastest * both_ways if of == "velocity" else np.linspace(0, sizes.level, 41)
    listed = [Signal(written=f"[{ITSELF}]", name=channel, unit=speed, values=own)]
    known = {channel}
    if sizes.has_position:
        name = motion.position(channel) or POSITION
        way = sizes.farthest * both_ways
        listed.append(Signal(written=f"[{POSITION}]", name=name, unit=position, values=way))
        known.add(name)
    others = [
        (state.name, state.unit, np.array(state.quantiles))
        for state in motion.states
        if state.name not in known
    ]
    for driver in problem.case.drivers:
        columns = [run.columns[driver.name] for run in problem.runs if driver.name in run.columns]
        if len(columns) == len(problem.runs) and all(np.isfinite(column).all() for column in columns):
            others.append((driver.name, reduced(problem.case.unit(driver.name)), np.concatenate(columns)))
    times = np.concatenate([run.t for run in problem.runs])
    moving = [
        Signal(written=f"[{name}]", name=name, unit=text, values=values, steady=name != TIME)
        for name, text, values in (*others, (TIME, "s", times))
        if np.ptp(values) > 1e-9 * np.abs(values).max(initial=0.0)
    ]
    return listed + moving
