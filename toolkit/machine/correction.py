"""Corrections of a machine: what a diagnosis found in it, put right by decision in a new version.

A correction stands in a machine definition with the answer that it comes from, its uncertainty, and who
decided it and why; the reduction of every test on that version applies it, and every report names it. The
definition that it was made from stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.effects.effect import Effect
from toolkit.errors import ConfigError
from toolkit.estimate import plus_minus
from toolkit.files import check_keys, is_number
from toolkit.units import unit

_KEYS = (
    "effect channel source parameter value unit standard_uncertainty reason by date answer_sha256 "
    "case_sha256 code_version equivalent_to"
).split()
_SI = {"FZ": "N", "FY": "N", "MZ": "N*m"}


def correctable() -> dict[str, Effect]:
    """Return the effects that a machine can be corrected for, by name in alphabetical order."""
    return {name: effect for name, effect in sorted(effects().items()) if effect.correctable is not None}


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """One correction: an effect with the value of its first parameter in a unit, machine axes.

    ``u`` is the value's standard uncertainty. ``equivalent_to`` are the effects that the answer could not
    tell it from; ``by`` who took it over all the same, with the ``reason``. ``answer_sha256`` is the model
    file's, ``case_sha256`` that of the case and its recordings.
    """

    applied: AppliedEffect
    u: float
    reason: str
    by: str
    date: str
    answer_sha256: str
    case_sha256: str
    code_version: str
    equivalent_to: tuple[str, ...] = ()

    @property
    def parameter(self) -> str:
        """Name of the parameter that is corrected."""
        return self.applied.effect.names[0]

    @property
    def value(self) -> float:
        """Its value in ``unit``."""
        return self.applied.values[self.parameter]

    @property
    def unit(self) -> str:
        """Unit of ``value`` and ``u``."""
        return self.applied.units[self.parameter]

    @property
    def u_SI(self) -> float:
        """Standard uncertainty in SI."""
        return self.u * unit(self.unit).factor

    @property
    def in_SI(self) -> AppliedEffect:
        """The effect with its value in SI."""
        return replace(self.applied, values={self.parameter: self.value * unit(self.unit).factor})

    @property
    def label(self) -> str:
        """Name and place: ``crosstalk FZ to FY``."""
        return self.applied.key.label

    def as_text(self) -> str:
        """Return it in one line for people: what, how large, from which answer, why."""
        doubt = f" (or {', '.join(self.equivalent_to)})" if self.equivalent_to else ""
        return (
            f"{self.label}{doubt}: {plus_minus(self.value, self.u)} {self.unit} (standard uncertainty), from "
            f"answer {self.answer_sha256[:16]}, {self.date}, {self.by}: {self.reason}"
        )

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {
            "effect": self.applied.effect.name, "channel": self.applied.channel,
            "source": self.applied.source, "parameter": self.parameter, "value": self.value,
            "unit": self.unit, "u": self.u, "reason": self.reason, "by": self.by, "date": self.date,
            "answer_sha256": self.answer_sha256, "case_sha256": self.case_sha256,
            "code_version": self.code_version, "equivalent_to": self.equivalent_to,
        }  # fmt: skip


def read_corrections(entry: object, where: str) -> tuple[Correction, ...]:
    """Read ``[[correction]]`` of a machine definition.

    Raises
    ------
    ConfigError
        ``machine-correction``: an effect that no reduction can put right, a number or a text that is missing
    UnitError
        a unit that is not known
    """
    if not isinstance(entry, list):
        raise _wrong("corrections are no list of tables", where, entry, "[[correction]]")
    return tuple(_correction(one, f"{where}[{i}]") for i, one in enumerate(entry, start=1))


def _correction(table: Any, where: str) -> Correction:
    if not isinstance(table, dict):
        raise _wrong("a correction is no table", where, table, "[[correction]]")
    check_keys(table, _KEYS, where=where)
    listed = correctable()
    effect = listed.get(str(table.get("effect")))
    if effect is None:
        raise _wrong(
            "no reduction corrects this effect", f"{where}.effect", table.get("effect"), ", ".join(listed)
        )
    texts: dict[str, str] = {}
    for key in ("unit", "reason", "by", "date", "answer_sha256", "case_sha256", "code_version"):
        text = table.get(key)
        if not isinstance(text, str) or not text.strip():
            raise _wrong(f"a correction has no {key}", f"{where}.{key}", text, "a text")
        texts[key] = text
    same = table.get("equivalent_to", [])
    if not isinstance(same, list) or not all(isinstance(one, str) for one in same):
        raise _wrong("equivalent_to is no list of names", f"{where}.equivalent_to", same, '["NAME"]')
    parameter = effect.names[0]
    correction = Correction(
        applied=AppliedEffect(
            effect=effect,
            channel=table.get("channel"),
            source=table.get("source"),
            values={parameter: _number(table.get("value"), f"{where}.value")},
            units={parameter: texts.pop("unit")},
        ),
        u=_number(table.get("standard_uncertainty"), f"{where}.standard_uncertainty"),
        equivalent_to=tuple(same),
        **texts,
    )
    if table.get("parameter", parameter) != parameter:
        raise _wrong("not the effect's parameter", f"{where}.parameter", table["parameter"], parameter)
    check_correction(correction, where)
    return correction


def check_correction(correction: Correction, where: str) -> None:
    """Refuse a correction whose place, unit or uncertainty cannot be.

    Raises
    ------
    ConfigError
        ``machine-correction``
    """
    if correction.u < 0:
        raise _wrong("a standard uncertainty is negative", where, correction.u, "a number from 0")
    applied, way = correction.applied, correction.applied.effect.correctable
    if way is None:
        raise _wrong("no reduction corrects this effect", where, correction.label, ", ".join(correctable()))
    channel, source = applied.channel, applied.source
    expected = way.unit
    if way.channels:
        if channel not in way.channels or source not in way.sources or channel == source:
            raise _wrong(
                f"the {applied.effect.name} of these channels is not corrected in a reduction", where,
                f"{source} to {channel}", f"from {', '.join(way.sources)} to {' or '.join(way.channels)}",
            )  # fmt: skip
        expected = way.unit.format_map({"channel": _SI[str(channel)], "from": _SI[str(source)]})
    elif channel or source:
        raise _wrong("the effect acts on the whole machine", where, channel, "no channel")
    if unit(correction.unit, where=where).dimension != unit(expected).dimension:
        raise _wrong("a correction is in a unit of another dimension", where, correction.unit, expected)


def _number(entry: object, where: str) -> float:
    if not is_number(entry):
        raise _wrong("a correction has no number", where, entry, "a finite number")
    return float(entry)


def _wrong(what: str, where: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        what, where=where, got="nothing" if got is None else got, expected=expected,
        next_step="write corrections with 'toolkit machine correct', never by hand",
        rule="machine-correction",
    )  # fmt: skip
