"""A law without a name as an effect: what a diagnosis learned of structure that no effect explains.

Its name is its formula and how it acts, so that a model file, a worker and a fit mean the same by it:
``law adds: a*tanh([SA]/s)``. It acts on an output (``adds`` to it, ``multiplies`` it), ``scales`` what drives
a tire (its friction or its stiffness; a trail's law is one of MZ), or ``enters`` the equation of a state,
where it is taken from the state's rate. Signals are in the units of the recording: an applied law carries
the factor and zero by which its setting's SI values become those.

``a*tanh([SA]/s)`` has the signal SA and the parameters a and s. A formula comes from a file as well, so it
is read and never run: a tree of which only the arithmetic, the functions and the operators with a memory
that are listed here are evaluated.
"""

from __future__ import annotations

import ast
import cmath
import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np

from toolkit.effects.effect import Effect, EffectParameter
from toolkit.effects.facts import ChannelFacts, Term, Values
from toolkit.effects.filters import lag, play
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.arrays import Array

    Part = Callable[[Mapping[str, Any], Mapping[str, float], Any], Any]
    from toolkit.effects.signals import Drive, Setting, Tire


_LONGEST = 2_000  # characters: a formula that a person reads has fewer than a hundred
_LARGEST_POWER = 9
_LEAST = 0.05  # of a tire's friction or stiffness
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
Acts = Literal["adds", "multiplies", "enters", "scales friction", "scales stiffness"]
SCALED = {acts: acts.removeprefix("scales ") for acts in get_args(Acts) if acts.startswith("scales ")}
"""Of a law that scales a tire: the field of its `signals.Drive`."""
ITSELF = "itself"
"""The signal that is the channel or the state that a law acts on."""
POSITION = "position"
"""The signal, in an equation, of which the state that a law acts on is the rate."""
TIME = "time"
"""The signal that is the time of the run [s]."""
_NAME = re.compile(rf"law ({'|'.join(get_args(Acts))}): (.+)", re.DOTALL)
_POSITIVE = ("s", "w", "reach", "period", "tau", "frequency", "damping")


def _between(x: Array, low: float, high: float) -> Array:
    return np.asarray((x >= low) & (x <= high), dtype=np.float64)


def _spline(x: Any, *points: float) -> Any:
    """Return a natural cubic spline through (x1, y1, x2, y2, ...), constant beyond its ends.

    Nothing was recorded there, and a curve that goes on rising can drive an equation out of all bounds.
    """
    from scipy.interpolate import CubicSpline

    inside = np.clip(x, points[0], points[-2])
    heights = np.stack(np.broadcast_arrays(*points[1::2]))
    if heights.ndim == 1:
        return CubicSpline(points[0::2], heights, bc_type="natural")(inside)
    # Columns of several sets of parameters: a curve for each of the sets.
    sets, of = np.unique(heights, axis=1, return_inverse=True)
    inside, of = np.broadcast_arrays(inside, of.ravel())
    values = np.empty(inside.shape)
    for k in range(sets.shape[1]):
        values[of == k] = CubicSpline(points[0::2], sets[:, k], bc_type="natural")(inside[of == k])
    return values


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


def law_name(acts: Acts, text: str) -> str:
    """Return the name of a law."""
    return f"law {acts}: {text}"


def is_law(name: str) -> bool:
    """Tell whether an effect's name is that of a law."""
    return name.startswith("law ")


