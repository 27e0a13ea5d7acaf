"""Effects that the stages already carry, by the names and units of the catalogue.

``--effect NAME=VALUE`` or, for one cell, ``--effect NAME.CELL=VALUE``.
"""

from __future__ import annotations

import dataclasses
import difflib
from dataclasses import dataclass
from typing import Any

from toolkit.errors import ConfigError
from toolkit.simulation.cells import CELLS
from toolkit.simulation.plan import Plan
from toolkit.units import to_si


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """One effect: the stage and its field, the unit of VALUE, and what the number means."""

    name: str
    stage: str
    field: str
    unit: str
    text: str


def _effect(name: str, stage: str, field: str, unit: str, text: str) -> Effect:
    return Effect(name=name, stage=stage, field=field, unit=unit, text=text)


EFFECTS = (
    _effect("plysteer", "tire", "plysteer_rad", "deg", "pseudo slip angle"),
    _effect("conicity", "tire", "conicity_N", "N", "force at the nominal load"),
    _effect("drum_runout", "road", "runout_1_N", "N", "amplitude at the drum's revolution"),
    _effect("steer_offset", "carriage", "steer_offset_rad", "deg", "slip-angle sensor shows too much"),
    _effect("camber_offset", "carriage", "camber_offset_rad", "deg", "camber error of the wheel"),
    _effect("zero_offset", "cells", "zero_offset_V_V", "mV/V", "zero that moved after the tare"),
    _effect("sensitivity_error", "cells", "gain_error", "1", "gain error, 0.02 for 2 %"),
    _effect("crosstalk", "cells", "crosstalk_FZ_FY", "1", "share of FZ that shows as FY"),
    _effect("filter_lag", "acquisition", "filter_time_constant_s", "s", "time constant of the filter"),
)


def with_effects(plan: Plan, given: list[str]) -> Plan:
    """Return a plan with effects set, each written ``NAME=VALUE`` or ``NAME.CELL=VALUE``.

    Raises
    ------
    ConfigError
        an unknown effect or cell, or a value that is no number
    """
    for text in given:
        name, _, number = text.partition("=")
        name, _, cell = name.strip().partition(".")
        effect = _find(name, text)
        value = _number(number, text, effect)
        si = float(to_si(value, effect.unit))
        plan = dataclasses.replace(
            plan,
            **{effect.stage: _set(getattr(plan, effect.stage), effect, cell, si, text)},
            effects=(*plan.effects, (f"{name}.{cell}" if cell else name, value)),
        )
    return plan


def _set(stage: Any, effect: Effect, cell: str, si: float, text: str) -> Any:
    one_cell = effect.field in ("zero_offset_V_V", "gain_error")
    if cell and (not one_cell or cell not in CELLS):
        raise ConfigError(
            f"effect {effect.name!r} knows no part {cell!r}",
            where=f"--effect {text}",
            got=cell,
            expected=", ".join(CELLS) if one_cell else "the effect's name alone",
            next_step="correct the part after the dot",
        )
    if not one_cell:
        return dataclasses.replace(stage, **{effect.field: si})
    changed: dict[str, Any] = {
        name: dataclasses.replace(getattr(stage, name), **{effect.field: si})
        for name in ((cell,) if cell else CELLS)
    }
    return dataclasses.replace(stage, **changed)


def _find(name: str, text: str) -> Effect:
    for effect in EFFECTS:
        if effect.name == name:
            return effect
    names = [effect.name for effect in EFFECTS]
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    raise ConfigError(
        f"unknown effect {name!r}",
        where=f"--effect {text}",
        got=name,
        expected=", ".join(names),
        next_step=f"did you mean {near[0]!r}?" if near else "use one of those expected",
        rule="unknown-effect",
    )


def _number(number: str, text: str, effect: Effect) -> float:
    try:
        value = float(number)
    except ValueError:
        value = float("nan")
    if value != value or value in (float("inf"), float("-inf")):
        raise ConfigError(
            f"effect {effect.name!r} has no number",
            where=f"--effect {text}",
            got=number or "nothing",
            expected=f"a number in {effect.unit} ({effect.text})",
            next_step=f"write --effect {effect.name}=VALUE",
        )
    return value
