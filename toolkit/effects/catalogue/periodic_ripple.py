"""A force that repeats with the position: cogging, a screw's pitch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Term, Values
from toolkit.effects.surroundings import Surroundings, of_force, of_position

if TYPE_CHECKING:
    from toolkit.arrays import Array

# Responses of two periods have nothing in common once they differ by a cycle over the way.
_CLOSE = 0.5  # cycles over the way from one period to the next
_FEWEST, _MOST = 2.0, 200.0  # cycles over the way, of the longest and the shortest period
_WORK = 4_000_000  # rows times periods
_LEAST = 40  # periods, however many the rows


def _resisting(position: Any, velocity: Any, values: Values) -> Any:
    return -values["amplitude"] * np.sin(
        2 * np.pi * position / values["period"] + np.radians(values["phase"])
    )


def _waves(x: Array, starts: Sequence[Values]) -> Array:
    wave = np.array([2 * np.pi / values["period"] for values in starts])
    size = np.array([values["amplitude"] for values in starts])
    turned = np.multiply.outer(x, wave)
    return np.hstack([size * np.sin(turned), size * np.cos(turned)])


def _longest(case: Surroundings) -> float:
    # Of which the way sees less than two periods does not repeat: it is a stiffness, linear and cubic.
    return float(case.way[0] / _FEWEST)


def _periods(case: Surroundings) -> tuple[float, ...]:
    """Return the periods to try, the longest first; none where nothing moves."""
    travel, step = case.way
    if not travel > 0:
        return ()
    # Two rows to a period at the usual speed; where the motion is slower, shorter ones would still be seen.
    finest = min(_MOST, travel / (2 * step) if step > 0 else _MOST)
    count = min(int((finest - _FEWEST) / _CLOSE), max(_LEAST, _WORK // case.rows))
    return tuple(float(travel / cycles) for cycles in _FEWEST + _CLOSE * np.arange(max(count, 1)))


EFFECT = Effect(
    name="periodic_ripple",
    stage="dynamics",
    rank=6,
    in_time=False,
    statement="A force that repeats with the position is missing.",
    equation="m a = ... + amplitude * sin(2 pi x/period + phase)",
    reference="Armstrong-Helouvry, 1991",
    signature="lines over the position, not over time",
    separates="slow motion over several periods",
    parameters=(
        EffectParameter(
            name="amplitude",
            unit="{force}",
            text="of the ripple",
            typical=(0.01, 1.0),
            scale=of_force,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="period",
            unit="{position}",
            text="of the ripple",
            typical=(0.02, 1.0),
            off=None,
            scale=of_position,
            start_values=_periods,
            most=_longest,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="phase",
            unit="deg",
            text="at position zero",
            typical=(-180.0, 180.0),
            off=None,
            phase_of="amplitude",
        ),
    ),
    term=Term(of="position", force=_resisting, pattern=_waves, drives=True, shares=(1.0,)),
)
