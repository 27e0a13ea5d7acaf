"""A column's header -> its name and its unit.

``NAME [unit]`` says it whatever the name is. Spreadsheets and other laboratories' files also write
``NAME (unit)``, ``NAME / unit``, ``NAME in unit`` or ``NAME_unit``: these count where the file's
reader knows the name and the unit is one, since each of them may be a name as well.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from toolkit.errors import UnitError
from toolkit.units import unit

_BRACKETS = re.compile(r"(.*?\S)\s*\[([^\[\]]*)\]")
_OTHERS = tuple(
    map(
        re.compile,
        (r"(.*?\S)\s*\(([^()]+)\)", r"(.*?\S)\s*/\s*(.+)", r"(.*\S)\s+in\s+(\S.*)", r"(.+)_([^_]+)"),
    )
)
_LONGEST = 200


def split_header(header: str, is_name: Callable[[str], bool] | None = None) -> tuple[str, str | None]:
    """Return a header's name and its unit as written, None where it states none.

    Parameters
    ----------
    is_name : tells a name that the reader knows; without it square brackets alone hold a unit

    Examples
    --------
    >>> split_header("FY [N]"), split_header("FY_N")
    (('FY', 'N'), ('FY_N', None))
    >>> known = {"FY", "SA"}.__contains__
    >>> [split_header(text, known) for text in ("FY_N", "SA in deg", "FY / kN", "FY (lbf)")]
    [('FY', 'N'), ('SA', 'deg'), ('FY', 'kN'), ('FY', 'lbf')]
    >>> [split_header(text, known) for text in ("FY_raw", "FY (Filtered)", "gain_N")]
    [('FY_raw', None), ('FY (Filtered)', None), ('gain_N', None)]
    """
    text = header.strip()
    if len(text) > _LONGEST:
        return text[:_LONGEST], None
    if match := _BRACKETS.fullmatch(text):
        return match[1], match[2]
    if is_name is None or is_name(text):
        return text, None
    for form in _OTHERS:
        if (match := form.fullmatch(text)) and is_name(match[1]) and is_unit(match[2]):
            return match[1], match[2]
    return text, None


def is_unit(text: str) -> bool:
    """Tell whether a text is a unit that is known.

    >>> is_unit("mV/V"), is_unit("Filtered")
    (True, False)
    """
    try:
        unit(text)
    except UnitError:
        return False
    return True