def parts_of(name: str) -> tuple[Acts, Formula]:
    """Return how a law acts, and its formula.

    Raises
    ------
    ConfigError
        ``law-formula``: the name is none of a law, or its formula cannot be read
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise ConfigError(
            "a law does not say how it acts", where=name[:200], got=name[:40],
            expected=" or ".join(f"'law {acts}: ...'" for acts in get_args(Acts)),
            next_step="take the law as a diagnosis has written it", rule="law-formula",
        )  # fmt: skip
    return cast("Acts", match[1]), formula(match[2])


def conversion(name: str, factor: float, zero: float) -> dict[str, float]:
    """Return the numbers of an applied law by which a signal's SI values become the recording's."""
    return {f"factor {name}": factor, f"zero {name}": zero}


@cache
def law_effect(name: str) -> Effect:
    """Return a law as an effect; its parameters have the units that are stated where it is applied.

    Raises
    ------
    ConfigError
        ``law-formula``: its formula cannot be read, remembers where it enters an equation, or reads what it
        scales
    """
    acts, law = parts_of(name)
    refused = {"enters": bool(law.functions & set(_WITH_MEMORY) - _OF_STATES)} | dict.fromkeys(
        SCALED, ITSELF in law.signals
    )
    if refused.get(acts):
        raise ConfigError(
            f"a law cannot act so: it {acts}", where=name[:200], got=law.plain(),
            expected="a formula of states, inputs and the time, that remembers as a lag or a mode does"
            if acts == "enters"
            else "a formula of recorded channels and the time",
            next_step="take the law as a diagnosis has written it", rule="law-formula",
        )  # fmt: skip

    def added(y: Array, values: Values, setting: Setting) -> Array:
        with np.errstate(all="ignore"):  # what is no number is told by whoever simulates
            change = np.asarray(law(_signals(law, y, values, setting), values, setting.t), dtype=np.float64)
        return y * (1 + change) if acts == "multiplies" else y + change

    def scaled(drive: Drive, values: Values, setting: Setting, _: Tire) -> Drive:
        with np.errstate(all="ignore"):
            change = law(_signals(law, drive.SA, values, setting), values, setting.t)
        before = getattr(drive, SCALED[acts])
        return replace(drive, **{SCALED[acts]: before * np.maximum(1 + change, _LEAST)})

    return Effect(
        name=name,
        stage="dynamics" if acts == "enters" else "tire" if acts in SCALED else "acquisition",
        rank=99,
        in_time=law.in_time,
        statement=_STATEMENTS[acts],
        equation=_EQUATIONS[acts].format(law.plain("y_model" if acts != "enters" else "x")),
        reference="learned from the recordings of its case",
        signature="",
        separates="",
        parameters=tuple(_parameter(parameter) for parameter in law.parameters),
        drive=scaled if acts in SCALED else None,
        channel=added if acts in ("adds", "multiplies") else None,
        on_channel=ChannelFacts(where=("output",), tare="own", by_value=ITSELF in law.signals)
        if acts in ("adds", "multiplies")
        else None,
        term=Term(of="state", law=law) if acts == "enters" else None,
    )


_STATEMENTS: dict[Acts, str] = {
    "adds": "A law without a name adds to the channel.",
    "multiplies": "A law without a name multiplies the channel.",
    "enters": "A law without a name is missing in the state's equation.",
    **{acts: f"A law without a name scales the tire's {of}." for acts, of in SCALED.items()},
}
_EQUATIONS: dict[Acts, str] = {
    "adds": "y = y_model + {}", "multiplies": "y = y_model * (1 + {})", "enters": "x' = ... - ({})",
    **{acts: of + " = 1 + {}" for acts, of in SCALED.items()},
}  # fmt: skip


def _parameter(name: str) -> EffectParameter:
    """Return a parameter: an amplitude by its first letter, a, else what shapes the law."""
    amplitude = name.startswith("a")
    return EffectParameter(
        name=name, unit="", text="amplitude" if amplitude else "shape", typical=(1.0, 1.0),
        off=0.0 if amplitude else None,
        bounds=(0.0, float("inf")) if name in _POSITIVE else (-float("inf"), float("inf")),
    )  # fmt: skip


def _signals(law: Formula, y: Array, values: Values, setting: Setting) -> dict[str, Array]:
    signals = {ITSELF: y, TIME: setting.t}
    for name in law.signals:
        if name in signals:
            continue
        column = setting.channel(name)
        if column is None:
            raise ConfigError(
                "a law needs a channel that was not recorded", where=law.plain(), got="no such channel",
                expected=name, next_step="give inputs with that channel", rule="model-place",
            )  # fmt: skip
        signals[name] = (column - values.get(f"zero {name}", 0.0)) / values.get(f"factor {name}", 1.0)
    return signals
