"""The text of a ledger's line, taken apart at its quotation marks where an earlier line had its form.

Canonical JSON says each thing in one way. Of a line with nothing to escape, what stands between the texts is
its skeleton; where skeleton and names are those of a line that was parsed, written again and compared, this
one would be written the same. Any other line is parsed. Both ways refuse the same lines.
"""

from __future__ import annotations

import contextlib
import json
import sys
from operator import itemgetter
from typing import Any

from toolkit.calibration.records.record import canonical

_MOST = 32  # forms: a ledger has some ten
_DECODE = json.JSONDecoder().raw_decode
_NUMBER, _TAKEN = "seq", "sha256"

Parts = tuple[dict[str, Any], str]
"""The entries of a line, and its text without the entry ``sha256``: what that is the hash of."""


class LineForm:
    """The lines that differ from one of them in the number ``seq`` and in texts that are no names."""

    def __init__(self, text: str) -> None:
        pieces = text.split('"')
        body: dict[str, Any] = json.loads(text)
        self._skeleton = pieces[::2]
        texts = {name: value for name, value in body.items() if type(value) is str}
        self._rest = {name: value for name, value in body.items() if name not in (*texts, _NUMBER)}
        self._is_deep = any(self._rest.values())
        # A text is a name where a colon follows it: no text of a skeleton is anything else.
        named = [at for at in range(1, len(pieces), 2) if pieces[at + 1].startswith(":")]
        (place,) = [at + 1 for at in named if pieces[at : at + 2] == [_NUMBER, f":{body[_NUMBER]},"]]
        self._number = place // 2
        self._names_of = itemgetter(*named)
        self._names = self._names_of(pieces)
        self._texts = tuple(map(sys.intern, texts))
        self._texts_of = itemgetter(*(at + 2 for at in named if pieces[at + 1] == ":"))

    def parts(self, text: str, pieces: list[str]) -> Parts | None:
        """Return the parts of a line that is split at its quotation marks; None where it has another form."""
        if len(pieces) != 2 * len(self._skeleton) - 1 or self._names_of(pieces) != self._names:
            return None
        skeleton = pieces[::2]
        stated = skeleton[self._number]
        number = stated[1:-1]
        skeleton[self._number] = self._skeleton[self._number]
        if skeleton != self._skeleton or not number.isdecimal() or stated != f":{int(number)},":
            return None
        if self._is_deep:
            return _cut(text, _DECODE(text)[0])
        body = dict(zip(self._texts, self._texts_of(pieces), strict=True))
        return _cut(text, {**body, _NUMBER: int(number), **self._rest})


class LineForms:
    """The forms of the lines until now."""

    def __init__(self) -> None:
        self._forms: tuple[LineForm, ...] = ()  # replaced, never changed: threads read ledgers

    def read(self, text: str) -> tuple[Parts, bool]:
        """Return the parts of a line, and whether it has the form of an earlier one.

        Raises
        ------
        ValueError, KeyError, RecursionError
            it is no canonical JSON object, or has no ``sha256``
        """
        if _is_plain(text):
            pieces = text.split('"')
            for form in self._forms:
                if (parts := form.parts(text, pieces)) is not None:
                    return parts, True
        body, end = _DECODE(text)
        if end != len(text) or type(body) is not dict:
            raise ValueError("it is no JSON object")
        if canonical(body) != text:
            raise ValueError("its text is not canonical")
        return _cut(text, body), False

    def add(self, text: str) -> None:
        """Remember the form of a line that `read` has read and that was an entry."""
        if len(self._forms) < _MOST and _is_plain(text):
            with contextlib.suppress(ValueError):  # a table within the line has a number of this name too
                self._forms = (*self._forms, LineForm(text))


def _is_plain(text: str) -> bool:
    """Tell whether a text has nothing that JSON escapes, but for the quotation marks around its texts."""
    return "\\" not in text and text.isprintable()


def _cut(text: str, body: dict[str, Any]) -> Parts:
    entry = f'"{_TAKEN}":"{body[_TAKEN]}",'
    before, there, after = text.partition(entry)
    if there and entry not in after:
        return body, before + after
    return body, canonical({name: value for name, value in body.items() if name != _TAKEN})
