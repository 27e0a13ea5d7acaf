"""The array that every computation is given and returns: float64, in SI."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
Asked = TypeVar("Asked", bound=Callable[..., Any])

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


def kept_of_the_same(most: int) -> Callable[[Asked], Asked]:
    """Return a decorator that keeps the last results of a function, for who asks with the very same objects.

    Of arrays that nobody changes: to compare them would take as long as many an answer.
    """

    def keeping(function: Asked) -> Asked:
        kept: dict[tuple[int, ...], tuple[tuple[Any, ...], Any]] = {}  # an object that is kept keeps its id

        @functools.wraps(function)
        def asked(*given: Any) -> Any:
            key = tuple(map(id, given))
            if key not in kept:
                made = function(*given)
                while len(kept) >= most:
                    del kept[next(iter(kept))]
                kept[key] = given, made
            return kept[key][1]

        return cast("Asked", asked)

    return keeping
