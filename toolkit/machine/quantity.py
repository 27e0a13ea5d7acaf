"""A number with its unit, as sessions write it."""

from __future__ import annotations

import math
from typing import Any

from toolkit.errors import ConfigError
from toolkit.files import is_number, number_expected
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
    number = entry["value"]
    # A float that is not finite is refused by the caller, who knows what the number is for.
    if not is_number(number) and (not isinstance(number, float) or math.isfinite(number)):
        raise ConfigError(
            "a quantity's value cannot be used", where=where, got=number,
            expected=number_expected(number, "a number"),
            next_step="write value as a plain number", rule="wrong-value",
        )  # fmt: skip
    stated = unit(entry["unit"], where=where)
    if stated.dimension == dimension:
        return float(number) * stated.factor + stated.offset
    return float(number) * si_scale(entry["unit"], dimension, where=where)
