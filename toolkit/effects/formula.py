"""A formula of signals and parameters: read from its text and never run, evaluated on rows or in an equation.

``a*tanh([SA]/s)`` has the signal SA and the parameters a and s. A formula comes from a file as well, so it
is a tree of which only the arithmetic, the functions and the operators with a memory that are listed here
are evaluated. On rows an operator with a memory goes along the time; in an equation it has states of its own.
"""

from __future__ import annotations

import ast
import cmath
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.arrays import kept_of_the_same
from toolkit.effects.filters import lag, play
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

    from toolkit.arrays import Array

    Part = Callable[[Mapping[str, Any], Mapping[str, float], Any], Any]

_LONGEST = 2_000  # characters: a formula that a person reads has fewer than a hundred
_LARGEST_POWER = 9
_SHORTEST = 1e-12  # of a lag [s]
_SIGNAL = re.compile(r"\[([^\[\]]+)\]")
_INSIDE = "__"  # what stands for a bracket while Python's parser reads the rest; no parameter begins so
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}  # fmt: skip
_STATIC: dict[str, Callable[..., Any]] = {
    "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "tanh": np.tanh, "sin": np.sin,
    "cos": np.cos, "max": np.maximum, "min": np.minimum,
}  # fmt: skip


def _between(x: Array, low: float, high: float) -> Array:
    return np.asarray((x >= low) & (x <= high), dtype=np.float64)


def _spline(x: Any, *points: Any) -> Any:
    """Return a natural cubic spline through (x1, y1, x2, y2, ...), constant beyond its ends.

    Nothing was recorded there, and a curve that goes on rising can drive an equation out of all bounds.
    """
    inside = np.clip(x, points[0], points[-2])
    if not any(map(np.ndim, points[1::2])):
        return _curve(tuple(map(float, points)))(inside)
    # Columns of several sets of parameters: a curve for each. As a piece of a curve is evaluated by itself.
    knots, pieces = _pieces(*points)
    inside, column = np.broadcast_arrays(inside, np.arange(pieces.shape[2]))
    at = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    off, piece = inside - knots[at], pieces[:, at, column]
    square = off * off
    return piece[3] + piece[2] * off + piece[1] * square + piece[0] * (square * off)


@lru_cache(maxsize=8)
def _curve(points: tuple[float, ...]) -> CubicSpline:
    from scipy.interpolate import CubicSpline

    return CubicSpline(points[0::2], points[1::2], bc_type="natural")


@kept_of_the_same(4)  # an equation asks at every step
def _pieces(*points: Any) -> tuple[Array, Array]:
    """Return the knots of curves and their coefficients, (4, pieces, columns)."""
    from scipy.interpolate import CubicSpline

    heights = np.stack(np.broadcast_arrays(*points[1::2]))
    drawn = CubicSpline(points[0::2], heights, bc_type="natural")
    return np.asarray(drawn.x), np.asarray(drawn.c)


def _pulse(x: Any, start: Any, end: Any, edge: Any) -> Any:
    """Return one from ``start`` to ``end`` and zero elsewhere, with edges that an integrator can follow."""
    return 0.5 * (np.tanh((x - start) / edge) - np.tanh((x - end) / edge))


_STATIC |= {"between": _between, "spline": _spline, "pulse": _pulse}


def _rate(t: Array, x: Array) -> Array:
    return np.gradient(x, t) if len(t) > 1 else np.zeros(len(t))


def _mode(t: Array, x: Array, frequency: float, damping: float) -> Array:
    """Return a vibration that a signal drives, of unit gain at rest: y'' + 2 D w y' + w^2 y = w^2 x.

    Its two poles are a filter of first order each, exact for a signal that is linear between rows.
    """
    from scipy.signal import lfilter

    if len(t) < 3:
        return x
    # One that takes a thousand times as long as the rows last stands still in them.
    frequency = max(frequency, 1e-3 / float(t[-1] - t[0]))
    # Fine enough for the vibration as for the rows.
    step = min(float(np.median(np.diff(t))), 0.1 / frequency)
    even = np.arange(t[0], t[-1] + step, step)
    driven = np.interp(even, t, x)
    w = 2 * math.pi * frequency
    apart = cmath.sqrt(damping**2 - 1) or 1e-6  # at the aperiodic limit the poles are one
    first, second = w * (-damping + apart), w * (-damping - apart)
    answered = np.zeros(len(even), dtype=complex)
    for sign, pole in ((1, first), (-1, second)):
        turn = cmath.exp(pole * step)
        # z' = pole z + x over a step on which x is a straight line
        ahead = (turn - 1 - pole * step) / (pole**2 * step)
        drive = (turn - 1) / pole * driven[:-1] + ahead * np.diff(driven)
        begin = -driven[0] / pole
        z, _ = lfilter([1.0], [1.0, -turn], drive, zi=np.array([turn * begin]))
        answered += sign * np.concatenate([[begin], z])
    return np.asarray(np.interp(t, even, (w**2 / (first - second) * answered).real))


