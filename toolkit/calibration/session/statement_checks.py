"""What a session states beside its data: reference uncertainties, cells, zero and creep readings.

Only a cell's excitation and scale change the fit (`bridge`). All of it is hashed and printed on
certificates: a number whose unit is of another dimension is refused, never kept.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from toolkit.calibration.session.indications import Bridge, per
from toolkit.calibration.session.readings import (
    creep_entries,
    polarity_readings,
    scope_of_entries,
    shunt_entry,
    zero_entries,
)
from toolkit.calibration.session.session_file import (
    Amount,
    CellEntries,
    SessionFile,
    Stated,
    TemperatureCoefficient,
)
from toolkit.calibration.session.settings import wrong
from toolkit.channels import load_dimension
from toolkit.errors import SessionError, UnitError
from toolkit.units import Unit, si_scale, unit

if TYPE_CHECKING:
    from toolkit.calibration.session.table import Table

_PER_KELVIN = re.compile(r"\s*/\s*(K|degC|°C)\s*\Z")


def check_load_unit(name: str, text: str, *, where: object) -> None:
    """Refuse a load's unit: F, FX, FY, FZ are forces, MX, MY, MZ moments, any other name one of both.

    Raises
    ------
    UnitError
        ``unknown-unit``, ``unit-dimension``
    """
    quantity = load_dimension(name)
    if quantity is not None:
        si_scale(text, quantity, where=where)
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
        scale, dimension = unit(table.unit(name)), unit(table.unit(load)).dimension
        if scale.dimension != dimension:
            raise _other_unit(
                f"{where}, column {name}", scale, dimension,
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


def check_statements(entries: SessionFile, table: Table, where: object) -> None:
    """Hold what a session states beside its data against the units of ``table``, the data as recorded.

    Raises
    ------
    ConfigError, UnitError
        a unit that is unknown or of another dimension; readings that belong to no indication or load
    """
    scope = scope_of_entries(
        entries,
        columns={name: table.unit(name) for name in entries.indications},
        loads={load: table.unit(load) for load in entries.loads},
        where=where,
    )
    for name, cell in entries.cells:
        for key, entry in (("resolution", cell.resolution), ("u", cell.u)):
            if entry is not None:
                scope.value(name, entry, f"cells.{name}.{key}")
        temperature_effect(cell, scope.bridges[name], scope.columns[name], scope.unit(name))
        shunt_entry(name, cell, scope)
    if entries.reference is not None:
        for load, uncertainty in entries.reference.uncertainty:
            _check_unit(
                f"{where}: reference.uncertainty.{load}.unit", uncertainty.unit, table.unit(load), "ratio"
            )
    for load, between in entries.between_runs:
        _check_unit(f"{where}: between_runs.{load}.unit", between.unit, table.unit(load))
    zero_entries(entries.zero_readings, scope)
    creep_entries(entries.creep, scope)
    polarity_readings(entries.polarity, scope)
    if entries.temperature is not None:
        kelvin = entries.temperature.si("temperature", f"{where}: temperature")
        if not kelvin > 0:
            raise wrong(where, "temperature", entries.temperature, "a temperature above absolute zero")


def temperature_effect(
    cell: CellEntries, bridge: Bridge, column: str, target: str
) -> tuple[float | None, float | None]:
    """Return ``temperature_coefficient`` of a cell: (span [1/K], zero [``target`` per K]).

    It is ``{ span, zero }``, or one number for the span. ``span`` is a number, or ``{ value, unit }`` in
    1/K, %/K, ppm/K; ``zero`` a number in the column's unit per kelvin, or ``{ value, unit }``. A unit may
    leave out its "/K".

    Raises
    ------
    UnitError
    """
    effect = cell.temperature_coefficient
    if not isinstance(effect, TemperatureCoefficient):
        effect = TemperatureCoefficient(span=effect)

    def number(name: str, entry: Stated | None, column: str, target: str) -> float | None:
        if entry is None:
            return None
        if isinstance(entry, Amount):
            entry = replace(entry, unit=per(entry.unit, _PER_KELVIN))
        key = f"cells.{bridge.name}.temperature_coefficient.{name}"
        return bridge.stated(entry, key, column=column, target=target)

    return number("span", effect.span, "1", "1"), number("zero", effect.zero, column, target)


def _check_unit(where: str, text: str, load_unit: str, *alternatives: str) -> None:
    stated, dimension = unit(text, where=where), unit(load_unit).dimension
    if stated.dimension not in (dimension, *alternatives):
        share = ", or '%' or 'ppm' of the applied load" if alternatives else ""
        raise _other_unit(where, stated, dimension, f"{load_unit!r}{share}")
