"""Kinds of values with a unit: a quantity, and the name of a unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from toolkit.declared.faults import display
from toolkit.declared.kinds import REFUSED, Kind, NumberKind, Place
from toolkit.declared.marks import Quantity, Unit, UnitName
from toolkit.errors import UnitError
from toolkit.files import is_number


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class QuantityKind(Kind):
    """A number with its unit, held in SI as a `Quantity`; limits are in the mark's first unit."""

    shape = (dict, int, float)
    number: NumberKind
    unit: Unit

    def form(self) -> str:
        """Return what may stand there, with a unit as an example."""
        if self.unit.beside is not None:
            return self.number.expected
        written = f'{{ value = NUMBER, unit = "{self.unit.units[0] if self.unit.units else "..."}" }}'
        limits = f" {self.number.range()} {self.name}" if self.number.limits else ""
        plain = ", or a number" + f" in {self.name}" * bool(self.name) if self.unit.plain else ""
        return f"{written}{limits}{plain}"

    @property
    def name(self) -> str:
        """The unit of a plain number."""
        return self.unit.units[0] if self.unit.units else ""

    def suits(self, value: Any) -> bool:
        """Tell whether a value is a table, or a number where one may stand alone."""
        plain = self.unit.plain or self.unit.beside is not None
        return isinstance(value, dict) or (plain and self.number.suits(value))

    def read(self, value: Any, place: Place) -> Any:
        """Return the `Quantity` of ``{ value, unit }``, or of a number alone."""
        pair = self.pair(value, place)
        return REFUSED if pair is None else self.in_si(pair[0], pair[1], place)

    def pair(self, value: Any, place: Place) -> tuple[Any, str] | None:
        """Return value and unit as written; None where the entry has no such form."""
        if isinstance(value, dict):
            for key in value:
                if key not in ("value", "unit") and not place.accepted:
                    place.unknown(str(key), ("value", "unit"), value)
                    return None
            if "value" in value and isinstance(value.get("unit"), str):
                return value["value"], value["unit"]
        elif self.unit.plain and self.number.suits(value):
            return value, self.name
        if self.unit.plain and not isinstance(value, dict):
            self.wrong(value, place)  # a unit is not what it lacks
            return None
        place.refuse(
            value, self.expected, rule="no-unit", what=f"{display(value)} has no unit" if value else None
        )
        return None

    def in_si(self, number: Any, text: str, place: Place) -> Any:
        """Return the `Quantity` of a number in a unit."""
        if not is_number(number):
            return place.refuse(number, f"a finite number in {text}", rule=self.entry.rule)
        scale = self.scale(text, place)
        if scale is None:
            return REFUSED
        factor, offset = scale
        quantity = Quantity(float(number) * factor + offset, value=number, unit=text)
        if self.number.limits and not self.number.inside(self.plain(quantity)):
            return place.refuse(quantity, self.number.entry.expected or self.expected, rule=self.entry.rule)
        return quantity

    def scale(self, text: str, place: Place) -> tuple[float, float] | None:
        """Return factor and offset to SI of a unit of a dimension that may stand here."""
        from toolkit.units import unit

        try:
            si_unit = unit(text)
        except UnitError as error:
            place.refuse(text, self.examples() or str(error.expected), what=error.what, rule=place.form.unit)
            return None
        dimensions = [unit(name).dimension for name in self.unit.units]
        if dimensions and si_unit.dimension not in dimensions:
            place.refuse(
                f"{text} ({si_unit.dimension})",
                f"{' or '.join(dimensions)}: a unit such as {self.examples()}",
                what=f"{text} is a unit of {si_unit.dimension}", rule="unit-dimension",
            )  # fmt: skip
            return None
        return si_unit.factor, 0.0 if self.unit.difference else si_unit.offset

    def examples(self) -> str:
        """Return units that may stand here, for people."""
        from toolkit.units import unit_examples

        return ", ".join(
            dict.fromkeys(name for first in self.unit.units for name in (first, *unit_examples(first)))
        )

    def plain(self, si: float) -> float:
        """Return an SI value in the mark's first unit, or in that of its dimension; SI where it has none."""
        from toolkit.units import unit

        units = list(self.unit.units)
        if isinstance(si, Quantity):
            dimension = unit(si.unit).dimension
            units = [name for name in units if unit(name).dimension == dimension]
            if si.unit in units[:1]:
                return float(si.value)
        if not units:
            return float(si)
        si_unit = unit(units[0])
        return (float(si) - (0.0 if self.unit.difference else si_unit.offset)) / si_unit.factor

    def written(self, si: float) -> tuple[Any, str]:
        """Return value and unit: as it was read, else in a unit that gives the same float again."""
        from toolkit.units import unit

        if isinstance(si, Quantity):
            return si.value, si.unit
        if not self.unit.units:
            return float(si), "1"
        si_unit = unit(self.unit.units[0])
        offset = 0.0 if self.unit.difference else si_unit.offset
        number = (float(si) - offset) / si_unit.factor
        for candidate in (number, math.nextafter(number, math.inf), math.nextafter(number, -math.inf)):
            short = float(f"{candidate:.15g}")
            for value in (short, candidate):
                if value * si_unit.factor + offset == float(si):
                    return value, self.unit.units[0]
        return float(si), si_unit.si

    def holds(self, value: Any) -> bool:
        """Tell whether it is a number."""
        return self.number.suits(value)

    def write(self, value: Any) -> Any:
        """Return ``{ value, unit }``, or the number alone where its unit stands beside it."""
        number, text = self.written(value)
        return number if self.unit.beside is not None else {"value": number, "unit": text}

    def schema(self) -> dict[str, Any]:
        """Return the schema of ``{ value, unit }``; limits cannot be said, the unit is free."""
        if self.unit.beside is not None:
            return self.number.schema()
        pair = {
            "type": "object",
            "properties": {"value": {"type": "number"}, "unit": {"type": "string"}},
            "required": ["value", "unit"],
            "additionalProperties": False,
        }
        return {"anyOf": [pair, self.number.schema()]} if self.unit.plain else pair

    def example(self) -> Any:
        """Return the example, else a number in the first unit."""
        if self.entry.example is not None:
            return self.entry.example
        number = self.number.example()
        return number if self.unit.beside is not None else {"value": number, "unit": self.name or "N"}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class UnitKind(Kind):
    """The name of a unit, held in its one spelling."""

    shape = str
    mark: UnitName

    def form(self) -> str:
        """Return what may stand there."""
        return f"a unit of {' or '.join(self.mark.dimensions)}" if self.mark.dimensions else "a unit"

    def read(self, value: Any, place: Place) -> Any:
        """Return the unit's spelling."""
        from toolkit.units import unit

        if not isinstance(value, str):
            return self.wrong(value, place)
        try:
            si_unit = unit(value)
        except UnitError as error:
            return place.refuse(value, str(error.expected), what=error.what, rule=place.form.unit)
        if self.mark.dimensions and si_unit.dimension not in self.mark.dimensions:
            return place.refuse(
                f"{value} ({si_unit.dimension})", self.expected, rule="unit-dimension",
                what=f"{value} is a unit of {si_unit.dimension}",
            )  # fmt: skip
        return value if self.mark.as_written else si_unit.text

    def schema(self) -> dict[str, Any]:
        """Return the schema of a unit's name."""
        return {"type": "string"}

    def example(self) -> Any:
        """Return the example, else newtons."""
        return self.entry.example or "N"
