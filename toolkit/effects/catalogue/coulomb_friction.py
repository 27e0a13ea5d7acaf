"""Dry friction: one size, against the motion; after a reversal it builds up over a presliding distance."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import kept_of_the_same
from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.filters import PAST
from toolkit.effects.surroundings import Surroundings, of_force

if TYPE_CHECKING:
    from toolkit.arrays import Array


LEAST_REACH = "least_presliding"  # among the values: a shorter bristle shows in no row
_SHORT = 0.05  # of the position's spread: the longest distance over which friction builds up
_STARTS = (0.01, 0.2, 2.0)  # of the usual way from row to row


def _resisting(position: Any, velocity: Any, values: Values) -> Any:
    # Smooth within a thousandth of the velocity's spread, so that a solver can meet its tolerance.
    return values["coulomb"] * np.tanh(velocity / values.get("smooth", 1e-4))


def _recorded(t: Array, velocity: Array, values: Values) -> Array:
    # Dahl's bristle along a velocity that is linear between rows: z tends to sign(v) with the distance
    # travelled. A row shows its mean over one interval between rows, half before it and half after: a
    # filter that suits the rows leaves no sharper a jump, and a jump taken as sharp would be found too small.
    reach = max(values["presliding"], 0.0)
    if len(t) < 2:
        return values["coulomb"] * np.sign(velocity)
    knots, sizes, strokes = _path(t, velocity)
    # Bent by the way before the first row, which is not recorded: as if it had gone on as it begins.
    start = float(np.sign(velocity[0])) + 2 * values.get(PAST, 0.0)
    z, bent = _bristle(sizes, strokes, reach, start=start)
    # The bristle's mean over a piece, at an even speed along it.
    slow = sizes > 1e-9 * reach if reach > 0 else sizes > 0
    settled = np.where(slow, (z - bent) * reach / np.where(slow, sizes, 1.0) + strokes, z)
    area = np.concatenate([[0.0], np.cumsum(settled * np.diff(knots))])
    half = 0.5 * float(np.median(np.diff(t)))
    low, high = np.maximum(t - half, t[0]), np.minimum(t + half, t[-1])
    means = (np.interp(high, knots, area) - np.interp(low, knots, area)) / (high - low)
    return np.asarray(values["coulomb"] * means)


@kept_of_the_same(64)  # a run's velocity is asked for with every size of the friction
def _path(t: Array, velocity: Array) -> tuple[Array, Array, Array]:
    """Return instants between which the way does not turn, and each piece's length and direction.

    The rows, the quarters between them, and the reversals: shapes (k,), (k - 1,), (k - 1,).
    """
    turns = velocity[:-1] * velocity[1:] < 0
    share = velocity[:-1][turns] / (velocity[:-1][turns] - velocity[1:][turns])
    step = np.diff(t)
    crossings = t[:-1][turns] + share * step[turns]
    knots = np.concatenate([t, *(t[:-1] + part * step for part in (0.25, 0.5, 0.75)), crossings])
    speeds = np.interp(knots, t, velocity)
    speeds[len(knots) - len(crossings) :] = 0.0
    order = np.argsort(knots, kind="stable")
    knots, speeds = knots[order], speeds[order]
    moved = 0.5 * (speeds[1:] + speeds[:-1]) * np.diff(knots)
    travelled = np.concatenate([[0.0], np.cumsum(np.abs(moved))])
    return knots, np.diff(travelled), np.sign(moved)


def _bristle(sizes: Array, strokes: Array, reach: float, *, start: float) -> tuple[Array, Array]:
    """Return the bristle at the beginning and at the end of each piece."""
    shares = np.exp(-sizes / reach) if reach > 0 else (sizes <= 0).astype(float)
    bends = [last := start]
    for share, stroke in zip(shares.tolist(), strokes.tolist(), strict=True):
        last = stroke + (last - stroke) * share
        bends.append(last)
    return np.array(bends[:-1]), np.array(bends[1:])


def _bristle_of(values: Values) -> tuple[Any, Any]:
    return values["coulomb"], np.maximum(values.get("presliding", 0.0), values.get(LEAST_REACH, 0.0))


def _smoothing(case: Surroundings) -> dict[str, float]:
    speed = case.motion.speed
    return {"smooth": 1e-3 * speed, LEAST_REACH: 1e-3 * speed * case.row_time}


def _way_of_a_row(case: Surroundings) -> float:
    return case.motion.speed * case.row_time


def _distances(case: Surroundings) -> tuple[float, ...]:
    # The longest bristle of an equation that turns at every row is a spring.
    starts = _STARTS[:2] if case.integrates else _STARTS
    return tuple(start * _way_of_a_row(case) for start in starts)


def _longest(case: Surroundings) -> float | None:
    # A bristle as long as the way itself is a spring: over a fall from rest it grows as drag does.
    if not case.integrates:
        return None
    return max(_SHORT * case.motion.place, _way_of_a_row(case))


EFFECT = Effect(
    name="coulomb_friction",
    stage="dynamics",
    rank=2,
    in_time=False,
    statement="Dry friction is missing: a force of one size against the motion.",
    equation="m a = ... - coulomb * z, z' = (v - |v| z)/presliding: sign(v) after a presliding distance",
    reference="Dahl, AIAA J. 14 (1976); Armstrong-Helouvry, Control of Machines with Friction, 1991",
    signature="jumps where the velocity changes its sign, and does not grow with speed",
    separates="slow motion in both directions",
    parameters=(
        EffectParameter(
            name="coulomb",
            unit="{force}",
            text="size of the friction",
            typical=(0.01, 1.0),
            scale=of_force,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="presliding",
            unit="{position}",
            text="distance over which the friction builds up after a reversal",
            typical=(0.2, 2.0),
            off=None,
            scale=_way_of_a_row,
            bounds=(0.0, float("inf")),
            starts=_STARTS,
            start_values=_distances,
            most=_longest,
        ),
    ),
    confined_by=(ANY_OTHER,),
    term=Term(of="velocity", force=_resisting, recorded=_recorded, bristle=_bristle_of),
    numerics=_smoothing,
    remembers=True,
    form_error=0.03,
    reshapes=True,
)
