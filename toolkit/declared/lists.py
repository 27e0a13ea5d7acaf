"""Kinds of lists, and of tables whose keys are names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from toolkit.declared.faults import MOST_TOLD, display
from toolkit.declared.kinds import REFUSED, Kind, Place
from toolkit.declared.marks import Distinct, Names, Quantity, Size
from toolkit.declared.quantities import QuantityKind
from toolkit.declared.tables import TableKind
from toolkit.spelling import nearest


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ListKind(Kind):
    """A list, held as a tuple; of quantities ``{ value = [..], unit = ".." }``, of tables ``[[name]]``.

    ``fixed``: the kinds of a tuple of a fixed length, such as bounds.
    """

    shape = list
    item: Kind
    fixed: tuple[Kind, ...] = ()
    size: Size = field(default_factory=lambda: Size(0))
    distinct: Distinct | None = None

    @property
    def of_tables(self) -> bool:
        """Whether it is a list of tables, [[name]]."""
        return isinstance(self.item, TableKind)

    @property
    def shared_unit(self) -> bool:
        """Whether its numbers share one unit."""
        return isinstance(self.item, QuantityKind) and not self.fixed

    def suits(self, value: Any) -> bool:
        """Tell whether a value is a list, or a table with one of numbers."""
        if self.shared_unit and isinstance(value, dict):
            return isinstance(value.get("value"), list)
        return isinstance(value, list) and not (
            self.of_tables and not all(self.item.suits(table) for table in value)
        )

    def form(self) -> str:
        """Return what may stand there."""
        if self.fixed:
            return f"[{', '.join(kind.expected for kind in self.fixed)}]"
        least = {0: "", 1: ", at least one"}.get(self.size.least, f", at least {self.size.least}")
        once = ", each once" if self.distinct is not None and self.distinct.by is None else ""
        once += f", each {self.distinct.by} once" if self.distinct is not None and self.distinct.by else ""
        if isinstance(self.item, QuantityKind):
            name = self.item.name or "..."
            limits = f" {self.item.number.range()} {name}" if self.item.number.limits else ""
            return f'{{ value = [NUMBER, ...], unit = "{name}" }}{limits}{least}{once}'
        if isinstance(self.item, TableKind):
            return f"a list of tables with {', '.join(self.item.keys)}{least}{once}"
        return f"a list, each {self.item.expected}{least}{once}"

    def read(self, value: Any, place: Place) -> Any:
        """Return a tuple."""
        unit, items = None, value
        if self.shared_unit and isinstance(value, dict) and set(value) <= {"value", "unit"}:
            unit, items = value.get("unit"), value.get("value")
            if not isinstance(unit, str):
                return place.refuse(value, self.expected, rule="no-unit", what="the list has no unit")
        elif self.shared_unit:
            items = None
        if not isinstance(items, list) or not self.suits(value):
            return self.wrong(value, place)
        most = len(self.fixed) if self.fixed else self.size.most
        if len(items) < (len(self.fixed) or self.size.least) or (most is not None and len(items) > most):
            return self.wrong(value, place)
        values = []
        for number, item in enumerate(items):
            kind = self.fixed[number] if self.fixed else self.item
            item_place = place.at("value").at(number) if unit is not None else place.at(number)
            if unit is not None and isinstance(kind, QuantityKind):
                # Of a unit that cannot be, one fault is enough.
                if number == 0 and kind.scale(unit, place.at("unit")) is None:
                    return REFUSED
                values.append(kind.in_si(item, unit, item_place))
            else:
                values.append(kind.read(item, item_place))
        if any(entry is REFUSED for entry in values) or not self._once(values, value, place):
            return REFUSED
        return tuple(values)

    def _once(self, values: Sequence[Any], value: Any, place: Place) -> bool:
        if self.distinct is None:
            return True
        by = self.distinct.by
        marks = values if by is None else [getattr(entry, by) for entry in values]
        for number, mark in enumerate(marks):
            if mark in marks[:number]:
                text = display(mark.value if isinstance(mark, Quantity) else mark, quoted=True)
                item_place = place if by is None else place.at(number).at(by)
                item_place.refuse(
                    value if by is None else mark, self.expected, rule=self.entry.rule,
                    what=f"{text} stands twice",
                )  # fmt: skip
                return False
        return True

    def holds(self, value: Any) -> bool:
        """Tell whether it is a tuple."""
        return isinstance(value, tuple)

    def write(self, value: Any) -> Any:
        """Return a list; of quantities in one unit, values and unit."""
        from toolkit.units import unit

        if self.fixed:
            return [kind.write(entry) for kind, entry in zip(self.fixed, value, strict=True)]
        if isinstance(self.item, QuantityKind):
            pairs = [self.item.written(entry) for entry in value]
            if len({text for _, text in pairs}) > 1:  # of no common unit: the SI values are exact
                pairs = [(float(entry), unit(text).si) for entry, (_, text) in zip(value, pairs, strict=True)]
            return {
                "value": [number for number, _ in pairs],
                "unit": pairs[0][1] if pairs else self.item.name,
            }
        return [self.item.write(entry) for entry in value]

    def schema(self) -> dict[str, Any]:
        """Return the schema of the list."""
        if self.fixed:
            kinds = [kind.schema() for kind in self.fixed]
            return {"type": "array", "prefixItems": kinds, "minItems": len(kinds), "maxItems": len(kinds)}
        item = self.item.number.schema() if isinstance(self.item, QuantityKind) else self.item.schema()
        if isinstance(self.item, QuantityKind):
            item = {"type": "number"}
        schema: dict[str, Any] = {"type": "array", "items": item}
        if self.size.least:
            schema["minItems"] = self.size.least
        if self.size.most is not None:
            schema["maxItems"] = self.size.most
        if self.distinct is not None and self.distinct.by is None:
            schema["uniqueItems"] = True
        if self.shared_unit:
            properties = {"value": schema, "unit": {"type": "string"}}
            return {
                "type": "object", "properties": properties, "required": ["value", "unit"],
                "additionalProperties": False,
            }  # fmt: skip
        return schema

    def example(self) -> Any:
        """Return the example, else the shortest list of examples."""
        if self.entry.example is not None:
            return self.entry.example
        if self.fixed:
            return [kind.example() for kind in self.fixed]
        count = max(self.size.least, 1)
        if isinstance(self.item, QuantityKind):
            number = self.item.number.example()
            return {"value": [number + step for step in range(count)], "unit": self.item.name}
        return [self.item.example()] * count


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class KeyedKind(Kind):
    """A table whose keys are names; held as pairs, a mapping, or classes with the name in ``by``."""

    shape = dict
    item: Kind
    by: str | None = None
    pairs: bool = True
    names: Names | None = None
    size: Size = field(default_factory=lambda: Size(0))

    def form(self) -> str:
        """Return what may stand there."""
        names = self.names.fixed if self.names is not None and self.names.of is None else ()
        if not names:
            among = f", each NAME one of {self.names.of}" if self.names is not None else ""
            return f"a table {{ NAME = {self.item.expected} }}{among}"
        return f"a table with {', '.join(names)}"

    def read(self, value: Any, place: Place) -> Any:
        """Return the entries in their order."""
        if not isinstance(value, dict) or not self.size.least <= len(value):
            return self.wrong(value, place)
        names = () if self.names is None else self.names.names(place.root)
        entries = []
        for key, entry in value.items():
            item_place = place.at(key)
            if names and key not in names:
                near = nearest(key, names, value) if len(place.faults) < MOST_TOLD else None
                item_place.refuse(key, ", ".join(names), kind="unknown", near=near)
                entries.append((key, REFUSED))
            elif self.by is not None and isinstance(self.item, TableKind):
                entries.append((key, self.item.read(entry, item_place, {self.by: key})))
            else:
                entries.append((key, self.item.read(entry, item_place)))
        if any(entry is REFUSED for _, entry in entries):
            return REFUSED
        if self.by is not None:
            return tuple(entry for _, entry in entries)
        return tuple(entries) if self.pairs else dict(entries)

    def holds(self, value: Any) -> bool:
        """Tell whether it is a tuple of pairs or of classes, or a mapping."""
        return isinstance(value, tuple if self.pairs or self.by is not None else Mapping)

    def write(self, value: Any) -> Any:
        """Return a table."""
        if self.by is not None:
            return {str(getattr(entry, self.by)): self.item.write(entry) for entry in value}
        entries = value if self.pairs else value.items()
        return {str(key): self.item.write(entry) for key, entry in entries}

    def schema(self) -> dict[str, Any]:
        """Return the schema of the table."""
        schema: dict[str, Any] = {"type": "object", "additionalProperties": self.item.schema()}
        if self.names is not None and self.names.of is None:
            schema["propertyNames"] = {"enum": list(self.names.fixed)}
        if self.size.least:
            schema["minProperties"] = self.size.least
        return schema

    def example(self) -> Any:
        """Return the example, else one entry."""
        if self.entry.example is not None:
            return self.entry.example
        return {self.names.fixed[0] if self.names and self.names.fixed else "NAME": self.item.example()}
