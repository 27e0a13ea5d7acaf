"""Effects on single channels after the physics: load cells and acquisition, in the channel's own unit."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.simulators.setting import dimension
from toolkit.diagnosis.simulators.simulator import Active
from toolkit.effects.effect import STAGES, Effect
from toolkit.effects.signals import Setting
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.case.case import Run

_FORCE_LIKE = ("force", "moment", "bridge_ratio", "count")
_STEPS = 8
_EXACT = 1e-9  # of the largest value: no digit that a recording has
_WILD = 10.0  # times the largest value: the fixed point runs away


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
    if effect.channel is None:
        return []
    if effect.any_of and not drivers & set(effect.any_of):
        return []
    if effect.name == "channel_swap":
        names = [name for name, _ in outputs]
        units = dict(outputs)
        return [
            (a, b) for i, a in enumerate(names) for b in names[i + 1 :]
            if dimension(units[a]) == dimension(units[b]) or _both_loads(units[a], units[b])
        ]  # fmt: skip
    if effect.name == "wrong_calibration":
        return []
    if effect.name == "crosstalk":
        return [
            (to, source)
            for to, to_unit in outputs
            for source, unit in (*outputs, *others)
            if source != to and (_both_loads(to_unit, unit) or dimension(unit) == dimension(to_unit))
        ]
    return [(name, None) for name, _ in outputs]


def _both_loads(one: str, other: str) -> bool:
    return dimension(one) in _FORCE_LIKE and dimension(other) in _FORCE_LIKE


def through_channels(
    values: Mapping[str, NDArray[np.float64]],
    active: Sequence[Active],
    run: Run,
    setting: Setting,
    observed: Mapping[str, NDArray[np.float64]],
) -> dict[str, NDArray[np.float64]]:
    """Return channels with their effects, stage by stage; each channel in its own unit."""
    made = dict(values)
    here = [one for one in active if one.acts_in(run)]
    for one in sorted(here, key=lambda each: STAGES.index(each.effect.stage)):
        hook = one.effect.channel
        if hook is None or one.channel is None or one.channel not in made:
            continue
        if one.effect.name == "channel_swap":
            other = str(one.source)
            made[one.channel], made[other] = made[other], made[one.channel]
            continue
        seen = setting
        if one.source is not None:
            source = made.get(one.source, observed.get(one.source))
            if source is None:
                continue
            seen = dataclasses.replace(setting, channels={**setting.channels, "from": source})
        made[one.channel] = hook(made[one.channel], one.values, seen)
    return made


def slopes(
    values: Mapping[str, NDArray[np.float64]],
    active: Sequence[Active],
    run: Run,
    setting: Setting,
    observed: Mapping[str, NDArray[np.float64]],
) -> dict[str, NDArray[np.float64]]:
    """Return by how much every channel shows a small change of itself, row by row, (n,).

    A channel that is saturated shows nothing of it; what takes time to show it is taken as if it did not.
    """
    made = {}
    shown = through_channels(values, active, run, setting, observed)
    for name, column in values.items():
        step = 1e-6 * (float(np.ptp(column)) or float(np.abs(column).max(initial=0.0)) or 1.0)
        moved = through_channels({**values, name: column + step}, active, run, setting, observed)
        made[name] = (moved[name] - shown[name]) / step
    return made


def undone(
    recorded: NDArray[np.float64], one: Active, setting: Setting, others: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Return what a channel would have shown without an effect: the hook's inverse by fixed point.

    Raises FitError where the effect is so strong that nothing has an inverse.
    """
    hook = one.effect.channel
    if hook is None:
        return recorded
    if one.effect.name == "channel_sign":
        return -recorded
    if one.effect.name == "unit_error":
        return recorded / one.values["factor"]
    if one.effect.name == "sensitivity_error":
        return recorded / (1 + one.values["gain_error"])
    seen = setting
    if one.source is not None:
        seen = dataclasses.replace(setting, channels={**setting.channels, "from": others[one.source]})
    # A row that was lost would take those after it along where an effect has a memory.
    whole = np.isfinite(recorded)
    if not whole.all():
        if not whole.any():
            return recorded
        rows = np.arange(len(recorded))
        recorded = np.interp(rows, rows[whole], recorded[whole])
    guess = recorded
    size = float(np.abs(recorded).max(initial=0.0))
    most: float | None = None
    for _ in range(_STEPS):
        with np.errstate(over="ignore", invalid="ignore"):
            missed = recorded - hook(guess, one.values, seen)
        left = float(np.abs(missed).max(initial=0.0))
        most = _WILD * max(size, left) if most is None else most
        if not left <= most or not math.isfinite(left):
            raise _not_undone(one)
        guess = guess + missed
        if left <= _EXACT * size:
            break
    return np.where(whole, guess, np.nan)


def _not_undone(one: Active) -> FitError:
    values = ", ".join(f"{name} = {value:.4g}" for name, value in one.values.items() if name[0] != "_")
    return FitError(
        "an effect of this size cannot be taken out of a recording",
        where=str(one.channel),
        got=f"{one.effect.name}: {values}",
        expected="an effect that leaves a channel's values in their order",
        next_step="take a smaller value",
        rule="simulator",
    )
