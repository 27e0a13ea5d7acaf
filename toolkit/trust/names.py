"""Names of people, however they are written: two spellings of one name are one person."""

from __future__ import annotations

import unicodedata

# Small letters that are drawn like Latin ones, of the confusables of Unicode Technical Standard 39.
_CYRILLIC = str.maketrans("асеіјорѕухһԁԛԝвкмнт", "aceijopsyxhdqwbkmht")
_GREEK = str.maketrans("αορνυικτχβηζ", "aopvuiktxbhz")


def name_key(name: str) -> str:
    """Return what two spellings of one name have in common; empty where nothing can be seen.

    >>> name_key(" J.  Smith ") == name_key("j. smith") == name_key("J. S\u200bmith")
    True
    """
    # Compatibility forms first: they may unfold to spaces, capitals and marks.
    text = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())
    visible = "".join(
        c for c in text if unicodedata.category(c) not in ("Cf", "Cc", "Cn", "Co") or c.isspace()
    )
    return " ".join(visible.split()).translate(_CYRILLIC).translate(_GREEK)
