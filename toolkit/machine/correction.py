"""Corrections of a machine: what a diagnosis found in it, put right by decision in a new version.

A correction stands in a machine definition with the answer that it comes from, its uncertainty, and who
decided it and why; the reduction of every test on that version applies it, and every report names it. The
definition that it was made from stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from toolkit.errors import ConfigError
from toolkit.estimate import plus_minus
from toolkit.files import check_keys, is_number
from toolkit.units import unit

_LOADS = ("FY", "MZ")
_SOURCES = ("FZ", "FY", "MZ")
# Effect -> its parameter and the unit in which it computes; crosstalk's follows from its two loads.
CORRECTABLE = {
    "steer_offset": ("offset", "rad"),
    "steer_compliance": ("compliance", "rad/(N*m)"),
    "crosstalk": ("coefficient", ""),
}
_KEYS = (
    "effect channel source parameter value unit standard_uncertainty reason by date answer_sha256 "
    "case_sha256 code_version equivalent_to"
).split()
_SI = {"FZ": "N", "FY": "N", "MZ": "N*m"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """One correction: ``value`` and standard uncertainty ``u`` in ``unit``, machine axes.

    ``equivalent_to`` are the effects that the answer could not tell it from; ``by`` who took it over all the
    same, with the ``reason``. ``answer_sha256`` is the model file's, ``case_sha256`` that of the case and its
    recordings.
    """

    effect: str
    channel: str | None
    source: str | None
    parameter: str
    value: float
    unit: str
    u: float
    reason: str
    by: str
    date: str
    answer_sha256: str
    case_sha256: str
    code_version: str
    equivalent_to: tuple[str, ...] = ()

    @property
    def factor(self) -> float:
        """Factor of ``value`` and ``u`` to SI."""
        return unit(self.unit).factor

    @property
    def label(self) -> str:
        """Name and place: ``crosstalk FZ to FY``."""
        return f"{self.effect} {self.source} to {self.channel}" if self.source else self.effect

    def as_text(self) -> str:
        """Return it in one line for people: what, how large, from which answer, why."""
        doubt = f" (or {', '.join(self.equivalent_to)})" if self.equivalent_to else ""
        return (
            f"{self.label}{doubt}: {plus_minus(self.value, self.u)} {self.unit} (standard uncertainty), from "
            f"answer {self.answer_sha256[:16]}, {self.date}, {self.by}: {self.reason}"
        )


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
    effect = table.get("effect")
    if effect not in CORRECTABLE:
        raise _wrong("no reduction corrects this effect", f"{where}.effect", effect, ", ".join(CORRECTABLE))
    texts: dict[str, str] = {}
    for key in ("unit", "reason", "by", "date", "answer_sha256", "case_sha256", "code_version"):
        given = table.get(key)
        if not isinstance(given, str) or not given.strip():
            raise _wrong(f"a correction has no {key}", f"{where}.{key}", given, "a text")
        texts[key] = given
    same = table.get("equivalent_to", [])
    if not isinstance(same, list) or not all(isinstance(one, str) for one in same):
        raise _wrong("equivalent_to is no list of names", f"{where}.equivalent_to", same, '["plysteer"]')
    made = Correction(
        effect=effect,
        channel=table.get("channel"),
        source=table.get("source"),
        parameter=CORRECTABLE[effect][0],
        value=_number(table.get("value"), f"{where}.value"),
        u=_number(table.get("standard_uncertainty"), f"{where}.standard_uncertainty"),
        equivalent_to=tuple(same),
        **texts,
    )
    if table.get("parameter", made.parameter) != made.parameter:
        raise _wrong("not the effect's parameter", f"{where}.parameter", table["parameter"], made.parameter)
    check_correction(made, where)
    return made


def check_correction(one: Correction, where: str) -> None:
    """Refuse a correction whose place, unit or uncertainty cannot be.

    Raises
    ------
    ConfigError
        ``machine-correction``
    """
    if one.u < 0:
        raise _wrong("a standard uncertainty is negative", where, one.u, "a number from 0")
    if one.effect == "crosstalk":
        if one.channel not in _LOADS or one.source not in _SOURCES or one.channel == one.source:
            raise _wrong(
                "the crosstalk of these channels is not corrected in a reduction", where,
                f"{one.source} to {one.channel}", f"from {', '.join(_SOURCES)} to {' or '.join(_LOADS)}",
            )  # fmt: skip
        expected = f"({_SI[one.channel]})/({_SI[one.source]})"
    else:
        if one.channel or one.source:
            raise _wrong("the effect acts on the whole machine", where, one.channel, "no channel")
        expected = CORRECTABLE[one.effect][1]
    if unit(one.unit, where=where).dimension != unit(expected).dimension:
        raise _wrong("a correction is in a unit of another dimension", where, one.unit, expected)


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
