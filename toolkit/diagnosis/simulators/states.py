"""What the states of an equation are, as far as pairs and the recording's units tell: which effects fit them.

A temperature has no dry friction, and a level no drag: such an effect would take the place of what is left
out there, under a name that has no meaning.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.parameter_units import reduced
from toolkit.diagnosis.simulators.setting import SPEEDS, dimension
from toolkit.effects.catalogue import effects
from toolkit.errors import ConfigError
from toolkit.units import unit, units_alike

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.simulators.simulator import Output
    from toolkit.effects.effect import Effect
    from toolkit.effects.facts import Term

_FORCES = frozenset({"force", "moment"})
_PLACES = frozenset({"length", "angle"})
_OPEN = frozenset({"ratio"})  # a number without unit may be anything


def shown_alone(
    x: Array, shown: Mapping[str, Array], outputs: Sequence[Output]
) -> dict[int, tuple[Output, float]]:
    """Return of every state the output that shows it alone, and by how much: output = factor * state.

    Parameters
    ----------
    x : the states of a run, shape (states, rows)
    shown : the outputs at them, shape (rows,) each
    """
    proportions = {}
    for output in outputs:
        for i, state in enumerate(x):
            at = int(np.argmax(np.abs(state)))
            if np.ptp(state) == 0 or state[at] == 0:
                continue
            factor = float(shown[output.name][at] / state[at])
            off = np.abs(shown[output.name] - factor * state).max()
            if factor and off <= 1e-9 * abs(factor * state[at]):
                proportions[i] = (output, factor)
    return proportions


def dimensions(proportions: Mapping[int, tuple[Output, float]]) -> dict[int, str]:
    """Return the dimension of every state that an output shows alone."""
    meanings = {i: dimension(output.unit) for i, (output, _) in proportions.items()}
    return {i: meaning for i, meaning in meanings.items() if meaning not in _OPEN}


def state_units(
    names: Sequence[str], proportions: Mapping[int, tuple[Output, float]], moved: Sequence[bool], case: Case
) -> dict[str, str]:
    """Return the units of states, as far as they are told.

    A simulation in metres may show its place in millimetres, under one name. A state that an output shows
    alone has the unit whose values make the output's; of a state that does not move the name alone tells.

    Parameters
    ----------
    moved : of every state, whether it does
    """
    stated = {channel.name: channel.unit for channel in case.channels}
    of_outputs = {output.name for output in case.outputs}
    units: dict[str, str] = {}
    for i, name in enumerate(names):
        if i in proportions:
            output, factor = proportions[i]
            units[name] = output.unit if abs(factor) == 1 else _multiple(output.unit, abs(factor))
        elif name in stated and not (moved[i] and name in of_outputs):
            units[name] = stated[name]
    return {name: text for name, text in units.items() if text != "1"}


def _multiple(text: str, factor: float) -> str:
    """Return the unit that is so many times another, "1" where none is known by a name."""
    own = unit(text)
    alike = (unit(name) for name in (() if own.offset else units_alike(text)))
    return next(
        (each.text for each in alike if not each.offset and math.isclose(each.factor, factor * own.factor)),
        "1",
    )


def declared_dimensions(force_units: Mapping[int, str]) -> dict[int, str]:
    """Return the dimension of every state of which the unit of a missing term is declared.

    A force or a moment enters the equation of something that moves; any other term is a rate of its state.

    Parameters
    ----------
    force_units : state -> unit of a term in its equation
    """
    meanings = {}
    for i, text in force_units.items():
        rate = "m/s^2" if text == "N/kg" else text
        meanings[i] = "speed" if dimension(rate) in _FORCES else dimension(reduced(f"{rate}*s"))
    return {i: meaning for i, meaning in meanings.items() if meaning not in _OPEN}


def term_places(places: Callable[[Effect], Sequence[tuple[str | None, str | None]]]) -> dict[str, str]:
    """Return the states whose equation a law may enter, and whether each is a velocity or another state.

    They are those that some term of the catalogue may enter; ``places`` says where an effect could act.
    """
    return {
        str(channel): effect.term.of
        for effect in effects().values()
        if effect.term is not None and effect.term.of in ("velocity", "state")
        for channel, _ in places(effect)
    }


def fitting(
    term: Term, states: Sequence[int], velocities: Mapping[int, int], meanings: Mapping[int, str]
) -> list[int]:
    """Return those of the states whose equation a term of a motion could enter.

    Parameters
    ----------
    velocities : velocity -> position, of states of which one is the other's rate
    meanings : state -> dimension, where the recording or the declared unit of a term tells it
    """
    pairs = [i for i in states if i in velocities]
    if term.of == "state":  # a level: no velocity, whether or not its position is a state
        return [i for i in states if i not in velocities and meanings.get(i) not in SPEEDS]
    if term.of == "velocity":
        return _motions(states, pairs, meanings, SPEEDS)
    if term.of != "position":
        return list(states)
    if pairs:
        return pairs
    return _motions(states, [], meanings, _PLACES) if term.on_place else []


def _motions(
    states: Sequence[int], pairs: list[int], meanings: Mapping[int, str], allowed: frozenset[str]
) -> list[int]:
    if not meanings:
        return list(states)
    # Beside states of another kind, one of which nothing is known is of theirs.
    return [i for i in states if i in pairs or meanings.get(i) in allowed]


def way_of(rates: Sequence[Array], times: Sequence[Array]) -> float:
    """Return the spread of the position of which only the rate is a state: of every run's from its start.

    Parameters
    ----------
    rates, times : of every run, shape (rows,) each
    """
    steps = (0.5 * (rate[1:] + rate[:-1]) * np.diff(t) for rate, t in zip(rates, times, strict=True))
    ways = [np.concatenate([[0.0], np.cumsum(moved)]) for moved in steps]
    return float(np.std(np.concatenate(ways)))


def usual_step(places: Sequence[Array]) -> float:
    """Return the step from row to row in the middle of all that is travelled, 0 where nothing moves.

    Half of the way is made in shorter ones. Rows at rest, however many, make none of it.

    Parameters
    ----------
    places : of every run, shape (rows,) each, all finite
    """
    steps = np.sort(np.concatenate([np.zeros(1), *(np.abs(np.diff(place)) for place in places)]))
    way = np.cumsum(steps)
    return float(steps[np.searchsorted(way, 0.5 * way[-1])])


def state_names(case: Case, count: int) -> tuple[str, ...]:
    """Return the names of an equation's states, of which ``count`` have initial values.

    Raises
    ------
    ConfigError
        ``case``: there are not as many, or a force term names none of them
    """
    names = case.simulation.states or tuple(f"x{i}" for i in range(count))
    if len(names) != count:
        raise ConfigError(
            "states and initial do not agree", where=f"{case.path}: simulation.states",
            got=f"{len(names)} names, {count} initial values", expected="one name for each",
            next_step="correct the list of states", rule="case",
        )  # fmt: skip
    unknown = [name for name in dict(case.simulation.force_terms) if name not in names]
    if unknown:
        raise ConfigError(
            "a force term names no state", where=f"{case.path}: simulation.force_terms",
            got=", ".join(unknown), expected=", ".join(names), next_step="correct the name", rule="case",
        )  # fmt: skip
    return names
