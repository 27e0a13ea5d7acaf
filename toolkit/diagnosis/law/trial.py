"""One law at one place from one start: what a search for laws tries."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.law.shapes import Form, Shape
from toolkit.diagnosis.simulators.parameter_units import channel_unit, reduced
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.law import ITSELF, Acts, conversion, law_effect, law_name
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.problem import Problem

    Array = NDArray[np.float64]
    Stacked = dict[str, Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """What a law may depend on: how a formula writes it, its channel, its unit, and its recorded values.

    ``steady`` signals are recorded or simulated values themselves, no rates: of these two make a product.
    """

    written: str
    name: str
    unit: str
    values: Array = field(compare=False)
    steady: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """One law at one place from one start, with its linearised gain of twice the log-likelihood.

    ``unit`` is that of what it adds, or of its factor. ``looked`` counts the laws that were looked at to find
    it: its p-value is among as many.
    """

    shape: Shape
    signals: tuple[Signal, ...]
    applied: AppliedEffect
    acts: Acts
    unit: str
    gain: float = 0.0
    looked: int = 1

    @property
    def form(self) -> Form:
        """Its family."""
        return self.shape.form

    @property
    def place(self) -> tuple[object, ...]:
        """What tells laws apart that differ by more than where they start."""
        return self.applied.key

    @property
    def cost(self) -> int:
        """Number of its parameters."""
        return len(self.applied.effect.parameters)


def amplitudes(applied: AppliedEffect) -> tuple[str, ...]:
    """Return the parameters in proportion to which a law is."""
    return tuple(parameter.name for parameter in applied.effect.parameters if parameter.off is not None)


def started(
    problem: Problem, shape: Shape, signals: tuple[Signal, ...], acts: Acts, channel: str, *, force: str = ""
) -> Iterator[Trial]:
    """Give a law at every start of what shapes it; ``force`` is the unit of what enters an equation."""
    t = np.concatenate([run.t for run in problem.runs]) if problem.case.has_time else np.arange(2.0)
    for start in shape.starts(signals[0].values, t):
        yield trial_at(problem, shape, signals, acts, channel, start, force=force)


def trial_at(
    problem: Problem, shape: Shape, signals: tuple[Signal, ...], acts: Acts, channel: str,
    start: Mapping[str, float], *, force: str = "",
) -> Trial:  # fmt: skip
    """Return a law at one start, the amplitudes zero; ``force`` is the unit of what enters an equation."""
    case = problem.case
    tokens = dict(zip(("x", "z"), (signal.written for signal in signals), strict=False))
    text = shape.text.format(**tokens) if "{x}" in shape.text else shape.text
    effect = law_effect(law_name(acts, text))
    y = {"adds": channel_unit(case, problem.model, channel), "multiplies": "1", "enters": force}[acts]
    plain = {"y": y} | {key: signal.unit for key, signal in zip(("x", "z"), signals, strict=False)}
    values: dict[str, float] = {name: start.get(name, 0.0) for name in effect.names}
    if acts != "enters":
        values |= conversion(ITSELF, unit(channel_unit(case, problem.model, channel)).factor, 0.0)
    for signal in signals if acts != "enters" else ():
        if any(driver.name in signal.written for driver in case.drivers):
            name = signal.written[signal.written.index("[") + 1 : signal.written.index("]")]
            if name != ITSELF:
                stated = unit(case.unit(name))
                values |= conversion(name, stated.factor, stated.offset)
    return Trial(
        unit=y,
        shape=shape, signals=signals, acts=acts,
        applied=AppliedEffect(
            effect=effect, channel=channel, values=values,
            units={name: _filled(shape.units[name], plain) for name in effect.names},
        ),
    )  # fmt: skip


def _filled(template: str, units: Mapping[str, str]) -> str:
    """Return a unit with its places filled in, in brackets where something stands around them."""
    alone = template.strip("{}")
    if alone in units:
        return units[alone]
    return reduced(template.format_map({place: bracketed(text) for place, text in units.items()}))


def bracketed(text: str) -> str:
    """Return a unit in brackets where it is put together of several."""
    return f"({text})" if any(mark in text for mark in "*/^") and not text.startswith("(") else text
