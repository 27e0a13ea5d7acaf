"""Viscoelastic settling: the force relaxes with time after each step, whatever the distance rolled."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Values
from toolkit.effects.filters import begun, lag

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _settled(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    f, tau, of_load = values["fraction"], values["time_constant"], values["of_load"]
    if of_load < 1:
        forces, of_force = tire(drive), (1 - of_load) * f
        drive = dataclasses.replace(
            drive,
            FY=drive.FY + of_force * (forces.FY - lag(drive.t, forces.FY, tau, begun(forces.FY, values))),
            MZ=drive.MZ + of_force * (forces.MZ - lag(drive.t, forces.MZ, tau, begun(forces.MZ, values))),
        )
    if of_load > 0:
        late = lag(drive.t, drive.FZ, tau, begun(drive.FZ, values))
        drive = dataclasses.replace(drive, FZ=drive.FZ + of_load * f * (drive.FZ - late))
    return drive


EFFECT = Effect(
    name="viscoelastic_settling",
    stage="tire",
    rank=9,
    in_time=True,
    statement=(
        "The tire settles with time after each step, longer than the revolutions that were waited for."
    ),
    equation=(
        "F = F_inf + fraction * (F_inf - lag(F_inf, time_constant)), F the force; or the load, by the share "
        "`of_load`, to which the tire answers"
    ),
    reference="Ferry, Viscoelastic Properties of Polymers, 1980",
    signature="log time and not distance: it goes on after 2.5 revolutions at any speed",
    separates="a dwell of a minute, or the same steps at another speed",
    parameters=(
        EffectParameter(
            name="fraction", unit="1", text="overshoot after a step", typical=(0.01, 0.05), bounds=(0.0, 0.5)
        ),
        EffectParameter(
            name="time_constant",
            unit="s",
            text="of the decay",
            typical=(1.0, 100.0),
            off=None,
            bounds=(0.05, 2000.0),
            starts=(1.0, 8.0, 60.0),
        ),
        EffectParameter(
            name="of_load",
            unit="1",
            text="share of the load: 0 after any step of the force, 1 after steps of the load alone",
            typical=(0.0, 1.0),
            off=None,
            bounds=(0.0, 1.0),
            starts=(0.0, 1.0),
            absent=0.0,
            ends_count=True,
        ),
    ),
    drive=_settled,
    remembers=True,
    confined_by=("repeat_of", "date", "order"),
    form_error=0.03,
    akin="a load that is slow to come, or a tire that is slow to settle",
)
