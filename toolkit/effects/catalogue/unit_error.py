"""Another unit than the stated one."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from toolkit.effects.effect import ANY_OTHER, Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Values
from toolkit.units import unit

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.effects.signals import Setting
    from toolkit.effects.surroundings import Surroundings


# Units that files of this field mix up, each with the one it is taken for; both ways.
_MIXED = (
    ("lbf", "N"), ("kgf", "N"), ("kgf", "lbf"), ("kN", "lbf"), ("lbf*ft", "N*m"), ("lbf*in", "N*m"),
    ("kgf*m", "N*m"), ("lbf*ft", "lbf*in"), ("deg", "rad"), ("m/s", "km/h"), ("mph", "km/h"), ("mph", "m/s"),
    ("inch", "mm"), ("inch", "cm"), ("ft", "m"), ("inch", "m"), ("psi", "kPa"), ("bar", "kPa"),
    ("bar", "psi"), ("min", "s"), ("percent", "1"),
)  # fmt: skip
_PREFIXES = {"kilo": 1000.0, "milli": 0.001}


@cache
def _all() -> dict[str, tuple[str | None, float]]:
    """Return for every confusion its dimension, None for any, and the factor of the number."""
    confusions: dict[str, tuple[str | None, float]] = {
        name: (None, value) for name, value in _PREFIXES.items()
    }
    for pair in _MIXED:
        for true, assumed in (pair, pair[::-1]):
            right, wrong = unit(true), unit(assumed)
            confusions[f"{true} read as {assumed}"] = (right.dimension, wrong.factor / right.factor)
    return confusions


def factors() -> dict[str, float]:
    """Return the factor of every confusion by its name, such as ``N read as lbf``."""
    return {name: factor for name, (_, factor) in _all().items()}


def factors_for(dimension: str | None) -> tuple[float, ...]:
    """Return the factors that a channel of a dimension can be wrong by; None is an unknown one."""
    return tuple(dict.fromkeys(factor for of, factor in _all().values() if of is None or of == dimension))


def _confusions(case: Surroundings) -> tuple[float, ...]:
    return factors_for(case.dimension())


def _converted(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
    return y * values["factor"]


def _restored(y: NDArray[np.float64], values: Values, setting: Setting) -> NDArray[np.float64]:
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
            start_values=_confusions,
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
    ),
    discrete=True,
    needs_signal=True,
)
