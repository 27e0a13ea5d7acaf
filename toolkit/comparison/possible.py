"""What no tire does: values beyond it are a wrong unit or a slip of the pen, and would move a whole table.

The limits are generous: the largest aircraft tires carry some 300 kN, and no tire is steered square to its
way.
"""

from __future__ import annotations

import math

from toolkit.errors import CellError

# Largest sizes by SI unit.
_LARGEST = {"N": 1e6, "N*m": 1e5, "N/rad": 1e8, "N*m/rad": 1e7, "rad": math.pi / 2}
_SHOWN = {"rad": "90 deg"}


def demand_possible(value: float, unit: str, *, where: str, U: bool = False) -> None:
    """Refuse a value [SI] that no tire has; an uncertainty ``U`` that is negative too.

    Raises
    ------
    CellError
        ``wrong-value``

    >>> demand_possible(4000.0, "N", where="maker.csv, row 2, column FZ")
    """
    limit = _LARGEST[unit]
    if abs(value) <= limit and not (U and value < 0):
        return
    shown = _SHOWN.get(unit, f"{limit:g} {unit}")
    raise CellError(
        "an uncertainty is negative" if U and value < 0 else "a value is larger than any tire's",
        where=where,
        got=f"{value:g} {unit}",
        expected=f"0 to {shown}" if U else f"at most {shown}",
        next_step="correct the cell, or the unit in the header",
        rule="wrong-value",
    )
