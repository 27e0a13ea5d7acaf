"""Effects through their hooks, stage by stage: the one way for simulation, diagnosis and correction.

What drives the tire, single channels and their inverse, terms of an equation of motion along a motion, and
the rows of a recording from which a machine's corrections take their effects away.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.effects.applied import ORIGIN, SOURCE_ORIGIN, AppliedEffect, in_order
from toolkit.effects.effect import STAGES
from toolkit.effects.signals import Drive, TireForces
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.effects.effect import ChannelHook
    from toolkit.effects.facts import Values
    from toolkit.effects.signals import Setting, Tire

    Signals = dict[str, Array]
    View = Callable[[str, Array], Array]

# A steady tire under other friction, stiffness and trail: the similarity method, for any tire as it is.


Steady = Callable[["Array", Drive], TireForces]


def similar(steady: Steady, drive: Drive) -> TireForces:
    """Return the forces of a drive in the machine's axes.

    Parameters
    ----------
    steady : (slip angle [rad], drive) -> forces of the nominal steady tire
    drive : with what the effects have made of friction, stiffness, trail and forces on top
    """
    nominal = steady(drive.SA * drive.stiffness / drive.friction, drive)
    return TireForces(
        FY=drive.friction * nominal.FY + drive.FY,
        MZ=drive.friction * drive.trail * nominal.MZ + drive.MZ,
    )


_STEPS = 8
_EXACT = 1e-9  # of the largest value: no digit that a recording has
_WILD = 10.0  # times the largest value: the fixed point runs away


def driven(start: Drive, effects: Iterable[AppliedEffect], setting: Setting, tire: Tire) -> Drive:
    """Return what drives the tire when effects have acted on it, stage by stage."""
    for applied in in_order(effects):
        if applied.effect.drive is not None:
            start = applied.effect.drive(start, applied.values, setting, tire)
    return start


def tire_forces(
    start: Drive, steady: Steady, effects: Iterable[AppliedEffect], setting: Setting
) -> TireForces:
    """Return the forces in the machine's axes of a steady tire with effects on road, carriage and tire."""

    def tire(drive: Drive) -> TireForces:
        return similar(steady, drive)

    return tire(driven(start, effects, setting, tire))


def _as_it_is(_: str, values: Array) -> Array:
    return values


def through(
    signals: Mapping[str, Array],
    effects: Iterable[AppliedEffect],
    setting: Setting,
    *,
    recorded: Mapping[str, Array] | None = None,
    shown: View = _as_it_is,
    stored: View = _as_it_is,
) -> Signals:
    """Return signals by name when effects have acted on them; effects of other signals do nothing.

    Parameters
    ----------
    recorded : further channels that may show in the signals
    shown, stored : (name, values) to the unit in which effects act on the signal, and back from it
    """
    changed = dict(signals)
    others = recorded or {}
    for applied in in_order(effects):
        hook, name, source = applied.effect.channel, applied.channel, applied.source
        if hook is None or name is None or name not in changed:
            continue
        if applied.effect.exchanges:
            other = str(source)
            changed[name], changed[other] = (
                stored(name, shown(other, changed[other])),
                stored(other, shown(name, changed[name])),
            )
            continue
        local = setting
        if source is not None:
            leaking = changed.get(source, others.get(source))
            if leaking is None:
                continue
            local = with_source(setting, _counted(shown(source, leaking), applied.values.get(SOURCE_ORIGIN)))
        changed[name] = stored(name, _acted(hook, shown(name, changed[name]), applied.values, local))
    return changed


def _counted(values: Array, origin: float | None) -> Array:
    return values if origin is None else values - origin