def way(t: Array, x: Array) -> Array:
    """Return the integral of a signal over the time from the first row on: the way of a speed."""
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (x[1:] + x[:-1]))])


def _loop(_: Array, x: Array, reach: float) -> Array:
    """Return the stop operator over its height: -1 to 1, turned round within ``reach`` to either side."""
    return (x - play(x, 2 * reach)) / reach


_WITH_MEMORY: dict[str, Callable[..., Any]] = {
    "lag": lag, "rate": _rate, "mode": _mode, "loop": _loop, "way": way,
}  # fmt: skip
_OF_STATES = frozenset({"lag", "mode"})
"""What remembers by states of its own, as an equation can have them."""


@dataclass(frozen=True, slots=True, eq=False)
class Remembered:
    """An operator with a memory in an equation: states of its own, of which the first is its value.

    ``key`` is the signal by which its formula reads that value; ``argument`` and ``shape`` are what it
    follows and the parameters by which it does.
    """

    key: str
    function: str
    argument: Part
    shape: tuple[Part, ...]

    @property
    def states(self) -> int:
        """How many they are."""
        return {"lag": 1, "mode": 2}[self.function]

    def start(self, signals: Mapping[str, Any], values: Mapping[str, float]) -> list[Any]:
        """Return the states at rest with what they follow."""
        return [self.argument(signals, values, None), 0.0][: self.states]

    def sizes(self, of: float, values: Mapping[str, float]) -> list[float]:
        """Return sizes of its states by that of what they follow."""
        if self.function == "lag":
            return [of]
        return [of, of * 2 * math.pi * float(np.max(self.shape[0]({}, values, None)))]

    def rates(self, own: Array, signals: Mapping[str, Any], values: Mapping[str, float]) -> list[Any]:
        """Return the rates of its states, which are (states, ...)."""
        away = self.argument(signals, values, None) - own[0]
        shape = [part(signals, values, None) for part in self.shape]
        if self.function == "lag":
            return [away / np.maximum(shape[0], _SHORTEST)]
        frequency, damping = shape
        w = 2 * math.pi * frequency
        return [own[1], w * (w * away - 2 * damping * own[1])]


@dataclass(frozen=True, slots=True, eq=False)
class Formula:
    """A formula that was read: its text, signals and parameters in their order, and what it remembers."""

    text: str
    signals: tuple[str, ...]
    parameters: tuple[str, ...]
    functions: frozenset[str]
    whole: Part
    remembered: tuple[Remembered, ...] = ()

    @property
    def by_states(self) -> bool:
        """Tell whether an equation can remember as it does, by states of its own."""
        return not self.functions & set(_WITH_MEMORY) - _OF_STATES

    @property
    def in_time(self) -> bool:
        """Tell whether time passes in it."""
        return "time" in self.signals or bool(self.functions & {"lag", "rate", "mode", "way"})

    def plain(self, itself: str | None = None) -> str:
        """Return it as people read it: without brackets, what it acts on by its name.

        >>> formula("a*[itself]*tanh([SA]/s)").plain("FY")
        'a*FY*tanh(SA/s)'
        """
        return _SIGNAL.sub(
            lambda found: (itself or found[1]) if found[1] == "itself" else found[1], self.text
        )

    def __call__(
        self, signals: Mapping[str, Any], values: Mapping[str, float], t: Array | None = None
    ) -> Any:
        """Return its value at signals of one shape.

        Where it remembers, ``t`` [s] is needed, or among the signals the values of what it remembers.
        """
        return self.whole(signals, values, t)


