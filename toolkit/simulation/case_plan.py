"""What a plan says of the diagnosis case that can be made of its test: outputs, columns, free parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

from toolkit.errors import ConfigError
from toolkit.files import check_keys, is_number
from toolkit.machine.quantity import one_of
from toolkit.units import unit

Outputs = Literal["forces", "cells"]
Load = Literal["measured", "judged", "commanded"]
COLUMNS = (
    "SA", "FZ", "V", "TIRE_ANGLE", "DRUM_ANGLE", "P_INFL", "T_TREAD", "T_AMBIENT", "SA_CMD", "FZ_CMD"
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Free:
    """A parameter of the case's simulation with its prior; ``sd`` None where it is known exactly."""

    name: str
    value: float
    unit: str
    sd: float | None
    bounds: tuple[float, float] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CasePlan:
    """Outputs: ``forces`` FY and MZ by the calibration, or ``cells`` with the calibration named.

    ``columns`` beside t, SA and the load (None: those that vary). ``load`` says what is known of it: FZ
    ``measured`` drives the tire, or is ``judged`` as an output that FZ_CMD drives, or only FZ_CMD was
    ``commanded``.
    """

    outputs: Outputs = "forces"
    columns: tuple[str, ...] | None = None
    load: Load = "measured"
    parameters: tuple[Free, ...] = ()


def read_case_plan(table: Any, *, where: str) -> CasePlan:
    """Read ``[case]``.

    Raises
    ------
    ConfigError
        an unknown key or column, a parameter without value or unit
    """
    if not isinstance(table, dict):
        raise _wrong("case is no table", where, table, "[case] with its keys")
    check_keys(table, ("outputs", "columns", "load", "parameters"), where=where)
    columns = table.get("columns")
    if columns is not None:
        if not isinstance(columns, list):
            raise _wrong("columns are no list", f"{where}.columns", columns, f"some of {', '.join(COLUMNS)}")
        for one in columns:
            one_of(one, COLUMNS, f"{where}.columns")
    parameters = table.get("parameters", {})
    if not isinstance(parameters, dict):
        raise _wrong("parameters are no table", f"{where}.parameters", parameters, "[case.parameters.NAME]")
    return CasePlan(
        outputs=cast(
            "Outputs", one_of(table.get("outputs", "forces"), ("forces", "cells"), f"{where}.outputs")
        ),
        columns=None if columns is None else tuple(columns),
        load=cast("Load", one_of(table.get("load", "measured"), get_args(Load), f"{where}.load")),
        parameters=tuple(_free(name, one, f"{where}.parameters.{name}") for name, one in parameters.items()),
    )


def _free(name: str, table: Any, where: str) -> Free:
    if not isinstance(table, dict):
        raise _wrong("a parameter is no table", where, table, '{ value = 1, unit = "1", sd = 0.02 }')
    check_keys(table, ("value", "unit", "sd", "bounds"), where=where)
    text = table.get("unit")
    if not isinstance(text, str):
        raise _wrong("a parameter has no unit", f"{where}.unit", text, 'unit = "1"')
    unit(text, where=where)
    bounds = table.get("bounds")
    if bounds is not None and (not isinstance(bounds, list) or len(bounds) != 2):
        raise _wrong("bounds are two numbers", f"{where}.bounds", bounds, "bounds = [low, high]")
    return Free(
        name=name,
        value=_number(table.get("value"), f"{where}.value"),
        unit=text,
        sd=_number(table["sd"], f"{where}.sd") if "sd" in table else None,
        bounds=None if bounds is None else (_number(bounds[0], where), _number(bounds[1], where)),
    )


def _number(value: object, where: str) -> float:
    if not is_number(value):
        raise _wrong("an entry is no number", where, value, "a finite number")
    return float(value)


def _wrong(what: str, where: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        what, where=where, got=got, expected=expected, next_step="correct the plan", rule="wrong-value"
    )
