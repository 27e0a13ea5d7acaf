"""Numbers with units, and words of a list, as machine definitions, protocols and tests write them."""

from __future__ import annotations

import math
from typing import Any

from toolkit.errors import ConfigError
from toolkit.files import is_number
from toolkit.units import si_scale, unit


def quantity(entry: dict[str, Any], dimension: str, where: object) -> float:
    """Return ``{ value, unit }`` as a float in SI; the unit must have the dimension that is named."""
    if not isinstance(entry, dict) or "value" not in entry or not isinstance(entry.get("unit"), str):
        raise ConfigError(
            "a quantity has no unit",
            where=where,
            got=entry,
            expected='{ value = NUMBER, unit = "..." }',
            next_step="write value and unit",
            rule="no-unit",
        )
    # A float that is not finite is refused by the caller, who knows what the number is for.
    if not is_number(entry["value"]) and not isinstance(entry["value"], float):
        raise ConfigError(
            "a quantity's value is not a number", where=where, got=entry["value"], expected="a number",
            next_step="write value as a plain number", rule="wrong-value",
        )  # fmt: skip
    found = unit(entry["unit"], where=where)
    if found.dimension == dimension:
        return float(entry["value"]) * found.factor + found.offset
    return float(entry["value"]) * si_scale(entry["unit"], dimension, where=where)


def quantities(entry: dict[str, Any], dimension: str, where: object) -> tuple[float, ...]:
    """Return ``{ value = [..], unit }`` as floats in SI, all finite, at least one."""
    values = entry.get("value") if isinstance(entry, dict) else None
    if not isinstance(values, list) or not values:
        raise ConfigError(
            "a list of quantities is no list", where=where, got=entry,
            expected='{ value = [NUMBER, ...], unit = "..." }', next_step="write the list and its unit",
            rule="wrong-value",
        )  # fmt: skip
    found = tuple(quantity({"value": v, "unit": entry.get("unit")}, dimension, where) for v in values)
    if not all(map(math.isfinite, found)):
        raise ConfigError(
            "a list of quantities has one that is not finite", where=where, got=values,
            expected="finite numbers", next_step="correct the list", rule="wrong-value",
        )  # fmt: skip
    return found


def one_of(value: str, allowed: tuple[str, ...], where: object) -> str:
    """Return a word of a list, or refuse it."""
    if value not in allowed:
        raise ConfigError(
            "a setting has a value that is not known",
            where=where,
            got=value,
            expected=", ".join(allowed),
            next_step="use one of those expected",
        )
    return value
