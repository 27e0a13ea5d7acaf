"""What a session states beside its data: reference uncertainties, cells, zero and creep readings.

None of it changes the fit, all of it is hashed and printed on certificates: a number whose unit is of
another dimension is refused, never kept.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from toolkit.calibration.session.settings import wrong
from toolkit.errors import SessionError, UnitError
from toolkit.files import check_keys
from toolkit.machine.definition import quantity
from toolkit.units import si_scale, unit

if TYPE_CHECKING:
    from toolkit.calibration.session.table import Table

_REFERENCE = "standard certificate uncertainty due shared_group".split()
_CELL = "serial resolution scale excitation shunt_expected u".split()
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
        si_scale(table.unit(name), unit(table.unit(load)).dimension, where=f"{where}, column {name}")
        if not (table.column(name) > 0).all():
            row = int((table.column(name) <= 0).argmax()) + 1
            raise SessionError(
                "a standard uncertainty is not positive",
                where=f"{where}, row {row}, column {name}", got=table.column(name)[row - 1],
                expected="a positive number", next_step="state the uncertainty of every row", rule="cell",
            )  # fmt: skip


def check_statements(raw: Mapping[str, Any], table: Table, loads: tuple[str, ...], where: object) -> None:
    """Check the parts of a session that the fit does not use.

    Raises
    ------
    ConfigError, UnitError
        an unknown key, a number that is none, a unit that is unknown or of another dimension
    """
    indications = [name for name in table.names if name not in loads and not name.startswith("u_")]
    for key, known in (("reference", _REFERENCE), ("cells", indications), ("certificate", None)):
        entry = raw.get(key, {})
        if not isinstance(entry, dict):
            raise wrong(where, key, entry, f"a table [{key}]")
        if known is not None:
            check_keys(entry, known, where=f"{where}: {key}")
    for name, cell in raw.get("cells", {}).items():
        if not isinstance(cell, dict):
            raise wrong(where, f"cells.{name}", cell, f"a table [cells.{name}]")
        check_keys(cell, _CELL, where=f"{where}: cells.{name}")
        _check_cell(name, cell, table.unit(name), where)
    _check_reference(raw.get("reference", {}), table, loads, where)
    for key, keys in (("zero", ("when", "values")), ("creep", ("load", "seconds", "value"))):
        entries = raw.get(key, [])
        if isinstance(entries, str) and key == "zero":
            continue
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            raise wrong(where, key, entries, f"tables [[{key}]] with {', '.join(keys)}")
        for entry in entries:
            check_keys(entry, keys, where=f"{where}: {key}")
    if "temperature" in raw:
        quantity(raw["temperature"], "temperature", f"{where}: temperature")


def stated(entry: object, text: str, place: str, where: object) -> float:
    """Return a number, or ``{ value, unit }`` of the same dimension as a unit, in that unit.

    Raises
    ------
    ConfigError, UnitError
    """
    found = unit(text)
    value = quantity(entry, found.dimension, f"{where}: {place}") / found.factor if isinstance(
        entry, dict
    ) else entry  # fmt: skip
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise wrong(where, place, entry, f"a number in {text}, or {{ value, unit }}")
    return float(value)


def _check_reference(
    reference: Mapping[str, Any], table: Table, loads: tuple[str, ...], where: object
) -> None:
    uncertainty = reference.get("uncertainty", {})
    if not isinstance(uncertainty, dict):
        raise wrong(where, "reference.uncertainty", uncertainty, "{ FY = { U, k, unit } }")
    check_keys(uncertainty, loads, where=f"{where}: reference.uncertainty")
    for name, entry in uncertainty.items():
        place = f"reference.uncertainty.{name}"
        if not isinstance(entry, dict):
            raise wrong(where, place, entry, "{ U, k, unit }")
        check_keys(entry, ("U", "k", "unit"), where=f"{where}: {place}")
        for key, least in (("U", "a number, zero or more"), ("k", "a positive number")):
            value = entry.get(key)
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise wrong(where, f"{place}.{key}", value, least)
            if value < 0 or (key == "k" and value == 0):
                raise wrong(where, f"{place}.{key}", value, least)
        text = entry.get("unit")
        if not isinstance(text, str):
            raise wrong(where, f"{place}.unit", text, f"a unit such as {table.unit(name)!r}", "no-unit")
        si_scale(text, unit(table.unit(name)).dimension, where=f"{where}: {place}")


def _check_cell(name: str, cell: Mapping[str, Any], text: str, where: object) -> None:
    for key in ("resolution", "u"):
        if key in cell:
            stated(cell[key], text, f"cells.{name}.{key}", where)
    if "excitation" in cell:
        stated(cell["excitation"], "V", f"cells.{name}.excitation", where)
    if "shunt_expected" in cell:
        # A shunt is told as the bridge's output, also where the file has the cell scaled to a force.
        place = f"cells.{name}.shunt_expected"
        try:
            stated(cell["shunt_expected"], text, place, where)
        except UnitError:
            if unit(cell["shunt_expected"]["unit"], where=f"{where}: {place}").dimension != "bridge_ratio":
                raise
            stated(cell["shunt_expected"], "mV/V", place, where)
    if "scale" in cell:
        scale = cell["scale"]
        value = scale.get("value") if isinstance(scale, dict) else scale
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise wrong(where, f"cells.{name}.scale", scale, "a number, or { value, unit }")
        if isinstance(scale, dict):
            check_keys(scale, ("value", "unit"), where=f"{where}: cells.{name}.scale")
            si_scale(str(scale.get("unit")), where=f"{where}: cells.{name}.scale")
