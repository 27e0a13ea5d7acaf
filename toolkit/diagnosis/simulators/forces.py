"""Forces that enter a differential equation beside its own terms, and the states that they bring along.

Dry friction is a bristle: it bends with the motion, and slides once it is bent by the presliding distance.
Its bend is a state of its own, so that a body comes to rest and stays there, and a solver meets no jump; the
way of a body of which the equation has no position is another.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419, with a constant
friction (Dahl's) and a bristle without damping of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.diagnosis.simulators.sliding_friction import Bristles, Slide, SlideColumns
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import ITSELF, POSITION, TIME
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.effects.applied import Conditioned, EffectKey
    from toolkit.effects.formula import Remembered

    Places = NDArray[np.intp]
    Seen = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """One force: the states of velocity and position that it acts on and sees.

    ``bristle`` is its bend's place among the added states, ``way`` that of its body's way where no state of
    the equation is it; ``scale`` is the size of the velocity state (of the state itself, where it has no
    position). ``reads`` are the signals of a law by name, with the place of those that are states; ``feeds``
    is the state to which a part of what is held back may come; ``dry`` are size and reach of a bristle.
    ``memory`` is the place of the first of the states by which its law remembers, ``remembered`` what it does
    and where that stands among the added states, ``followed`` the size of what it reads.
    """

    velocity: int
    position: int
    bristle: int | None
    way: int | None
    scale: float
    active: AppliedEffect
    reads: tuple[tuple[str, int | None], ...] = ()
    feeds: int | None = None
    dry: tuple[Any, Any] | None = None
    memory: int | None = None
    remembered: tuple[tuple[Remembered, slice], ...] = ()
    followed: float = 1.0

    @property
    def place(self) -> tuple[object, ...]:
        """What tells forces apart that are not of one kind at one place."""
        return self.velocity, self.position, self.bristle, self.way, self.memory, self.active.key


@dataclass(frozen=True, slots=True)
class Forces:
    """All forces of one hypothesis; ``added`` states stand behind the equation's own."""

    listed: tuple[Force, ...]
    added: int

    @staticmethod
    def of(
        active: Sequence[AppliedEffect],
        states: Sequence[str],
        derivative_of: Mapping[int, int],
        scale: Mapping[str, tuple[float, float]],
        inputs: Sequence[str] = (),
        feeds: Mapping[int, int] | None = None,
    ) -> Forces:
        """Return the forces of effects on an equation's states, which see its inputs too.

        Raises
        ------
        ConfigError
            ``model-place``: a law reads what is neither a state nor an input
        """
        made, added = [], 0
        for one in active:
            at = states.index(str(one.channel))
            bristle = way = memory = None
            dry = _dry(one)
            if dry is not None and dry[1] > 0:
                bristle, added = added, added + 1
                if at not in derivative_of:
                    way, added = added, added + 1
            reads = _reads(one, states, at, derivative_of.get(at, at), inputs)
            remembered: list[tuple[Remembered, slice]] = []
            for part in _remembered(one):
                remembered.append((part, slice(added, added + part.states)))
                memory, added = remembered[0][1].start, added + part.states
            made.append(
                Force(
                    velocity=at,
                    position=derivative_of.get(at, at),
                    bristle=bristle,
                    way=way,
                    scale=scale[states[at]][1],
                    active=one,
                    reads=reads,
                    feeds=(feeds or {}).get(at),
                    dry=dry if bristle is not None else None,
                    memory=memory,
                    remembered=tuple(remembered),
                    followed=_followed(reads, states, scale),
                )
            )
        return Forces(tuple(made), added)

    def slides(self, own: int) -> tuple[Slide, ...]:
        """Return the bristles among all states, of which ``own`` are the equation's."""
        return tuple(
            Slide(
                bend=own + one.bristle,
                velocity=one.velocity,
                way=one.position if one.way is None else own + one.way,
                reach=one.dry[1],
            )
            for one in self.listed
            if one.bristle is not None and one.dry is not None
        )

    @property
    def terms(self) -> tuple[EffectKey, ...]:
        """Which terms enter the equation, whatever their sizes."""
        return tuple(force.active.key for force in self.listed)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Sizes of the added states: of a bend that of sliding, of a way the bristle's reach.

        What a law remembers has the size of what it follows.
        """
        made = [1.0] * self.added
        for one in self.listed:
            for part, at in one.remembered:
                made[at] = part.sizes(one.followed, one.active.values)
            if one.way is not None and one.dry is not None:
                made[one.way] = one.dry[1]
        return tuple(made)

    def start(self, x: Array, seen: Seen) -> Array:
        """Return the added states at the first row, (added,): at rest, with what they follow where they do.

        Parameters
        ----------
        x : the equation's own states, (states,)
        seen : the inputs and the time
        """
        begun = np.zeros(self.added)
        for one in self.listed:
            for part, at in one.remembered:
                begun[at] = part.start(_signals(one, x, seen), one.active.values)
        return begun

    def add(self, x: Array, rate: Array, own: int, seen: Seen) -> None:
        """Add the forces to the rates of ``own`` states, and set those of the added ones, in place.

        Parameters
        ----------
        seen : the inputs and the time
        """
        for one in self.listed:
            if one.dry is None or one.bristle is None:
                _add(one, x, rate, own, seen)
                continue
            # As `_add` has it, in plain numbers: it is asked for at every step of one state.
            (size, reach), v, bend = one.dry, x.item(one.velocity), x.item(own + one.bristle)
            rate[one.velocity] -= size * bend
            rate[own + one.bristle] = (v - abs(v) * bend) / reach
            if one.way is not None:
                rate[own + one.way] = v


def _reads(
    one: AppliedEffect, states: Sequence[str], at: int, position: int, inputs: Sequence[str]
) -> tuple[tuple[str, int | None], ...]:
    term = one.effect.term
    read = () if term is None or term.law is None else term.law.signals
    places: dict[str, int | None] = dict.fromkeys((*inputs, TIME))
    places |= {name: i for i, name in enumerate(states)} | {ITSELF: at, POSITION: position}
    unknown = [name for name in read if name not in places]
    if unknown:
        raise ConfigError(
            "a law in an equation reads what the equation does not have", where=one.key.label,
            got=", ".join(unknown), expected=", ".join((*states, *inputs, TIME)),
            next_step="give the model the simulation and the inputs that it was made for", rule="model-place",
        )  # fmt: skip
    return tuple((name, places[name]) for name in read)


def _followed(
    reads: tuple[tuple[str, int | None], ...], states: Sequence[str], scale: Mapping[str, tuple[float, float]]
) -> float:
    """Return the size of what a law reads first."""
    named = [name if at is None else states[at] for name, at in reads]
    return scale.get(named[0], (1.0, 1.0))[1] if named else 1.0


def _remembered(applied: AppliedEffect) -> tuple[Remembered, ...]:
    term = applied.effect.term
    return term.law.remembered if term is not None and term.law is not None else ()


def _signals(force: Force, x: Array, seen: Seen) -> dict[str, Any]:
    """Return what a law reads."""
    return {name: seen[name] if at is None else x[at] for name, at in force.reads}


def _add(force: Force, x: Array, rate: Array, own: int, seen: Seen) -> None:
    """Add one force in place; ``x`` and ``rate`` (states,) or (states, columns)."""
    i, values = force.velocity, force.active.values
    term = force.active.effect.term
    if term is None:
        return
    if term.limit is not None:
        held_back = np.maximum(rate[i], 0.0) * (1.0 - term.limit(x[i], force.scale, values))
        rate[i] -= held_back
        if term.spill is not None and force.feeds is not None:
            rate[force.feeds] += values.get(term.spill, 0.0) * held_back
    elif force.bristle is not None and force.dry is not None:
        size, reach = force.dry
        v, bend = x[i], x[own + force.bristle]
        rate[i] -= size * bend
        rate[own + force.bristle] = (v - abs(v) * bend) / reach
        if force.way is not None:
            rate[own + force.way] = v
    elif term.law is not None:
        signals = _signals(force, x, seen)
        for part, at in force.remembered:
            there = slice(own + at.start, own + at.stop)
            rate[there] = part.rates(x[there], signals, values)
            signals[part.key] = x[there.start]
        rate[i] -= term.law(signals, values)
    elif term.force is not None:
        rate[i] -= term.force(x[force.position], x[i], values)


class ForcesTogether:
    """The forces of several sets of parameters and effects: those of one effect at one place are one sweep.

    ``own`` states are the equation's; ``added`` ones stand behind them, of the set that has the most.
    """

    def __init__(self, sets: Sequence[Forces], own: int, runs: Sequence[Conditioned] = ()) -> None:
        """Take the forces of every set, and the runs in which they act or not; without runs they do."""
        self.own, self.added = own, max(forces.added for forces in sets)
        groups: dict[object, list[tuple[int, Force]]] = {}
        for k, forces in enumerate(sets):
            for force in forces.listed:
                groups.setdefault((*force.place, *force.active.values), []).append((k, force))
        self._groups = []
        self.abrupt = np.zeros(len(sets), dtype=bool)  # what turns, or runs against a limit
        for members in groups.values():
            first = members[0][1]
            values = {name: np.zeros(len(sets)) for name in first.active.values}
            for k, force in members:
                for name, value in force.active.values.items():
                    values[name][k] = value
            has = np.zeros(len(sets), dtype=bool)
            has[[k for k, _ in members]] = True
            if first.bristle is not None or (first.active.effect.term and first.active.effect.term.limit):
                self.abrupt |= has
            acts = np.array([first.active.acts_in(run) for run in runs] or [True])
            self._groups.append((first, has, acts, values))

    def on(self, sets: Places, runs: Places | int = 0) -> Acting:
        """Return the forces on columns, of which ``sets`` are the sets and ``runs`` places of runs."""
        listed, slides = [], []
        for first, has, acts, values in self._groups:
            there = has[sets] & acts[runs]
            at = np.flatnonzero(there)
            if not len(at):
                continue
            force = _of(first, values, sets[at])
            listed.append((force, slice(None) if len(at) == len(sets) else at))
            if first.bristle is not None:
                slide = Forces((force,), self.added).slides(self.own)[0]
                reach = np.broadcast_to(slide.reach, len(at))
                slides.append(SlideColumns(slide.bend, slide.velocity, slide.way, reach, at))
        return Acting(listed, Bristles(slides), self.own)


class Acting:
    """Forces on columns of states, and the bristles among them."""

    def __init__(self, listed: Sequence[tuple[Force, Places | slice]], bristles: Bristles, own: int) -> None:
        self._listed, self.bristles, self._own = listed, bristles, own

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self._listed)

    def add(self, x: Array, rate: Array, seen: Seen) -> None:
        """Add the forces to the rates of the states, in place; both (states, columns).

        Parameters
        ----------
        seen : the inputs and the time, each (columns,)
        """
        for force, at in self._listed:
            if isinstance(at, slice):
                _add(force, x, rate, self._own, seen)
                continue
            # Row by row, and by `take`: a tenth of the time that an index over both takes.
            part = rate.take(at, axis=1)
            there = {name: seen[name][at] for name, place in force.reads if place is None}
            _add(force, x.take(at, axis=1), part, self._own, there)
            for row, values in zip(rate, part, strict=True):
                row[at] = values


def _of(force: Force, values: Mapping[str, Array], sets: Places) -> Force:
    there = {name: column[sets] for name, column in values.items()}
    active = replace(force.active, values=there)  # type: ignore[arg-type]
    return replace(force, active=active, dry=_dry(active) if force.dry is not None else None)


def _dry(effect: AppliedEffect) -> tuple[Any, Any] | None:
    term = effect.effect.term
    return None if term is None or term.bristle is None else term.bristle(effect.values)
