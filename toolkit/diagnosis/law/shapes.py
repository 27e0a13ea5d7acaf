"""The shapes that a law may have: formulas of one or two signals, with the starts of what shapes them.

The amplitude of every term has whatever unit the channel's and the signals' units ask for, and the argument
of a bent function is a ratio: a formula put together of them has consistent units by its construction.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from toolkit.diagnosis.policy import LAWS

if TYPE_CHECKING:
    from toolkit.arrays import Array

    Starts = Callable[[Array, Array], list[dict[str, float]]]

Form = Literal["static", "mode", "loop", "event", "tone"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """A formula with places ``{x}`` and ``{z}`` for its signals.

    ``units`` are those of its parameters, of ``{y}`` what the law acts on, ``{x}`` and ``{z}``;
    ``starts`` gives values of the parameters that shape it: (signal, time), each (rows,), to a list of them.
    ``about_zero`` says that the law depends on where its signals have their zero.
    """

    form: Form
    text: str
    units: Mapping[str, str]
    starts: Starts = lambda _, __: [{}]
    about_zero: bool = True


_BEND_AT = (0.15, 0.3, 0.5, 0.7, 0.85)  # of a signal's rows
_BENT = (0.05, 0.2, 0.6)  # of a signal's spread: over which a bend goes


def _spread(x: Array) -> float:
    low, high = np.quantile(x, (0.02, 0.98))
    return float(high - low) or float(np.abs(x).max()) or 1.0


def _bends(x: Array, _: Array) -> list[dict[str, float]]:
    spread = _spread(x)
    centres = [0.0, *np.quantile(x, (0.25, 0.5, 0.75)).tolist()]
    return [{"c": c, "s": s * spread} for c, s in itertools.product(centres, _BENT)]


def _limits(x: Array, _: Array) -> list[dict[str, float]]:
    return [{"s": share * _spread(x)} for share in _BENT]


def _bumps(x: Array, _: Array) -> list[dict[str, float]]:
    spread, centres = _spread(x), np.quantile(x, np.linspace(0.05, 0.95, 11))
    return [{"c": c, "w": w * spread} for c, w in itertools.product(centres.tolist(), (0.05, 0.2))]


def _thresholds(x: Array, _: Array) -> list[dict[str, float]]:
    return [{"c": c} for c in np.quantile(x, _BEND_AT).tolist()]


def _widths(x: Array, _: Array) -> list[dict[str, float]]:
    return [{"w": w} for w in np.quantile(np.abs(x), _BEND_AT).tolist() if w > 0]


def _growths(x: Array, _: Array) -> list[dict[str, float]]:
    spread = _spread(x)
    return [{"d": share * spread} for share in (0.3, 1.0, -0.3, -1.0)]


def _periods(x: Array, _: Array) -> list[dict[str, float]]:
    spread = _spread(x)
    return [{"period": spread / count} for count in (0.7, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0, 10.0)]


def _times(_: Array, t: Array) -> list[dict[str, float]]:
    steps = np.diff(t)
    steps = steps[steps > 0]
    row, duration = float(np.median(steps)), float(np.sum(steps))
    return [{"tau": tau} for tau in np.geomspace(2 * row, max(duration / 4, 4 * row), LAWS.times).tolist()]


def _modes(x: Array, t: Array) -> list[dict[str, float]]:
    times = [start["tau"] for start in _times(x, t)]
    frequencies = np.geomspace(0.5 / times[-1], 0.5 / times[0], 6 * LAWS.times)
    return [{"frequency": frequency, "damping": 0.07} for frequency in frequencies.tolist()]


def rung(frequency: float) -> list[dict[str, float]]:
    """Return the starts of a vibration near a frequency [Hz]."""
    return [{"frequency": frequency, "damping": damping} for damping in (0.02, 0.07, 0.3)]


def _reaches(x: Array, _: Array) -> list[dict[str, float]]:
    return [{"reach": share * _spread(x)} for share in (0.02, 0.1, 0.3)]


def _static(text: str, starts: Starts | None = None, *, about_zero: bool = True, **units: str) -> Shape:
    # A place c on the signal's own scale moves with its zero.
    return Shape(
        form="static", text=text, units=units, starts=starts or (lambda _, __: [{}]),
        about_zero=about_zero and "c" not in units,
    )  # fmt: skip


_TURN = "2*pi"
ONE: tuple[Shape, ...] = (
    _static("a*{x}", a="{y}/{x}"),
    _static("a*abs({x})", a="{y}/{x}"),
    _static("a*{x}**2", a="{y}/{x}^2"),
    _static("a*({x} - c)**2", _thresholds, a="{y}/{x}^2", c="{x}"),
    _static("a*{x}*abs({x})", a="{y}/{x}^2"),
    _static("a*{x}**3", a="{y}/{x}^3"),
    _static("a1 + a2*{x}", a1="{y}", a2="{y}/{x}"),
    _static("a1*{x} + a2*{x}**2", a1="{y}/{x}", a2="{y}/{x}^2"),
    _static("a1*{x} + a2*{x}**3", a1="{y}/{x}", a2="{y}/{x}^3"),
    _static("a*sqrt(abs({x}))", a="{y}/{x}^0.5"),
    _static("a*sign({x})", a="{y}"),
    _static("a*tanh(({x} - c)/s)", _bends, a="{y}", c="{x}", s="{x}"),
    _static("a*exp(-((({x} - c)/w)**2))", _bumps, a="{y}", c="{x}", w="{x}"),
    # A latch: the slope of a bump of energy pushes back before it and pulls on behind it.
    _static("a*({x} - c)*exp(-((({x} - c)/w)**2))", _bumps, a="{y}/{x}", c="{x}", w="{x}"),
    _static("a*exp({x}/d)", _growths, a="{y}", d="{x}"),
    _static("a*(exp({x}/d) - 1)", _growths, a="{y}", d="{x}"),
    _static(
        f"a1*sin({_TURN}*{{x}}/period) + a2*cos({_TURN}*{{x}}/period)", _periods, a1="{y}", a2="{y}",
        period="{x}",
    ),
    _static("a*max({x} - c, 0)", _thresholds, a="{y}/{x}", c="{x}"),
    _static("a*min({x} - c, 0)", _thresholds, a="{y}/{x}", c="{x}"),
    # What is beyond a limit, or outside of a dead zone, to either side.
    _static("a*(max({x} - w, 0) + min({x} + w, 0))", _widths, a="{y}/{x}", w="{x}"),
)  # fmt: skip
TWO: tuple[Shape, ...] = (
    _static("a*{x}*{z}", a="{y}/({x}*{z})"),
    _static("a*{x}*abs({z})", a="{y}/({x}*{z})"),
    _static("a*abs({x})*{z}", a="{y}/({x}*{z})"),
    _static("a*{x}**2*{z}", a="{y}/({x}^2*{z})"),
    _static("a*{x}*{z}**2", a="{y}/({x}*{z}^2)"),
)
EXCHANGE: tuple[Shape, ...] = (
    _static("a*({x} - {z})", about_zero=False, a="{y}/{x}"),
    _static("a*({x} - {z})*abs({x} - {z})", about_zero=False, a="{y}/{x}^2"),
    _static("a*sign({x} - {z})*sqrt(abs({x} - {z}))", about_zero=False, a="{y}/{x}^0.5"),
)
"""Shapes of how far two signals in one unit are apart: what passes between them."""
ALIKE: tuple[Shape, ...] = (
    *EXCHANGE,
    _static("a*({x} - {z})**3", about_zero=False, a="{y}/{x}^3"),
    _static("a*tanh(({x} - {z})/s)", _limits, about_zero=False, a="{y}", s="{x}"),
)
"""And what a spring does between them, or what follows one with the other and can do so only so fast."""
EACH: tuple[Shape, ...] = tuple(
    shape for shape in ONE if shape.text in {"a*{x}", "a*{x}*abs({x})", "a*{x}**3"}
)
"""Shapes of its own state that all equations of one kind may lack: losses, smooth and without a place.

