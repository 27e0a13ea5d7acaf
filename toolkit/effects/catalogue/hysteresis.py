"""Hysteresis: rising and falling loads read differently, at any rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.filters import PAST, plays
from toolkit.effects.surroundings import Surroundings, of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting

_OPERATORS = 20  # of half as many the corners are so far apart that a fit of reach ends between them


def _looping(y: Array, values: Values, setting: Setting) -> Array:
    """Add a loop of unit height, less its own line, that a share ``reach`` of the range winds up.

    Play operators with half gaps spread evenly over (0, reach x span]; after a reversal a small reach turns
    at once (dry friction in a joint), a large one along the lens of a strained solid (Rayleigh's loop).
    Before the recording the channel was loaded from zero for the first time.
    """
    span = values.get("_span") or 0.5 * float(np.ptp(y)) if len(y) else 0.0
    if not span:
        return y
    halves = values["reach"] * span * (np.arange(_OPERATORS) + 0.5) / _OPERATORS
    height = float(np.mean(2 * np.minimum(halves, np.maximum(span - halves, 0.0))))
    if height <= 0:
        return y
    middle = values.get("_middle", 0.5 * float(np.max(y) + np.min(y)))
    loop = (plays(y, halves, values.get(PAST, 0.0)) - y + _line(halves, span) * (y - middle)) / height
    return y + values["gain"] * y + values["width"] * loop


def _line(halves: Array, span: float) -> float:
    """Return how much a full cycle's mean of both branches falls behind, by least squares over the range."""
    x = np.linspace(-span, span, 41)[:, None]
    stuck = np.maximum(span - halves, 0.0)
    branches = np.maximum(x - halves, -stuck) + np.minimum(x + halves, stuck)
    mean = (0.5 * branches - x).mean(axis=1)
    return -float(x[:, 0] @ mean / (x[:, 0] @ x[:, 0]))


def _span(case: Surroundings) -> dict[str, float]:
    """Return half the widest range of a run and its middle: no cycle goes from one run to another."""
    ends = case.widest(case.channel)
    if ends is None:
        return {}
    low, high = ends
    return {"_span": 0.5 * (high - low), "_middle": 0.5 * (high + low)}


def _half_loop(values: Values) -> float:
    # Where in its loop a channel stands at first depends on what came before the recording.
    return 0.5 * values["width"]


EFFECT = Effect(
    name="hysteresis",
    stage="load_cells",
    rank=5,
    in_time=False,
    statement="The channel reads differently on the way up and on the way down.",
    equation="y = (1 + gain) y_model + width * z, z: play operators with gaps up to reach, first loaded from"
    " zero, less their line",
    reference="Brokate and Sprekels, Hysteresis and Phase Transitions, 1996, ch. 2 (Prandtl and Ishlinskii)",
    signature="a loop over the channel's own value that does not depend on the rate",
    separates="load up and down at two rates",
    parameters=(
        EffectParameter(
            name="width",
            unit="{channel}",
            text="full height of the loop over the range of the widest run",
            typical=(0.002, 0.1),
            scale=of_channel,
            bounds=(0.0, float("inf")),
        ),
        EffectParameter(
            name="gain",
            unit="1",
            text="by which the loop's mean line is too steep",
            typical=(-0.01, 0.01),
            bounds=(-0.1, 0.1),
        ),
        EffectParameter(
            name="reach",
            unit="1",
            text="of half the range of the widest run, within which a reversal is completed",
            typical=(0.05, 1.0),
            off=None,
            bounds=(0.01, 1.5),
            starts=(0.3, 0.03, 1.0),
        ),
    ),
    channel=_looping,
    remembers=True,
    on_channel=ChannelFacts(where=("output", "cell"), tare="own", by_value=True, about_zero=True),
    numerics=_span,
    zero_beside=_half_loop,
)
