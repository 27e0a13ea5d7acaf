"""What the files of an archive show together: copies, late edits, changed conventions, missing conditions.

It changes no grade; but for values that no tire has, it only informs. Files are added one by one, sorted by
path, as plain answers; what is kept of each is a few bytes.
"""

from __future__ import annotations

import json
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from toolkit.audit.effects import TestSums
from toolkit.findings import Finding, Level
from toolkit.reduction.physics import RULES

# Values that are too many for the memory: JSON lines in a temporary file.


class Lines:
    """Takes plain values one by one, and gives them again in that order as often as is asked."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  it lives as long as this object
        self._count = 0
        weakref.finalize(self, self._file.close)

    def add(self, value: dict[str, Any]) -> None:
        """Append a value that JSON can hold."""
        self.take(json.dumps(value).encode() + b"\n")

    def take(self, line: bytes) -> None:
        """Append a value as the line that `raw` yields for it."""
        self._file.seek(0, 2)
        self._file.write(line)
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (json.loads(line) for line in self.raw())

    def raw(self) -> Iterator[bytes]:
        """Yield every value as a line."""
        place = 0
        for _ in range(self._count):
            self._file.seek(place)
            line = self._file.readline()
            place += len(line)
            yield line

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Lines):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]


_LATE_DAYS = 1  # a file is often saved on the day after its test


@dataclass(slots=True, eq=False)
class Across:
    """Takes the files of an archive one by one."""

    tests: Lines = field(default_factory=Lines)
    _open: dict[str, TestSums] = field(default_factory=dict)
    _slopes: dict[tuple[str, str], list[tuple[str, int]]] = field(default_factory=dict)
    _first: dict[bytes, str] = field(default_factory=dict)
    _units: dict[str, Counter[tuple[tuple[str, str], ...]]] = field(default_factory=dict)
    _with: dict[tuple[tuple[str, str], ...], list[str]] = field(default_factory=dict)

    def add(self, line: Mapping[str, Any]) -> Iterator[Finding]:
        """Take a file and yield what can be said at once."""
        path = line["path"]
        for note in line["notes"]:
            yield noted(note, path)
        yield from self._copies(line)
        if line["units"]:
            units = tuple(sorted(line["units"].items()))
            self._units.setdefault(line["instrument"], Counter())[units] += 1
            if len(few := self._with.setdefault(units, [])) < 4:
                few.append(path)
        if line["date"] is not None and line["modified"] is not None:
            late = _days(line["modified"]) - _days(line["date"])
            if late > _LATE_DAYS:
                message = (
                    f"by its own properties the file was last saved on {line['modified']}, {late} days after "
                    f"the test of {line['date']}"
                )
                yield Finding(rule="edited-after-test", where=path, message=message, level="note")
        # Sorted by path, all files of a test's folder come in one stretch.
        for name in [name for name in self._open if name != "." and not path.startswith(name + "/")]:
            yield from self._closed(name)
        key = line["test"]
        if key is not None and line["date"] is not None and line["grade"] != "unreadable":
            if key not in self._open:
                self._open[key] = TestSums(
                    test=key,
                    instrument=line["instrument"],
                    date=line["date"],
                    own_protocol=line["own_protocol"],
                )
            self._open[key].add(line)

    def at_end(self) -> Iterator[Finding]:
        """Yield what only the whole archive can say."""
        for name in list(self._open):
            yield from self._closed(name)
        yield from self._conventions()
        for (instrument, rotation), signs in self._slopes.items():
            majority = 1 if sum(sign for _, sign in signs) >= 0 else -1
            against = [name for name, sign in signs if sign != majority]
            if len(against) >= len(signs) / 2:
                continue  # no convention to depart from
            usual, direction = ("rises", "falls") if majority > 0 else ("falls", "rises")
            for name in against:
                message = (
                    f"drum {rotation}: Fy {direction} with the slip angle, and {usual} in "
                    f"{len(signs) - len(against)} of {len(signs)} tests of {instrument}: an axis has another "
                    "sign here"
                )
                yield Finding(rule="axes-changed", where=name, message=message, level="note")

    def _closed(self, name: str) -> Iterator[Finding]:
        test = self._open.pop(name)
        yield from test.missing()
        for rotation, sign in test.slope_signs():
            self._slopes.setdefault((test.instrument, rotation), []).append((name, sign))
        self.tests.add(test.summary())

    def _copies(self, line: Mapping[str, Any]) -> Iterator[Finding]:
        reported = False
        for key, extent in ((line["sha256"], "byte for byte"), (line["values_sha256"], "in every number")):
            if key is None:
                continue
            short = bytes.fromhex(key[:32])
            first = self._first.setdefault(short, line["path"])
            if first != line["path"] and not reported:
                reported = True
                message = f"the same as {first}, {extent}"
                yield Finding(rule="duplicate-file", where=line["path"], message=message, level="note")

    def _conventions(self) -> Iterator[Finding]:
        for instrument, kinds in sorted(self._units.items()):
            usual = dict(kinds.most_common(1)[0][0])
            for units, count in kinds.items():
                differing = {
                    symbol: unit for symbol, unit in units if symbol in usual and usual[symbol] != unit
                }
                if differing:
                    text = ", ".join(f"{s} in {unit} for {usual[s]}" for s, unit in differing.items())
                    paths = self._with[units]
                    message = (
                        f"{text}: {count} file{'s' if count > 1 else ''} of {instrument}, such as {paths[0]}"
                    )
                    yield Finding(rule="units-changed", where=paths[0], message=message, level="note")


def noted(note: Mapping[str, str], path: str) -> Finding:
    """Return what a file's rows show, from its plain answer: it informs, but for what no tire can do."""
    level: Level = "error" if note["rule"] in RULES else "note"
    return Finding(rule=note["rule"], where=path, message=note["message"], level=level)


def _days(text: str) -> int:
    import datetime as dt

    return dt.date.fromisoformat(text).toordinal()
