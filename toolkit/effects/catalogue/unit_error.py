"""Another unit than the stated one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.effects.unit_ratios import unit_ratios, units_mistaken

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.signals import Setting
    from toolkit.effects.surroundings import Surroundings

_PREFIXES = {"kilo": 1000.0, "milli": 0.001}


def factors() -> dict[str, float]:
    """Return the factor of every confusion by its name, such as ``N read as lbf``."""
    return _PREFIXES | units_mistaken()


def _ratios(case: Surroundings) -> tuple[float, ...]:
    text = case.unit()
    return tuple(_PREFIXES.values()) if text is None else tuple(unit_ratios(text).values())


def _converted(y: Array, values: Values, setting: Setting) -> Array:
    return y * values["factor"]


def _restored(y: Array, values: Values, setting: Setting) -> Array:
    return y / values["factor"]


EFFECT = Effect(
    name="unit_error",
    stage="acquisition",
    rank=1,
    in_time=False,
    statement="The channel is in another unit than the stated one.",
    equation="y = factor * y_model",
    reference="NIST SP 811",
    signature="one factor that is a ratio of two units",
    separates="the unit printed beside a known load",
    parameters=(
        EffectParameter(
            name="factor",
            unit="1",
            text="channel over its true value",
            typical=(0.1, 10.0),
            off=1.0,
            starts=tuple(_PREFIXES.values()),
            start_values=_ratios,
            words=factors,
        ),
    ),
    channel=_converted,
    confined_by=("date", ANY_OTHER),
    on_channel=ChannelFacts(
        where=("output", "input", "program_cell", "program_load"),
        tare="alike",
        by_value=False,
        about_zero=True,
        inverse=_restored,
        proportion=0.0,
    ),
    discrete=True,
    needs_signal=True,
)
