"""Corrections of a machine: what a diagnosis found in it, put right by decision in a new version.

A correction stands in a machine definition with the answer that it comes from, its uncertainty, and who
decided it and why; the reduction of every test on that version applies it, and every report names it. The
definition that it was made from stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

from toolkit.declared import AtLeast, Entry, Fault, Format, Names, UnitName
from toolkit.effects.applied import AppliedEffect, EffectKey
from toolkit.effects.catalogue import effects
from toolkit.effects.effect import Effect
from toolkit.estimate import plus_minus
from toolkit.units import unit

_SI = {"FZ": "N", "FY": "N", "MZ": "N*m"}


def correctable() -> dict[str, Effect]:
    """Return the effects that a machine can be corrected for by name, those of the whole machine first."""
    listed = [effect for effect in effects().values() if effect.correctable is not None]
    listed.sort(key=lambda effect: effect.correctable is not None and bool(effect.correctable.channels))
    return {effect.name: effect for effect in listed}


_CORRECTABLE = correctable()
_EXAMPLE = next(iter(_CORRECTABLE.values()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """One correction: ``value`` and standard uncertainty ``u`` in ``unit``, machine axes.

    ``equivalent_to`` are the effects that the answer could not tell it from; ``by`` who took it over all the
    same, with the ``reason``. ``answer_sha256`` is the model file's, ``case_sha256`` that of the case and its
    recordings.
    """

    FORMAT: ClassVar[Format] = Format(
        title="correction", wrong="machine-correction", missing="machine-correction",
        next_step="write corrections with 'toolkit machine correct', never by hand",
    )  # fmt: skip

    effect: Annotated[str, Names(*_CORRECTABLE), Entry("what is put right")]
    channel: Annotated[str | None, Entry("of a leak between two loads: the one that is put right")] = None
    source: Annotated[str | None, Entry("of a leak between two loads: the one that leaks into it")] = None
    parameter: Annotated[str, Entry("the effect's first parameter", example=_EXAMPLE.names[0])]
    value: Annotated[float, Entry("its value, machine axes")]
    unit: Annotated[str, UnitName(), Entry("of value and standard uncertainty", example="rad")]
    u: Annotated[float, AtLeast(0), Entry("standard uncertainty", key="standard_uncertainty")]
    reason: Annotated[str, Entry("why it is taken for the machine's own")]
    by: Annotated[str, Entry("who decided it")]
    date: Annotated[str, Entry("day of the decision, ISO 8601", example="2026-03-31")]
    answer_sha256: Annotated[str, Entry("of the answer's model file")]
    case_sha256: Annotated[str, Entry("of the case and its recordings")]
    code_version: Annotated[str, Entry("of the program that gave the answer")]
    equivalent_to: Annotated[tuple[str, ...], Entry("effects that the answer could not tell it from")] = ()

    @property
    def factor(self) -> float:
        """Factor of ``value`` and ``u`` to SI."""
        return unit(self.unit).factor

    @property
    def label(self) -> str:
        """Name and place: ``crosstalk FZ to FY``."""
        return EffectKey(self.effect, self.channel, self.source).label

    @property
    def applied(self) -> AppliedEffect:
        """The effect at its place, with its value in ``unit``."""
        return AppliedEffect(
            effect=effects()[self.effect], channel=self.channel, source=self.source,
            values={self.parameter: self.value}, units={self.parameter: self.unit},
        )  # fmt: skip

    @property
    def in_SI(self) -> AppliedEffect:
        """The effect at its place, with its value in SI."""
        return replace(self.applied, values={self.parameter: self.value * self.factor}, units={})

    def as_text(self) -> str:
        """Return it in one line for people: what, how large, from which answer, why."""
        doubt = f" (or {', '.join(self.equivalent_to)})" if self.equivalent_to else ""
        return (
            f"{self.label}{doubt}: {plus_minus(self.value, self.u)} {self.unit} (standard uncertainty), from "
            f"answer {self.answer_sha256[:16]}, {self.date}, {self.by}: {self.reason}"
        )

    def faults(self) -> Iterator[Fault]:
        """Yield a parameter, a place or a unit that is not the effect's."""
        effect = _CORRECTABLE[self.effect]
        correctable = effect.correctable
        if correctable is None:
            return
        expected, parameter = correctable.unit, effect.names[0]
        if self.parameter != parameter:
            yield Fault(key=("parameter",), got=self.parameter, expected=parameter)
        if correctable.channels:
            if (
                self.channel not in correctable.channels
                or self.source not in correctable.sources
                or self.channel == self.source
            ):
                yield Fault(
                    key=("channel",), got=f"{self.source} to {self.channel}",
                    what=f"the {self.effect} of these channels is not corrected in a reduction",
                    expected=f"from {', '.join(correctable.sources)} to {' or '.join(correctable.channels)}",
                )  # fmt: skip
                return
            expected = correctable.unit.format_map(
                {"channel": _SI[self.channel], "from": _SI[str(self.source)]}
            )
        elif self.channel or self.source:
            key = "channel" if self.channel else "source"
            yield Fault(
                key=(key,), got=self.channel or self.source, expected="no channel",
                what="the effect acts on the whole machine",
            )  # fmt: skip
        if unit(self.unit).dimension != unit(expected).dimension:
            yield Fault(key=("unit",), got=self.unit, expected=expected, what="a unit of another dimension")
