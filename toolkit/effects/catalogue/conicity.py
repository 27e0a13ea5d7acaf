"""Conicity: a belt off the middle pulls to one side of the tire."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import Alike, Values, mounted_one_way

if TYPE_CHECKING:
    from toolkit.effects.signals import Drive, Setting, Tire


def _pulled(drive: Drive, values: Values, setting: Setting, tire: Tire) -> Drive:
    force = values["force_at_nominal_load"] * drive.FZ / setting.nominal_load_N
    return dataclasses.replace(drive, FY=drive.FY + setting.facing * force)


def _share(force: float, nominal_load_N: float | None) -> float | None:
    # FY + force FZ/FZ0 is FY + coefficient FZ, the tire mounted one way.
    return force / nominal_load_N if nominal_load_N else None


EFFECT = Effect(
    name="conicity",
    stage="tire",
    rank=6,
    in_time=False,
    statement="The tire pulls to one of its sides: conicity is missing.",
    equation="FY = FY_model + force_at_nominal_load * FZ/FZ0",
    reference="Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, 4.3.2; SAE J1987",
    signature="FY keeps its sign when the drum is reversed, and grows with load",
    separates=(
        "the tire turned round on the hub: conicity changes its sign; camber error and crosstalk do not"
    ),
    parameters=(
        EffectParameter(
            name="force_at_nominal_load",
            unit="N",
            text="lateral force at the nominal load",
            typical=(5.0, 150.0),
            sense=("FY", "machine"),
        ),
    ),
    drive=_pulled,
    alike=Alike(group="pull", holds=mounted_one_way, size=_share, size_unit="(N)/(N)", place=("FY", "FZ")),
)
