"""Values in a document that is read from the right: a number keeps its sign, a size its order.

In a paragraph from the right the bidirectional algorithm (Unicode Standard Annex 9) takes a leading minus for
a mark of the text around it: ``-33.4`` is printed ``33.4-``, and ``265/35 ZR 18`` begins with ``ZR``. Marks
from the left at both ends keep such a value whole; they have no width, and no reader hears them.
"""

from __future__ import annotations

import unicodedata
from typing import Any

from toolkit.report.template.xml import Story, q

_LRM = "\u200e"
_OFF = ("0", "false", "off")


def from_the_right(package: Any, parts: list[Story]) -> bool:
    """Tell whether some paragraph, table or style of a document is set from right to left."""
    styles = getattr(package.main_document_part, "_styles_part", None)
    roots = [story.root for story in parts] + ([] if styles is None else [styles.element])
    return any(
        (one.get(q("w:val")) or "1").lower() not in _OFF
        for root in roots
        for one in root.iter(q("w:bidi"), q("w:bidiVisual"))
    )


def kept_whole(text: str) -> str:
    """Return a text with a digit, and no letter from the right, between marks from the left, line by line.

    >>> kept_whole("-33.4") == "\\u200e-33.4\\u200e", kept_whole("steel")
    (True, 'steel')
    """
    return "\n".join(f"{_LRM}{line}{_LRM}" if _wants_marks(line) else line for line in text.split("\n"))


def _wants_marks(line: str) -> bool:
    kinds = {unicodedata.bidirectional(character) for character in line}
    return "EN" in kinds and not kinds & {"R", "AL", "AN"}
