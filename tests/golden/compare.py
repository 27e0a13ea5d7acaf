"""Two answers, frozen and of today, walked side by side: what differs, where, and by how much.

Two rules, by the area of an entry:

bit-equal
    The same JSON: a number that differs in its last bit differs, so does 1 from 1.0.
standard error
    Of a diagnosis: a value and its interval may differ by 1e-9 of the value's standard error, a shift of a
    nominal parameter by 1e-9 of its prior's; evidence, errors and predicted curves by a relative 1e-7: they
    follow the values.
A sentence for people may be worded anew: where its numbers are the same, the difference is one of wording.
A key that no frozen answer has is an addition: docs/compatibility.md allows it, and `make golden` shows it.
"""

from __future__ import annotations

import dataclasses
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

SHARE_OF_STANDARD_ERROR = 1e-9
SHARE_OF_EVIDENCE = 1e-7
BY_STANDARD_ERROR = ("diagnosis", "proof")
"""Areas that are compared by standard errors."""
SENTENCES = frozenset("message sentence statement reason note why equation reference".split())
"""Keys of sentences for people about results."""
HELP = "description"
"""Key of a sentence about a tag: its numbers are no results."""
Kind = Literal["result", "wording", "addition"]
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_NORMAL_95 = 1.959963984540054


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """What differs at a key path: a result, the wording of a sentence, or an entry that was added."""

    path: str
    frozen: str
    today: str
    by: str = ""
    kind: Kind = "result"

    def __str__(self) -> str:
        by = f"  ({self.by})" if self.by else ""
        return f"{self.path}\n    frozen {self.frozen}\n    today  {self.today}{by}"


def differences(frozen: Any, today: Any, area: str) -> list[Difference]:
    """Return every difference between two answers of an entry in an area."""
    return list(_walk(frozen, today, _Place(area in BY_STANDARD_ERROR)))


@dataclass(frozen=True, slots=True)
class _Place:
    """Where the walk is: the key path, its last key, and how far a number may be off."""

    by_standard_error: bool
    path: str = ""
    key: str = ""
    scale: float | None = None

    def at(self, key: str, parent: Mapping[str, Any]) -> _Place:
        """Return the place of an entry of a table."""
        scale = _scale(key, parent) if self.by_standard_error else None
        path = f"{self.path}.{key}".lstrip(".")
        return _Place(self.by_standard_error, path, key, self.scale if scale is None else scale)

    def row(self, number: int) -> _Place:
        """Return the place of an entry of a list."""
        return dataclasses.replace(self, path=f"{self.path}[{number}]")

    def series(self, values: list[Any]) -> _Place:
        """Return the place of a curve: its numbers count by the largest, so that a zero crossing is free."""
        if not self.by_standard_error or self.scale is not None or len(values) <= 3:
            return self
        if not all(isinstance(value, float) for value in values):
            return self
        share = SHARE_OF_EVIDENCE / SHARE_OF_STANDARD_ERROR
        return dataclasses.replace(self, scale=share * max(map(abs, values)))

    def allowed(self, frozen: float) -> float:
        """Return how far a number may be from the frozen one."""
        if not self.by_standard_error:
            return 0.0
        if self.scale is not None:
            return SHARE_OF_STANDARD_ERROR * self.scale
        return SHARE_OF_EVIDENCE * abs(frozen)


def _scale(key: str, parent: Mapping[str, Any]) -> float | None:
    """Return the standard error in which a number counts; None where nothing states one."""
    if key in ("value", "ci95") and isinstance(interval := parent.get("ci95"), list) and None not in interval:
        return float(interval[1] - interval[0]) / (2 * _NORMAL_95)
    if key == "value" and isinstance(parent.get("standard_error"), float):
        return float(parent["standard_error"])
    if key in ("before", "after", "prior_sd") and parent.get("prior_sd"):
        return float(parent["prior_sd"])
    return 1.0 if key == "shift_in_sd" else None


def _walk(frozen: Any, today: Any, place: _Place) -> Iterator[Difference]:
    if isinstance(frozen, dict) and isinstance(today, dict):
        for key in [*frozen, *(key for key in today if key not in frozen)]:
            inner = place.at(key, frozen)
            if key not in today:
                yield Difference(path=inner.path, frozen=_short(frozen[key]), today="(missing)")
            elif key not in frozen:
                yield Difference(
                    path=inner.path, frozen="(missing)", today=_short(today[key]), kind="addition"
                )
            else:
                yield from _walk(frozen[key], today[key], inner)
    elif isinstance(frozen, list) and isinstance(today, list):
        if len(frozen) != len(today):
            yield Difference(path=place.path, frozen=f"{len(frozen)} rows", today=f"{len(today)} rows")
        place = place.series(frozen)
        for number, (before, after) in enumerate(zip(frozen, today, strict=False)):
            yield from _walk(before, after, place.row(number))
    elif _is_number(frozen) and _is_number(today):
        yield from _numbers(frozen, today, place)
    elif frozen != today or type(frozen) is not type(today):
        yield _texts(frozen, today, place)


def _numbers(frozen: float, today: float, place: _Place) -> Iterator[Difference]:
    if repr(frozen) == repr(today):
        return
    off = abs(today - frozen)
    if isinstance(frozen, float) and isinstance(today, float) and off <= place.allowed(frozen) > 0:
        return
    by = f"off by {off:.3g}"
    if place.scale:
        by += f", {off / place.scale:.3g} standard errors"
    elif isinstance(frozen, float) and frozen and math.isfinite(off):
        by += f", {off / math.ulp(frozen):.0f} units of the last bit"
    yield Difference(path=place.path, frozen=repr(frozen), today=repr(today), by=by)


def _texts(frozen: Any, today: Any, place: _Place) -> Difference:
    sentence = isinstance(frozen, str) and isinstance(today, str)
    worded = sentence and (
        place.key == HELP or (place.key in SENTENCES and _NUMBER.findall(frozen) == _NUMBER.findall(today))
    )
    kind: Kind = "wording" if worded else "result"
    return Difference(path=place.path, frozen=_short(frozen), today=_short(today), kind=kind)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 300 else text[:297] + "..."
