"""Quantities that record what is done with them: an evaluation in numpy becomes a list of steps.

A function is called with `Recorded` quantities in the place of arrays. What numpy does with them is written
down, equal steps once, and no number is computed. The `Program` is what was written: it can be replayed on
arrays, and written in another language, and no equation stands twice. A function that decides by a number of
its quantities has no such list: it is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, cast

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import ArrayLike, NDArray

from toolkit.arrays import Array

CONSTANT, QUANTITY, WHERE = "constant", "quantity", "where"


class NotRecordedError(Exception):
    """A number of a quantity is asked for, or a function that cannot be written down.

    ``quantities`` are the names of those that the number depends on; none where it is a function.
    """

    def __init__(self, message: str, quantities: frozenset[str] = frozenset()) -> None:
        super().__init__(message)
        self.quantities = quantities


@dataclass(frozen=True, slots=True)
class Step:
    """One step: a constant's ``number``, a quantity's ``name``, or an ``operation`` on earlier steps.

    ``operation`` is the name of a ufunc of numpy, ``where``, ``constant`` or ``quantity``.
    """

    operation: str
    arguments: tuple[int, ...] = ()
    number: float = 0.0
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Program:
    """Steps in their order, and the step of each result by its name."""

    steps: tuple[Step, ...]
    results: tuple[tuple[str, int], ...]

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities that the results depend on."""
        return tuple(step.name for step in self.steps if step.operation == QUANTITY)

    def needed(self, result: str) -> frozenset[str]:
        """Return the names of the quantities that one result depends on."""
        needed = _ancestors(self.steps, [dict(self.results)[result]])
        return frozenset(self.steps[number].name for number in needed if self.steps[number].name)

    def replay(self, quantities: Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Return the results by name at arrays of the quantities, which broadcast."""
        values: list[Any] = []
        for step in self.steps:
            if step.operation == CONSTANT:
                values.append(np.float64(step.number))
            elif step.operation == QUANTITY:
                values.append(np.asarray(quantities[step.name], dtype=np.float64))
            else:
                function = np.where if step.operation == WHERE else getattr(np, step.operation)
                values.append(function(*(values[argument] for argument in step.arguments)))
        return {name: np.asarray(values[number], dtype=np.float64) for name, number in self.results}


def record(function: Callable[[Mapping[str, Any]], Mapping[str, Any]], quantities: Sequence[str]) -> Program:
    """Return the program of a function that is given quantities by name and returns results by name.

    Raises
    ------
    NotRecordedError
        the function decides by a number, or calls what is not recorded
    """
    tape = _Tape()
    results = function({name: tape.quantity(name) for name in quantities})
    numbers = {name: tape.scalar(value) for name, value in results.items()}
    alive = sorted(_ancestors(tape.steps, list(numbers.values())))
    place = {number: index for index, number in enumerate(alive)}
    steps = tuple(
        Step(
            step.operation,
            tuple(place[argument] for argument in step.arguments),
            number=step.number,
            name=step.name,
        )
        for step in (tape.steps[number] for number in alive)
    )
    return Program(steps=steps, results=tuple((name, place[number]) for name, number in numbers.items()))


def as_array(values: Any, dtype: type[np.float64] | None = None) -> Array:
    """Return values as an array; what is recorded stays as it is.

    >>> float(as_array(2, np.float64))
    2.0
    """
    return cast("Array", values) if isinstance(values, Recorded) else np.asarray(values, dtype=dtype)


def may_differ_from_zero(values: Any) -> bool:
    """Tell whether any of the values is not zero; a recorded quantity may be anything."""
    return isinstance(values, Recorded) or bool(np.any(values))


class Recorded(NDArrayOperatorsMixin):
    """Quantities of any shape, each the number of a step on a tape."""

    __slots__ = ("numbers", "tape")

    def __init__(self, tape: _Tape, numbers: NDArray[np.intp]) -> None:
        self.tape, self.numbers = tape, numbers

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the quantities."""
        return self.numbers.shape

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Recorded:
        if method == "__call__" and not options:
            return self.tape.apply(ufunc.__name__, inputs)
        if method == "reduce" and ufunc is np.add and isinstance(inputs[0], Recorded):
            return _summed(inputs[0], options.pop("axis", 0))
        raise NotRecordedError(f"numpy.{ufunc.__name__}.{method} is not recorded")

    def __array_function__(
        self, function: Callable[..., Any], _types: Any, arguments: Any, options: Any
    ) -> Any:
        own = _FUNCTIONS.get(function.__name__)
        if own is None:
            raise NotRecordedError(f"numpy.{function.__name__} is not recorded")
        return own(self.tape, *arguments, **options)

    def __getitem__(self, place: Any) -> Recorded:
        return Recorded(self.tape, np.asarray(self.numbers[place]))

    def sum(self, axis: int) -> Recorded:
        """Return the sum along an axis."""
        return _summed(self, axis)

    def _refuse(self, *_: Any) -> NoReturn:
        numbers = [int(number) for number in np.ravel(self.numbers)]
        names = frozenset(self.tape.steps[number].name for number in _ancestors(self.tape.steps, numbers)) - {
            ""
        }
        raise NotRecordedError("the equations go on by a number that is known only when they run", names)

    __bool__ = __float__ = __int__ = __index__ = __array__ = __iter__ = __len__ = _refuse


class _Tape:
    """Steps as they are recorded; equal ones stand once."""

    def __init__(self) -> None:
        self.steps: list[Step] = []
        self._numbers: dict[Step, int] = {}

    def quantity(self, name: str) -> Recorded:
        return Recorded(self, np.asarray(self._number(Step(QUANTITY, name=name))))

    def scalar(self, value: Any) -> int:
        numbers = self.numbers(value)
        if numbers.size != 1:
            raise NotRecordedError(f"a result has {numbers.size} numbers")
        return int(numbers.ravel()[0])

    def numbers(self, value: Any) -> NDArray[np.intp]:
        if isinstance(value, Recorded):
            return value.numbers
        constants = np.asarray(value, dtype=np.float64)
        listed = [self._number(Step(CONSTANT, number=float(entry))) for entry in constants.ravel()]
        return np.array(listed, dtype=np.intp).reshape(constants.shape)

    def apply(self, operation: str, inputs: Sequence[Any]) -> Recorded:
        arrays = np.broadcast_arrays(*(self.numbers(value) for value in inputs))
        rows = zip(*(array.ravel().tolist() for array in arrays), strict=True)
        listed = [self._number(Step(operation, arguments)) for arguments in rows]
        return Recorded(self, np.array(listed, dtype=np.intp).reshape(arrays[0].shape))

    def _number(self, step: Step) -> int:
        # 0.0 and -0.0 are equal and not the same: a sign is copied from them.
        key = step if step.number or not np.signbit(step.number) else Step(CONSTANT, name="-0")
        if key not in self._numbers:
            self._numbers[key] = len(self.steps)
            self.steps.append(step)
        return self._numbers[key]


def _ancestors(steps: Sequence[Step], numbers: Sequence[int]) -> set[int]:
    found, waiting = set(numbers), list(numbers)
    while waiting:
        earlier = set(steps[waiting.pop()].arguments) - found
        found |= earlier
        waiting.extend(earlier)
    return found


def _summed(values: Recorded, axis: Any) -> Recorded:
    # One after the other: numpy adds in pairs where there are many, which differs in the last digit.
    rows = np.moveaxis(values.numbers, cast("int", axis), 0)
    total = Recorded(values.tape, np.asarray(rows[0]))
    for row in rows[1:]:
        total = values.tape.apply("add", (total, Recorded(values.tape, np.asarray(row))))
    return total


def _where(tape: _Tape, condition: Any, chosen: Any, other: Any) -> Recorded:
    return tape.apply(WHERE, (condition, chosen, other))


def _clip(tape: _Tape, values: Any, low: Any, high: Any) -> Recorded:
    return tape.apply("minimum", (tape.apply("maximum", (values, low)), high))


def _zeros_like(_tape: _Tape, values: Recorded) -> Array:
    return np.zeros(values.shape)


def _broadcast_arrays(tape: _Tape, *values: Any) -> tuple[Recorded, ...]:
    arrays = np.broadcast_arrays(*(tape.numbers(value) for value in values))
    return tuple(Recorded(tape, array) for array in arrays)


def _concatenate(tape: _Tape, values: Sequence[Any], axis: int = 0) -> Recorded:
    return Recorded(tape, np.concatenate([tape.numbers(value) for value in values], axis=axis))


_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "where": _where,
    "clip": _clip,
    "zeros_like": _zeros_like,
    "broadcast_arrays": _broadcast_arrays,
    "concatenate": _concatenate,
}
