"""What a session states beside its data: reference uncertainties, cells, zero and creep readings.

Only a cell's excitation and scale change the fit (`bridge`). All of it is hashed and printed on
certificates: a number whose unit is of another dimension is refused, never kept.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from toolkit.calibration.session.indications import Bridge, bridges_of, per
from toolkit.calibration.session.readings import (
    Scope,
    creep_entries,
    polarity_readings,
    shunt_entry,
    zero_entries,
)
from toolkit.calibration.session.settings import quantity, wrong, zero_readings
from toolkit.errors import SessionError, UnitError
from toolkit.files import check_keys, is_number
from toolkit.units import Unit, si_scale, unit

if TYPE_CHECKING:
    from toolkit.calibration.session.table import Table

_PER_KELVIN = re.compile(r"\s*/\s*(K|degC|°C)\s*\Z")
_FORCE, _MOMENT = re.compile(r"F[XYZ]?\Z"), re.compile(r"M[XYZ]\Z")


def check_load_unit(name: str, text: str, *, where: object) -> None:
    """Refuse a load's unit: F, FX, FY, FZ are forces, MX, MY, MZ moments, any other name one of both.

    Raises
    ------
    UnitError
        ``unknown-unit``, ``unit-dimension``
    """
    wanted = "force" if _FORCE.match(name) else "moment" if _MOMENT.match(name) else None
    if wanted is not None:
        si_scale(text, wanted, where=where)
    elif unit(text, where=where).dimension != "moment":
        si_scale(text, "force", where=where)


def check_columns(table: Table, loads: tuple[str, ...], where: object) -> None:
    """Refuse a load or a ``u_<LOAD>`` column in a unit of another dimension, or one that is not positive.

    Raises
    ------
    UnitError, SessionError
    """
    for load in loads:
        check_load_unit(load, table.unit(load), where=f"{where}, column {load}")
        name = f"u_{load}"
        if not table.has(name):
            continue
        found, dimension = unit(table.unit(name)), unit(table.unit(load)).dimension
        if found.dimension != dimension:
            raise _other_unit(
                f"{where}, column {name}", found, dimension,
                f"{table.unit(load)!r}; a share of the load is stated once for all rows, "
                f"[reference.uncertainty] {load} = {{ U = .., k = .., unit = '%' }}",
            )  # fmt: skip
        if not (table.column(name) > 0).all():
            row = int((table.column(name) <= 0).argmax()) + 1
            raise SessionError(
                "a standard uncertainty is not positive",
                where=f"{where}, row {row} (line {table.lines[row - 1]}), column {name}",
                got=table.column(name)[row - 1],
                expected="a positive number",
                next_step="state the uncertainty of every row; nothing was written", rule="cell",
            )  # fmt: skip


def check_weights(table: Table, loads: tuple[str, ...], where: object) -> None:
    """Refuse data that do not weigh their rows: ``wls`` takes a column ``u_<LOAD>`` of each load.

    Raises
    ------
    SessionError
    """
    lacking = [f"u_{load}" for load in loads if not table.has(f"u_{load}")]
    if lacking:
        raise SessionError(
            f'method = "wls" weighs rows by their own uncertainty, and {", ".join(lacking)} '
            f"{'is' if len(lacking) == 1 else 'are'} not in the data",
            where=where,
            got=", ".join(table.names),
            expected=f"{lacking[0]} [{table.unit(lacking[0][2:])}], a standard uncertainty of each row",
            next_step='add it, or take method = "ols": a U of [reference.uncertainty] is an error that all '
            "rows share, and weighs none; nothing was written",
            rule="columns",
        )


def _other_unit(where: str, unit: Unit, dimension: str, allowed: str) -> UnitError:
    return UnitError(
        f"unit {unit.text!r} is no unit of {dimension}",
        where=where,
        got=f"{unit.text} ({unit.dimension})",
        expected=f"a unit of {dimension}, such as {allowed}",
        next_step="correct the unit; nothing was written",
        rule="unit-dimension",
    )


def check_statements(raw: Mapping[str, Any], table: Table, loads: tuple[str, ...], where: object) -> None:
    """Check what a session states beside its data; ``table`` is the data as recorded, its keys are `keys`'.

    Raises
    ------
    ConfigError, UnitError
        a number that is none, a unit that is unknown or of another dimension
    """
    indications = list(raw["indications"])  # checked by `settings`; a list of readings is in this order
    cells = raw.get("cells", {})
    scope = Scope(
        bridges=bridges_of(cells, indications, where=where),
        columns={name: table.unit(name) for name in indications},
        loads={load: table.unit(load) for load in loads},
        where=where,
    )
    for name, cell in cells.items():
        bridge, column = scope.bridges[name], scope.columns[name]
        for key in ("resolution", "u"):
            if key not in cell:
                continue
            place = f"cells.{name}.{key}"
            if not bridge.stated(cell[key], place, column=column, target=scope.unit(name)) > 0:
                raise wrong(where, place, cell[key], "a number above zero; leave out what is not known")
        temperature_effect(cell.get("temperature_coefficient"), bridge, column, scope.unit(name))
        replacement = cell.get("replacement", "none")
        if not isinstance(replacement, str) or not replacement.strip():
            raise wrong(where, f"cells.{name}.replacement", replacement, "a text: why the cell was replaced")
        shunt_entry(name, cell, scope)
    _check_reference(raw.get("reference", {}), table, where)
    _check_between(raw.get("between_runs", {}), table, where)
    zero_entries(zero_readings(raw), scope)
    creep_entries(raw.get("creep", []), scope)
    polarity_readings(raw.get("polarity", []), scope)
    if "temperature" in raw:
        kelvin = quantity(raw["temperature"], "temperature", f"{where}: temperature")
        if not kelvin > 0:
            raise wrong(where, "temperature", raw["temperature"], "a temperature above absolute zero")


def temperature_effect(
    entry: object, bridge: Bridge, column: str, target: str
) -> tuple[float | None, float | None]:
    """Read ``temperature_coefficient`` of a cell: (span [1/K], zero [``target`` per K]).

    It is ``{ span, zero }``, or one number for the span. ``span`` is a number, or ``{ value, unit }`` in
    1/K, %/K, ppm/K; ``zero`` a number in the column's unit per kelvin, or ``{ value, unit }``. A unit may
    leave out its "/K".

    Raises
    ------
    ConfigError, UnitError
    """
    key = f"cells.{bridge.name}.temperature_coefficient"
    if entry is None:
        return None, None
    parts = entry if isinstance(entry, dict) and not {"value", "unit"} & set(entry) else {"span": entry}
    check_keys(parts, ("span", "zero"), where=f"{bridge.where}: {key}")
    plain = {
        name: part | {"unit": per(part["unit"], _PER_KELVIN)}
        if isinstance(part, dict) and isinstance(part.get("unit"), str)
        else part
        for name, part in parts.items()
    }
    span = zero = None
    if "span" in plain:
        span = bridge.stated(plain["span"], f"{key}.span", column="1", target="1")
    if "zero" in plain:
        zero = bridge.stated(plain["zero"], f"{key}.zero", column=column, target=target)
    return span, zero


def _check_between(entries: Mapping[str, Any], table: Table, where: object) -> None:
    for name, entry in entries.items():
        place = f"between_runs.{name}"
        for key in ("zero", "gain"):
            if not is_number(entry[key]) or entry[key] < 0:
                raise wrong(where, f"{place}.{key}", entry[key], "a standard deviation, zero or more")
        found, dimension = (
            unit(entry["unit"], where=f"{where}: {place}.unit"),
            unit(table.unit(name)).dimension,
        )
        if found.dimension != dimension:
            raise _other_unit(f"{where}: {place}.unit", found, dimension, repr(table.unit(name)))


def _check_reference(reference: Mapping[str, Any], table: Table, where: object) -> None:
    for name, entry in reference.get("uncertainty", {}).items():
        place = f"reference.uncertainty.{name}"
        for key, least in (("U", "a number, zero or more"), ("k", "a positive number")):
            value = entry.get(key)
            if not is_number(value):
                raise wrong(where, f"{place}.{key}", value, least)
            if value < 0 or (key == "k" and value == 0):
                raise wrong(where, f"{place}.{key}", value, least)
        text = entry["unit"]
        found, dimension = unit(text, where=f"{where}: {place}.unit"), unit(table.unit(name)).dimension
        if found.dimension not in (dimension, "ratio"):
            raise _other_unit(f"{where}: {place}.unit", found, dimension, f"{table.unit(name)!r}, or '%' or "
                              "'ppm' of the applied load")  # fmt: skip
