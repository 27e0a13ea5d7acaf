"""Effects on single channels after the physics: load cells and acquisition, in the channel's own unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.setting import dimension
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.effect import Effect
from toolkit.effects.forward import through, undone
from toolkit.effects.signals import Setting

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Run

_FORCE_LIKE = ("force", "moment", "bridge_ratio", "count")


def channel_places(
    effect: Effect, outputs: Sequence[tuple[str, str]], others: Sequence[tuple[str, str]], drivers: set[str]
) -> list[tuple[str | None, str | None]]:
    """Return where a channel effect could act.

    Parameters
    ----------
    outputs : name and unit of every channel that the effect may act on
    others : name and unit of further channels that may leak into them
    drivers : names of the channels that a setting has
    """
    if effect.channel is None or effect.on_channel is None or "output" not in effect.on_channel.where:
        return []
    if effect.any_of and not drivers & set(effect.any_of):
        return []
    if effect.exchanges:
        names = [name for name, _ in outputs]
        units = dict(outputs)
        return [
            (a, b) for i, a in enumerate(names) for b in names[i + 1 :]
            if dimension(units[a]) == dimension(units[b]) or _both_loads(units[a], units[b])
        ]  # fmt: skip
    if effect.on_channel.paired:
        loads = {name for name, unit in others if dimension(unit) in _FORCE_LIKE}
        return [
            (to, source)
            for to, to_unit in outputs
            for source, unit in (*outputs, *others)
            if source != to
            and (
                _both_loads(to_unit, unit)
                or dimension(unit) == dimension(to_unit)
                # Of several loads one is measured, in volts as well as in newtons, and the others leak.
                or (len(loads) > 1 and source in loads and _is_signal(to_unit))
            )
        ]
    return [(name, None) for name, _ in outputs]


def input_places(effect: Effect, inputs: Sequence[tuple[str, str]]) -> list[tuple[str | None, str | None]]:
    """Return the inputs that an effect may have been in when they were recorded."""
    if effect.on_channel is None or "input" not in effect.on_channel.where:
        return []
    return [(name, None) for name, _ in inputs]


def true_inputs(
    run: Run, active: Sequence[AppliedEffect], inputs: Set[str], setting: Setting
) -> dict[str, Array]:
    """Return the inputs of a run that were recorded with an effect in them, as they are without it."""
    true: dict[str, Array] = {}
    for applied in active:
        name = str(applied.channel)
        if applied.effect.channel is not None and name in inputs and applied.acts_in(run):
            true[name] = undone(true.get(name, run.columns[name]), applied, setting, run.columns)
    return true


def _both_loads(channel: str, source: str) -> bool:
    return dimension(channel) in _FORCE_LIKE and dimension(source) in _FORCE_LIKE


def _is_signal(channel: str) -> bool:
    """Tell whether a sensor gives its readings as numbers or as anything electrical."""
    stated = dimension(channel)
    return stated in ("ratio", "voltage", *_FORCE_LIKE) or "[current]" in stated


def through_channels(
    values: Mapping[str, Array],
    active: Sequence[AppliedEffect],
    run: Run,
    setting: Setting,
    observed: Mapping[str, Array],
) -> dict[str, Array]:
    """Return channels of a run with their effects, stage by stage; each channel in its own unit."""
    return through(
        values, [applied for applied in active if applied.acts_in(run)], setting, recorded=observed
    )


def slopes(
    values: Mapping[str, Array],
    active: Sequence[AppliedEffect],
    run: Run,
    setting: Setting,
    observed: Mapping[str, Array],
) -> dict[str, Array]:
    """Return by how much every channel shows a small change of itself, row by row, (n,).

    A channel that is saturated shows nothing of it; what takes time to show it is taken as if it did not.
    """
    disturbed = {}
    shown = through_channels(values, active, run, setting, observed)
    for name, column in values.items():
        step = 1e-6 * (float(np.ptp(column)) or float(np.abs(column).max(initial=0.0)) or 1.0)
        moved = through_channels({**values, name: column + step}, active, run, setting, observed)
        disturbed[name] = (moved[name] - shown[name]) / step
    return disturbed
