"""What the machine states of its instruments without a calibration record: rows of the table ``stated``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from toolkit.report.content import Cell
from toolkit.report.style import Style
from toolkit.report.tags import format_number
from toolkit.units import from_si

if TYPE_CHECKING:
    from toolkit.machine import TypeB

_NAMES = {
    "FZ": "load",
    "zero": "zero of the cells, without a tare",
    "SA": "zero of the slip angle",
    "SA_scale": "scale of the slip angle",
    "P": "inflation pressure",
}
_COMMON = {"machine": "all tests of the machine", "test": "this test"}


def stated_rows(stated: Sequence[TypeB], style: Style) -> list[dict[str, Cell]]:
    """Return one row a statement: the quantity, its standard uncertainty, what shares the error, the source.

    The two parts of one uncertainty, in the unit and relative to the value, add as squares.
    """
    return [
        {
            "quantity": _NAMES.get(one.symbol, one.symbol),
            "u": " and ".join(_parts(one, style)),
            "common": _COMMON[one.common],
            "source": one.source,
        }
        for one in stated
    ]


def _parts(one: TypeB, style: Style) -> list[str]:
    def say(value: float, unit: str) -> str:
        return f"{format_number(value, '.3g', decimal_comma=style.decimal_comma)} {unit}"

    made = []
    if one.u and one.symbol == "FZ":
        unit, factor = style.unit("N")
        made.append(say(one.u * factor, str(unit)))
    elif one.u and one.symbol == "P":
        made.append(say(float(from_si(one.u, "kPa")), "kPa"))
    elif one.u:
        made.append(say(math.degrees(one.u), "deg"))
    if one.relative:
        made.append(say(100 * one.relative, "%"))
    if one.effect and made:
        made[-1] += f", of which a force follows {say(100 * one.effect, '%')}"
    return made
