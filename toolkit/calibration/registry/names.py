"""Entered, checked and approved by different names: not the same name written another way.

Two spellings are one name where case, spaces, the form of a character (full width, ligature), what cannot be
seen (a zero-width space, a soft hyphen) or a Greek or Cyrillic letter that looks like a Latin one make the
difference. Accents do: Müller is not Muller.
"""

from __future__ import annotations

import unicodedata
from typing import TYPE_CHECKING

from toolkit.errors import RegistryError

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord

# Small letters that are drawn like Latin ones, of the confusables of Unicode Technical Standard 39.
_CYRILLIC = str.maketrans("асеіјорѕухһԁԛԝвкмнт", "aceijopsyxhdqwbkmht")
_GREEK = str.maketrans("αορνυικτχβηζ", "aopvuiktxbhz")


def check_names(record: CalibrationRecord, checked_by: str, approved_by: str | None) -> None:
    """Refuse a decision whose names are not different.

    Raises
    ------
    RegistryError
        ``names``
    """
    names = [("entered by", record.entered_by), ("checked by", checked_by)]
    names += [("approved by", approved_by)] if approved_by is not None else []
    seen: dict[str, str] = {}
    for role, name in names:
        key = name_key(name)
        if not key or key in seen:
            raise RegistryError(
                "entered, checked and approved must be different names",
                where=record.id,
                got=f"{role} {name!r}" + (f", also {seen[key]}" if key in seen else ""),
                expected=f"a name that is none of {', '.join(f'{n!r} ({r})' for r, n in names if r != role)}",
                next_step=f"nothing was changed; see 'toolkit calibration show {record.id}'",
                rule="names",
            )
        seen[key] = role


def name_key(name: str) -> str:
    """Return what two spellings of one name have in common; empty where nothing can be seen.

    >>> name_key(" J.  Smith ") == name_key("j. smith") == name_key("J. S\u200bmith")
    True
    """
    # Compatibility forms first: they may unfold to spaces, capitals and marks.
    text = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())
    seen = "".join(c for c in text if unicodedata.category(c) not in ("Cf", "Cc", "Cn", "Co") or c.isspace())
    return " ".join(seen.split()).translate(_CYRILLIC).translate(_GREEK)