def _part(node: ast.expr, listed: tuple[str, ...], remembered: list[Remembered]) -> Part:
    """Return a part of a formula as a function of signals, parameters and time: an equation asks it often.

    What has a memory is added to ``remembered``.
    """
    if isinstance(node, ast.Constant):
        number = node.value
        return lambda _, __, ___: number
    if isinstance(node, ast.Name):
        name = node.id
        if name.startswith(_INSIDE):
            signal = listed[int(name.removeprefix(_INSIDE))]
            return lambda signals, _, __: signals[signal]
        return (lambda _, __, ___: math.pi) if name == "pi" else (lambda _, values, __: values[name])
    if isinstance(node, ast.UnaryOp):
        positive = _part(node.operand, listed, remembered)
        return lambda signals, values, t: -positive(signals, values, t)
    if isinstance(node, ast.BinOp):
        combined = _BINARY[type(node.op)]
        left, right = (_part(side, listed, remembered) for side in (node.left, node.right))
        return lambda signals, values, t: combined(left(signals, values, t), right(signals, values, t))
    assert isinstance(node, ast.Call)  # noqa: S101  `formula` lets nothing else pass
    assert isinstance(node.func, ast.Name)  # noqa: S101
    called, parts = node.func.id, [_part(argument, listed, remembered) for argument in node.args]
    if called in _WITH_MEMORY:
        remembering, key = _WITH_MEMORY[called], f"{called} {len(remembered)}"
        remembered.append(Remembered(key, called, parts[0], tuple(parts[1:])))

        def recalled(signals: Mapping[str, Any], values: Mapping[str, float], t: Any) -> Any:
            if key in signals:
                return signals[key]
            return remembering(t, *(part(signals, values, t) for part in parts))

        return recalled
    function = _STATIC[called]
    return lambda signals, values, t: function(*(part(signals, values, t) for part in parts))


@cache
def formula(text: str) -> Formula:
    """Return a formula.

    Raises
    ------
    ConfigError
        ``law-formula``: it is none, or uses what a law cannot
    """
    if len(text) > _LONGEST:
        raise _wrong(text, f"{len(text)} characters", f"at most {_LONGEST}")
    listed = tuple(dict.fromkeys(_SIGNAL.findall(text)))
    if _INSIDE in _SIGNAL.sub("", text):
        raise _wrong(text, _INSIDE, "parameters that begin with a letter")
    source = _SIGNAL.sub(lambda found: f"({_INSIDE}{listed.index(found[1])})", text)
    try:
        tree = ast.parse(source.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        raise _wrong(text, str(error), "an expression") from error
    functions, parameters = set[str](), dict[str, None]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            functions.add(node.func.id)
    unknown = functions - set(_STATIC) - set(_WITH_MEMORY)
    if unknown:
        raise _wrong(text, ", ".join(sorted(unknown)), ", ".join([*_STATIC, *_WITH_MEMORY]))
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Name)
            and node.id not in (*functions, "pi")
            and not node.id.startswith(_INSIDE)
        ):
            parameters[node.id] = None
    _check(tree, text)
    ordered = sorted(parameters, key=lambda name: re.search(rf"\b{name}\b", source).start())  # type: ignore[union-attr]
    remembered: list[Remembered] = []
    whole = _part(tree, listed, remembered)
    return Formula(text, listed, tuple(ordered), frozenset(functions), whole, tuple(remembered))


def _check(node: ast.AST, text: str) -> None:
    """Refuse every part that is none of a law's."""
    if isinstance(node, ast.BinOp):
        allowed = type(node.op) in _BINARY
        if isinstance(node.op, ast.Pow):  # a power is a number: of a tower of them nothing comes to an end
            power = node.right.operand if isinstance(node.right, ast.UnaryOp) else node.right
            value = power.value if isinstance(power, ast.Constant) else None
            allowed = isinstance(value, int | float) and 0 < value <= _LARGEST_POWER
        parts: list[ast.AST] = [node.left, node.right]
    elif isinstance(node, ast.UnaryOp):
        allowed, parts = isinstance(node.op, ast.USub), [node.operand]
    elif isinstance(node, ast.Call):
        allowed, parts = isinstance(node.func, ast.Name) and not node.keywords, list(node.args)
    else:
        allowed = isinstance(node, ast.Name) or (
            isinstance(node, ast.Constant) and type(node.value) in (int, float)
        )
        parts = []
    if not allowed:
        raise _wrong(text, ast.unparse(node), "+ - * / **, numbers, parameters, [signals] and functions")
    for part in parts:
        _check(part, text)


def _wrong(text: str, got: str, expected: str) -> ConfigError:
    return ConfigError(
        "a law's formula cannot be read", where=text[:200], got=got, expected=expected,
        next_step="take the formula as a diagnosis has written it", rule="law-formula",
    )  # fmt: skip