What changes its sign at rest is friction, an effect of its own, and many times dearer to integrate.
"""
MODE = Shape(
    form="mode", text="a*mode({x}, frequency, damping)", starts=_modes,
    units={"a": "{y}/{x}", "frequency": "Hz", "damping": "1"},
)  # fmt: skip
REMEMBERING: tuple[Shape, ...] = (
    Shape(form="mode", text="a*lag({x}, tau)", units={"a": "{y}/{x}", "tau": "s"}, starts=_times),
    Shape(
        form="mode", text="a*({x} - lag({x}, tau))", units={"a": "{y}/{x}", "tau": "s"}, starts=_times,
        about_zero=False,
    ),
    MODE,
    Shape(
        form="loop", text="a*loop({x}, reach)", units={"a": "{y}", "reach": "{x}"}, starts=_reaches,
        about_zero=False,
    ),
)  # fmt: skip
BESIDE: tuple[Shape, ...] = (
    REMEMBERING[0],
    REMEMBERING[1],
    Shape(
        form="mode", text="a*({x} - mode({x}, frequency, damping))", starts=_modes, about_zero=False,
        units={"a": "{y}/{x}", "frequency": "Hz", "damping": "1"},
    ),
)  # fmt: skip
"""Shapes in the equation of a state: what follows a signal late, or swings beside it, and pulls at it."""


def remembering(*, timed: bool, ordered: bool) -> tuple[Shape, ...]:
    """Return the shapes with a memory: a loop remembers an order alone, all others how long ago."""
    return tuple(shape for shape in REMEMBERING if timed or (ordered and shape.form == "loop"))


TONE = Shape(
    form="tone", units={"a1": "{y}", "a2": "{y}", "frequency": "Hz"},
    text=f"a1*sin({_TURN}*frequency*[time]) + a2*cos({_TURN}*frequency*[time])",
)  # fmt: skip


def pulse(start: float, end: float, row: float) -> Shape:
    """Return an event in an equation: an input that is there for a while, with edges as long as a row [s]."""
    text = f"a*pulse([time], {start:.9g}, {end:.9g}, {row:.4g})"
    return Shape(form="event", text=text, units={"a": "{y}"})


UNLOCKED_TURN = Shape(
    form="tone", units={"a": "{y}", "period": "{x}", "phase": "rad"}, about_zero=False,
    text=f"a*sin({_TURN}*{{x}}/period + phase)",
)  # fmt: skip
"""A tone over an angle in place of time."""
UNLOCKED = Shape(    form="tone", units={"a": "{y}", "frequency": "Hz", "phase": "rad"},
    text=f"a*sin({_TURN}*frequency*[time] + phase)",
)  # fmt: skip


def curve(x: Array) -> Shape:
    """Return the curve of a signal without a formula: a natural spline through knots at its quantiles.

    Knots that are one as they are written are one: of a signal that hardly moves there are few.
    """
    quantiles = np.quantile(x, np.linspace(0.01, 0.99, LAWS.knots))
    knots = list(dict.fromkeys(f"{knot:.6g}" for knot in quantiles.tolist()))
    points = ", ".join(f"{knot}, a{i}" for i, knot in enumerate(knots, start=1))
    units = {f"a{i}": "{y}" for i in range(1, len(knots) + 1)}
    return Shape(form="static", text=f"spline({{x}}, {points})", units=units, about_zero=False)
