"""What a simulation has computed, kept for who asks for the same again, within a limit of bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

if TYPE_CHECKING:
    from toolkit.arrays import Array

T = TypeVar("T", bound="Array | Mapping[str, Array] | Exception")


class Memory(Generic[T]):
    """Arrays, tables of them or the errors in their place, by what they were computed from.

    The oldest go where more than ``most`` are kept, or more than ``most_bytes``.
    """

    def __init__(self, most: int, most_bytes: int) -> None:
        self._most, self._most_bytes, self._bytes = most, most_bytes, 0
        self._kept: dict[Any, T] = {}

    def __contains__(self, key: Any) -> bool:
        """Tell whether something is kept."""
        return key in self._kept

    def __getitem__(self, key: Any) -> T:
        """Return what is kept."""
        return self._kept[key]

    def __setitem__(self, key: Any, value: T) -> None:
        """Keep something."""
        if key in self._kept:
            self._bytes -= _bytes(self._kept.pop(key))
        self._kept[key] = value
        self._bytes += _bytes(value)
        while len(self._kept) > 1 and (len(self._kept) > self._most or self._bytes > self._most_bytes):
            self._bytes -= _bytes(self._kept.pop(next(iter(self._kept))))


def _bytes(value: object) -> int:
    if isinstance(value, Mapping):
        return sum(column.nbytes for column in value.values())
    return value.nbytes if isinstance(value, np.ndarray) else 0
