"""What a machine definition states of its load cells: the sign of each response, and the rated loads."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from toolkit.errors import ConfigError
from toolkit.files import check_keys
from toolkit.machine.quantity import quantity
from toolkit.units import unit

_KEYS = ("name", "polarity", "source")


@dataclass(frozen=True, slots=True, kw_only=True)
class CellPolarity:
    """The signs of one cell: ``signs`` are pairs of a load and +1 or -1, ``source`` says who states them.

    A sign is that of d load / d indication in the load's equation: +1 where the load grows with the
    indication while the other cells stay as they are.
    """

    name: str
    signs: tuple[tuple[str, int], ...]
    source: str

    def sign(self, load: str) -> int | None:
        """Return +1 or -1 for a load; None where the definition states none."""
        return dict(self.signs).get(load)


def read_polarity(entries: Any, indications: Collection[str], where: object) -> tuple[CellPolarity, ...]:
    """Read the entries ``[[cell]]`` of a machine definition.

    Raises
    ------
    ConfigError
        an unknown key, a cell that is no indication of the machine or stands twice, a sign that is not
        +1 or -1, no source
    """
    if not isinstance(entries, list) or not all(isinstance(one, dict) for one in entries):
        raise _wrong(where, entries, '[[cell]] with name = "D51", polarity = { FY = 1 } and source')
    cells: list[CellPolarity] = []
    for entry in entries:
        check_keys(entry, _KEYS, where=where)
        name, signs, source = entry.get("name"), entry.get("polarity"), entry.get("source")
        if name not in indications or any(one.name == name for one in cells):
            raise _wrong(where, name, f"each of {', '.join(indications)} once")
        here = f"{where} {name}"
        if not isinstance(signs, dict) or not signs:
            raise _wrong(here, signs, "polarity = { FY = 1, MZ = -1 }")
        for load, sign in signs.items():
            if isinstance(sign, bool) or sign not in (1, -1):
                raise _wrong(f"{here}, {load}", sign, "1 or -1")
        if not isinstance(source, str) or not source.strip():
            raise _wrong(here, source, 'source = "who states it, and where"')
        pairs = tuple((str(load), int(sign)) for load, sign in signs.items())
        cells.append(CellPolarity(name=str(name), signs=pairs, source=source))
    return tuple(cells)


def read_rated_loads(entries: Any, where: object) -> tuple[tuple[str, float], ...]:
    """Read ``[rated_load]``: pairs of a load and its rated value [N, N*m].

    Raises
    ------
    ConfigError, UnitError
        no force or moment above zero
    """
    if not isinstance(entries, Mapping):
        raise _wrong(where, entries, 'FY = { value = 1372, unit = "lbf" }')
    rated = []
    for load, entry in entries.items():
        here = f"{where}.{load}"
        text = entry.get("unit") if isinstance(entry, Mapping) else None
        dimension = unit(text, where=here).dimension if isinstance(text, str) else "force"
        value = quantity(entry, dimension if dimension in ("force", "moment") else "force", here)
        if not (math.isfinite(value) and value > 0):
            raise _wrong(here, value, "a load above zero")
        rated.append((str(load), value))
    return tuple(rated)


def _wrong(where: object, got: object, expected: str) -> ConfigError:
    return ConfigError(
        "a machine definition states a cell in a way that cannot be used", where=where,
        got="nothing" if got is None else got, expected=expected, next_step="correct the definition",
        rule="wrong-value",
    )  # fmt: skip
