"""Forces that enter a differential equation beside its own terms, and the states that they bring along.

Dry friction is a bristle: it bends with the motion, and slides once it is bent by the presliding distance.
Its bend is a state of its own, so that a body comes to rest and stays there, and a solver meets no jump; the
way of a body of which the equation has no position is another.

Source: Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419, with a constant
friction (Dahl's) and a bristle without damping of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.diagnosis.simulators.sliding_friction import Slide
from toolkit.effects.applied import AppliedEffect

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """One force: the states of velocity and position that it acts on and sees.

    ``bristle`` is its bend's place among the added states, ``way`` that of its body's way where no state of
    the equation is it; ``scale`` is the size of the velocity state (of the state itself, where it has no
    position).
    """

    velocity: int
    position: int
    bristle: int | None
    way: int | None
    scale: float
    active: AppliedEffect


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
    ) -> Forces:
        """Return the forces of effects on an equation's states."""
        made, added = [], 0
        for one in active:
            at = states.index(str(one.channel))
            bristle = way = None
            if _reach(one) > 0:
                bristle, added = added, added + 1
                if at not in derivative_of:
                    way, added = added, added + 1
            made.append(
                Force(
                    velocity=at,
                    position=derivative_of.get(at, at),
                    bristle=bristle,
                    way=way,
                    scale=scale[states[at]][1],
                    active=one,
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
                reach=_reach(one.active),
            )
            for one in self.listed
            if one.bristle is not None
        )

    @property
    def sizes(self) -> tuple[float, ...]:
        """Sizes of the added states: of a bend that of sliding, of a way the bristle's reach."""
        made = [1.0] * self.added
        for one in self.listed:
            if one.way is not None:
                made[one.way] = _reach(one.active)
        return tuple(made)

    def add(self, x: NDArray[np.float64], rate: NDArray[np.float64], own: int) -> None:
        """Add the forces to the rates of ``own`` states, and set those of the added ones, in place."""
        for one in self.listed:
            i, values = one.velocity, one.active.values
            term = one.active.effect.term
            if term is None:
                continue
            if term.limit is not None:
                if rate[i] > 0:
                    rate[i] *= term.limit(x[i], one.scale, values)
            elif one.bristle is not None and term.bristle is not None:
                size, reach = term.bristle(values)
                v, bend = float(x[i]), float(x[own + one.bristle])
                turning = v - abs(v) * bend
                rate[i] -= size * bend
                rate[own + one.bristle] = turning / reach
                if one.way is not None:
                    rate[own + one.way] = v
            elif term.force is not None:
                rate[i] -= term.force(float(x[one.position]), float(x[i]), values)


def _reach(effect: AppliedEffect) -> float:
    term = effect.effect.term
    return 0.0 if term is None or term.bristle is None else term.bristle(effect.values)[1]
