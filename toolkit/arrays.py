"""The array that every computation is given and returns: float64, in SI."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

Array: TypeAlias = NDArray[np.float64]
"""Numbers in SI units; shapes stand in the docstrings."""

Arrays: TypeAlias = dict[str, Array]
"""Arrays by the names of what they hold: columns of a run, outputs of a simulation."""


def taken(table: T, index: Any, *, last: bool = False) -> T:
    """Return a dataclass with its arrays at an index or mask of their first axis, or of their last one."""
    names = [field.name for field in dataclasses.fields(cast("Any", table))]
    arrays = {name: held for name in names if isinstance(held := getattr(table, name), np.ndarray)}
    parts = {name: held[..., index] if last else held[index] for name, held in arrays.items()}
    return cast("T", dataclasses.replace(cast("Any", table), **parts))
