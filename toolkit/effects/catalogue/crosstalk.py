"""Crosstalk: a second load shows in the channel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Alike, ChannelFacts, Correctable, Values, mounted_one_way
from toolkit.effects.surroundings import Surroundings, of_channel

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.facts import Channels
    from toolkit.effects.signals import Setting


def _leaking(y: Array, values: Values, setting: Setting) -> Array:
    source = setting.channels.get("from")
    return y if source is None else y + values["coefficient"] * source


def _over_the_other(case: Surroundings) -> float:
    return of_channel(case) / case.spread(case.source)


def _pulls(case: Surroundings) -> bool:
    return case.channel == "FY" and case.source in ("FZ", "FZ_CMD") and mounted_one_way(case)


def _taken_out(
    channels: Channels, recorded: Channels, value: float, channel: str | None, source: str | None
) -> tuple[str, Array]:
    # load = shown - coefficient * other, the others as shown
    return str(channel), channels[str(channel)] - value * recorded[str(source)]


EFFECT = Effect(
    name="crosstalk",
    stage="load_cells",
    rank=7,
    in_time=False,
    statement="Another load shows in this channel.",
    equation="y = y_model + coefficient * other",
    reference="Bray, Barbato, Levi, Theory and Practice of Force Measurement, 1990",
    signature="in proportion to another channel, unchanged when the drum is reversed",
    separates="the other load alone, and the tire turned round on the hub",
    parameters=(
        EffectParameter(
            name="coefficient",
            unit="{channel}/({from})",
            text="of the other channel",
            typical=(0.002, 0.05),
            scale=_over_the_other,
        ),
    ),
    channel=_leaking,
    on_channel=ChannelFacts(where=("output",), tare="own", by_value=False, about_zero=True, second="from"),
    alike=Alike(group="pull", holds=_pulls),
    correctable=Correctable(
        unit="({channel})/({from})", undo=_taken_out, channels=("FY", "MZ"), sources=("FZ", "FY", "MZ")
    ),
)