def _acted(hook: ChannelHook, y: Array, values: Values, setting: Setting) -> Array:
    """Return what a hook makes of a channel, about the origin of its scale where it has one by convention.

    Raises FitError where it makes nothing of it: a period of no length, at the end of what it may be.
    """
    origin = values.get(ORIGIN, 0.0)
    try:
        return hook(y - origin, values, setting) + origin if origin else hook(y, values, setting)
    except ArithmeticError as error:
        raise FitError(
            "an effect has no value", where=", ".join(f"{name} {values[name]:.4g}" for name in values),
            got=str(error), expected="values with which it can be computed",
            next_step="none is needed: the search goes on without them", rule="simulator",
        ) from error  # fmt: skip


def with_source(setting: Setting, values: Array) -> Setting:
    """Return a setting with the values of the signal that an effect takes."""
    return dataclasses.replace(setting, channels={**setting.channels, "from": values})


def undone(
    recorded: Array,
    applied: AppliedEffect,
    setting: Setting,
    others: Mapping[str, Array],
) -> Array:
    """Return what a channel would have shown without an effect: its inverse, or a fixed point of its hook.

    Raises
    ------
    FitError
        the effect is so strong that nothing has an inverse
    """
    hook, facts = applied.effect.channel, applied.effect.on_channel
    if hook is None or facts is None:
        return recorded
    values = applied.values
    if facts.inverse is not None:
        return _acted(facts.inverse, recorded, values, setting)
    local = (
        setting
        if applied.source is None
        else with_source(setting, _counted(others[applied.source], values.get(SOURCE_ORIGIN)))
    )
    # A row that was lost would take those after it along where an effect has a memory.
    present = np.isfinite(recorded)
    if not present.all():
        if not present.any():
            return recorded
        rows = np.arange(len(recorded))
        recorded = np.interp(rows, rows[present], recorded[present])
    guess = recorded
    size = float(np.abs(recorded).max(initial=0.0))
    most: float | None = None
    for _ in range(_STEPS):
        with np.errstate(over="ignore", invalid="ignore"):
            missed = recorded - _acted(hook, guess, values, local)
        error = float(np.abs(missed).max(initial=0.0))
        most = _WILD * max(size, error) if most is None else most
        if not error <= most or not math.isfinite(error):
            raise _not_undone(applied)
        guess = guess + missed
        if error <= _EXACT * size:
            break
    return np.where(present, guess, np.nan)


def _not_undone(applied: AppliedEffect) -> FitError:
    values = ", ".join(f"{name} = {value:.4g}" for name, value in applied.values.items() if name[0] != "_")
    return FitError(
        "an effect of this size cannot be taken out of a recording",
        where=str(applied.channel),
        got=f"{applied.effect.name}: {values}",
        expected="an effect that leaves a channel's values in their order",
        next_step="take a smaller value",
        rule="simulator",
    )


def resisting(
    effects: Iterable[AppliedEffect],
    t: Array,
    position: Array,
    velocity: Array,
) -> Array:
    """Return the sum of terms along a recorded motion, (n,), as it stands in the equation of the force."""
    total = np.zeros(len(position))
    for applied in effects:
        term, values = applied.effect.term, applied.values
        if term is None:
            continue
        if term.recorded is not None:
            total += term.recorded(t, velocity, values)
            continue
        force = term.force
        if force is None:
            continue
        # A driving force is reported as the term that stands in the output's own equation.
        sign = -1.0 if term.drives else 1.0
        total += sign * np.asarray(force(position, velocity, values))
    return total


def corrected(effects: Sequence[AppliedEffect], channels: Mapping[str, Array]) -> dict[str, Array]:
    """Return recorded channels, each (n,), SI and machine axes, with correctable effects taken out of them.

    Backwards through the stages: the loads first, then the slip angle, which a corrected moment may turn.
    Each effect's value is in SI.
    """
    changed = dict(channels)
    for stage in reversed(STAGES):
        for applied in in_order(effects, stage):
            way = applied.effect.correctable
            if way is not None:
                (value,) = applied.values.values()
                name, values = way.undo(changed, channels, value, applied.channel, applied.source)
                changed[name] = values
    return changed
