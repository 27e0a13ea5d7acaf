"""An equation's functions for many states at a time: a column for each row and each set of parameters.

What is written with numpy takes columns of states as it takes one state, and the price of a call hardly
grows with their number. What asks a question of a value (``if``, ``max``) is put it for all columns; where
they answer differently, the columns are parted and each part goes its own way. What calls `math` is given
numpy's function of the same name. Whether the columns come out as one by one is tried before it is trusted.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array

    # (t (m,), states (n, m), inputs, parameters) -> rows of results, (k, m)
    Columnwise = Callable[[Array, Array, Mapping[str, Array], Mapping[str, Array]], Array]
    # (function, time, state, inputs, parameters) -> its results
    Ask = Callable[[Callable[..., Any], Any, Any, Any, Any], Sequence[Any]]

_SAME = 1e-12
_PARTS = 2_000  # of one call: more ways through a function than that are none of an equation
_NUMPY = {
    "acos": np.arccos, "asin": np.arcsin, "atan": np.arctan, "atan2": np.arctan2, "acosh": np.arccosh,
    "asinh": np.arcsinh, "atanh": np.arctanh, "pow": np.power, "dist": None,
}  # fmt: skip


class _PartedError(BaseException):
    """Columns answer a question differently; no simulator's own ``except Exception`` takes it."""

    def __init__(self, mask: NDArray[np.bool_]) -> None:
        super().__init__()
        self.mask = mask


class _Asked(np.ndarray):
    """Columns of numbers; a question that they answer differently parts them."""

    def __bool__(self) -> bool:
        answers = np.asarray(self, dtype=bool)
        if answers.all():
            return True
        if not answers.any():
            return False
        raise _PartedError(answers)


def stacked(results: Any, columns: int) -> Array:
    """Return the results of a function as rows of columns, a constant one in every column."""
    if isinstance(results, np.ndarray) and results.ndim == 2:
        return np.asarray(results, dtype=np.float64)
    rows = np.empty((len(results), columns))
    for i, row in enumerate(results):
        rows[i] = row
    return rows


def columnwise(
    function: Callable[..., Any],
    ask: Ask,
    t: Array,
    x: Array,
    u: Mapping[str, Array],
    p: Mapping[str, Array],
) -> Columnwise | None:
    """Return the function for columns, None where it gives for these not what it gives for each alone.

    Parameters
    ----------
    function : of a case's file
    ask : how it is asked for its results
    t, x, u, p : columns on which it is tried, (m,), (n, m), each (m,)
    """
    count = x.shape[1]
    try:
        alone = np.stack(
            [
                np.asarray(
                    ask(
                        function,
                        float(t[k]),
                        x[:, k].copy(),
                        {name: float(column[k]) for name, column in u.items()},
                        {name: float(column[k]) for name, column in p.items()},
                    ),
                    dtype=np.float64,
                )
                for k in range(count)
            ],
            axis=1,
        )
    except Exception:  # noqa: BLE001 - whatever a user's code raises: the same state alone raises it by name
        return None

    with_numpy = _with_numpy(function)
    ways = (
        _whole(function, ask), _whole(with_numpy, ask), _parted(function, ask), _parted(with_numpy, ask)
    )  # fmt: skip
    for way in ways:
        try:
            together = way(t, x.copy(), u, p)
        except Exception:  # noqa: BLE001, S112 - it does not take columns in this way
            continue
        if together.shape == alone.shape and np.allclose(together, alone, rtol=_SAME, atol=0, equal_nan=True):
            return way
    return None


def _whole(function: Callable[..., Any], ask: Ask) -> Columnwise:
    def call(t: Array, x: Array, u: Mapping[str, Array], p: Mapping[str, Array]) -> Array:
        return stacked(ask(function, t, x, dict(u), dict(p)), x.shape[1])

    return call


def _parted(function: Callable[..., Any], ask: Ask) -> Columnwise:
    def call(t: Array, x: Array, u: Mapping[str, Array], p: Mapping[str, Array]) -> Array:
        count = x.shape[1]
        results: Array | None = None
        pending = [np.arange(count)]
        for _ in range(_PARTS):
            if not pending:
                break
            at = pending.pop()

            def asked(values: Array, at: NDArray[np.intp] = at) -> Any:
                return values[..., at].view(_Asked)

            try:
                part = stacked(
                    ask(
                        function, asked(t), asked(x), {name: asked(column) for name, column in u.items()},
                        {name: asked(column) for name, column in p.items()},
                    ),
                    len(at),
                )  # fmt: skip
            except _PartedError as parted:
                mask = parted.mask
                if mask.shape != at.shape:
                    raise TypeError("a question of several states at once") from None
                pending += [at[mask], at[~mask]]
                continue
            if results is None:
                results = np.empty((len(part), count))
            results[:, at] = part
        if pending or results is None:
            raise TypeError("too many ways through the function")
        return results

    return call


def _with_numpy(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function, and those of its file that it calls, with numpy's functions in place of math's."""
    if not isinstance(function, types.FunctionType):
        return function
    shim = types.SimpleNamespace(**{name: _numpy(name, value) for name, value in vars(math).items()})
    space: dict[str, Any] = {}

    def put(value: Any) -> Any:
        if value is math:
            return shim
        if isinstance(value, types.BuiltinFunctionType) and any(
            value is other for other in vars(math).values()
        ):
            return _numpy(str(value.__name__), value)
        if isinstance(value, types.FunctionType) and value.__globals__ is function.__globals__:
            return _in(value, space)
        return value

    space.update({name: put(value) for name, value in function.__globals__.items()})
    space["float"] = _number
    if function.__closure__:
        return function
    return _in(function, space)


def _in(function: types.FunctionType, space: dict[str, Any]) -> types.FunctionType:
    moved = types.FunctionType(
        function.__code__, space, function.__name__, function.__defaults__, function.__closure__
    )
    moved.__kwdefaults__ = function.__kwdefaults__
    return moved


def _number(value: Any) -> Any:
    return value if isinstance(value, np.ndarray) and value.ndim else float(value)


def _numpy(name: str, value: Any) -> Any:
    if not callable(value):
        return value
    return _NUMPY.get(name, getattr(np, name, value))
