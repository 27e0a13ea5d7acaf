"""Values that are too many for the memory: JSON lines in a temporary file."""

from __future__ import annotations

import json
import tempfile
import weakref
from collections.abc import Iterator
from typing import Any


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
