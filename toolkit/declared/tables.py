"""Kinds of tables: those that a dataclass declares, and entries that have one of several forms."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from toolkit.declared.faults import MOST_TOLD
from toolkit.declared.kinds import REFUSED, ChoiceKind, Kind, Place
from toolkit.declared.marks import Format, Quantity
from toolkit.declared.quantities import QuantityKind
from toolkit.files import is_number
from toolkit.spelling import nearest

MISSING: Any = object()


@dataclass(frozen=True, eq=False, repr=False)
class Field:
    """One field of a declared class: its name, the key of its entry, its kind, and its default."""

    name: str
    key: str
    kind: Kind
    default: Any = MISSING
    optional: bool = False

    @property
    def required(self) -> bool:
        """Whether the entry must stand there."""
        return self.default is MISSING

    @property
    def unit(self) -> str:
        """The unit in which a plain number is written; empty where the entry has none."""
        return self.kind.name if isinstance(self.kind, QuantityKind) else ""

    @property
    def beside(self) -> str | None:
        """Key of the entry in which the unit of this one stands."""
        return self.kind.unit.beside if isinstance(self.kind, QuantityKind) else None


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TableKind(Kind):
    """A table that a dataclass declares. Fields are looked up when first needed: classes may nest."""

    shape: ClassVar[type | tuple[type, ...]] = dict
    cls: type
    fields_of: Callable[[type], tuple[Field, ...]]
    form_of: Format | None = None
    named_by: str | None = None
    short: str | None = None

    @property
    def fields(self) -> tuple[Field, ...]:
        """The fields that a file has, without the one that holds the table's own name."""
        return tuple(field for field in self.fields_of(self.cls) if field.name != self.named_by)

    @property
    def own_keys(self) -> tuple[str, ...]:
        """The keys of its fields, without those of units that stand beside numbers."""
        return tuple(field.key for field in self.fields)

    @property
    def definition(self) -> str:
        """Name of its JSON schema: the class's, with the field that its name stands for."""
        return self.cls.__name__ + (f"_by_{self.named_by}" if self.named_by else "")

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that may stand in the table."""
        keys = {key: None for field in self.fields for key in (field.key, field.beside) if key}
        schema = self.form_of is not None and self.form_of.schema is not None
        return (*(("schema",) if schema and "schema" not in keys else ()), *keys)

    def form(self) -> str:
        """Return what may stand there."""
        return f"a table with {', '.join(self.keys)}"

    def read(self, value: Any, place: Place, name_entry: Mapping[str, Any] | None = None) -> Any:
        """Return an object of the class; ``stated`` are fields that no entry holds."""
        if self.short is not None and not isinstance(value, dict):
            value = {self.short: value}
        if not isinstance(value, dict):
            path = ".".join(part for part in place.path if isinstance(part, str))
            return place.refuse(
                value, self.entry.expected or f"a table [{path}] with {', '.join(self.keys)}",
                rule=self.entry.rule,
            )  # fmt: skip
        if self.form_of is not None:
            place = replace(place, form=self.form_of)
            value = _of_newest(value, self.form_of, place)
            if value is None:
                return REFUSED
            if not place.path:
                place = replace(place, root=value)
        fields = self.fields
        values, nearest_keys, before = dict(name_entry or {}), set(), len(place.faults)
        by_key = {key: field for field in fields for key in (field.key, *field.kind.entry.old)}
        keys = self.keys
        for key, entry in value.items():
            declared = by_key.get(key)
            if declared is not None:
                if declared.beside is None:
                    values[declared.name] = declared.kind.read(entry, place.at(key))
            elif key not in keys:
                near = nearest(str(key), keys, value) if len(place.faults) < MOST_TOLD else None
                nearest_keys.add(near)
                place.at(key).refuse(key, ", ".join(sorted(keys)), kind="unknown", near=near)
        for declared in fields:
            if declared.beside is not None and declared.key in value:
                values[declared.name] = _with_unit_beside(declared, value, place)
            elif declared.name not in values and declared.required and declared.key not in nearest_keys:
                # A key that was misspelt is not missing too.
                kind = declared.kind
                place.at(declared.key).refuse(None, kind.expected, kind="missing", rule=kind.entry.rule)
        if len(place.faults) > before:
            return REFUSED
        instance = self.cls(**values)
        for fault in getattr(instance, "faults", tuple)():
            key = (*place.path, *fault.key)
            place.faults.append(replace(fault, key=key, form=place.form))
        return instance if len(place.faults) == before else REFUSED

    def suits(self, value: Any) -> bool:
        """Tell whether a value is a table, or stands for one."""
        return isinstance(value, dict) or self.short is not None

    def holds(self, value: Any) -> bool:
        """Tell whether it is an object of the class."""
        return type(value) is self.cls

    def write(self, value: Any) -> Any:
        """Return the table; what is None, or an empty list by default, is left out."""
        table: dict[str, Any] = {}
        for declared in self.fields_of(type(value)):
            entry = getattr(value, declared.name)
            if declared.name == self.named_by or entry is None or (entry == () and declared.default == ()):
                continue
            table[declared.key] = declared.kind.write(entry)
            if declared.beside is not None and isinstance(declared.kind, QuantityKind):
                _, unit = declared.kind.written(entry)
                if table.setdefault(declared.beside, unit) != unit:  # two numbers share one unit
                    table[declared.key] = _in_unit(declared.kind, entry, table[declared.beside])
        return table

    def schema(self) -> dict[str, Any]:
        """Return a reference to the schema of the class; `describe.json_schema` holds them all."""
        return {"$ref": f"#/$defs/{self.definition}"}

    def example(self) -> Any:
        """Return the required entries."""
        if self.entry.example is not None:
            return self.entry.example
        return {field.key: field.kind.example() for field in self.fields if field.required}


def _of_newest(table: dict[str, Any], form: Format, place: Place) -> dict[str, Any] | None:
    """Return the entries in the newest form; None where their schema is not known."""
    if form.schema is None:
        return table
    name_entry = table.get("schema", None if form.schema_required else form.schema)
    if name_entry is None:
        place.at("schema").refuse(None, f"schema = {form.schema}", kind="missing")
        return None
    older = dict(form.older or {})
    if type(name_entry) is not int or (name_entry != form.schema and name_entry not in older):
        newer = type(name_entry) is int and name_entry > form.schema
        place.at("schema").refuse(
            name_entry,
            " or ".join(map(str, sorted({form.schema, *older}))),
            what=f"this {form.title} was written by a newer version of the toolkit" if newer else None,
        )
        return None
    while name_entry != form.schema:
        table = {**older[name_entry](table), "schema": name_entry + 1}
        name_entry += 1
    return table


def _with_unit_beside(declared: Field, table: Mapping[str, Any], place: Place) -> Any:
    kind, beside = declared.kind, declared.beside or ""
    if not isinstance(kind, QuantityKind):
        return REFUSED
    number, text = table[declared.key], table.get(beside)
    if not is_number(number) or not kind.number.inside(number):
        return kind.number.wrong(number, place.at(declared.key))
    if text is None and number == 0:
        text = kind.name or "1"
    if text is None:
        expected = f"a unit such as {kind.examples()}"
        return place.at(beside).refuse(None, expected, rule="no-unit", kind="missing")
    if not isinstance(text, str):
        return place.at(beside).refuse(text, f"a unit such as {kind.examples()}", rule="no-unit")
    scale = kind.scale(text, place.at(beside))
    if scale is None:
        return REFUSED
    return Quantity(float(number) * scale[0] + scale[1], value=number, unit=text)


def _in_unit(kind: QuantityKind, si: float, text: str) -> float:
    from toolkit.units import unit

    si_unit = unit(text)
    return (float(si) - (0.0 if kind.unit.difference else si_unit.offset)) / si_unit.factor


def _shared(form: Kind, table: Mapping[str, Any]) -> float:
    """Return how many keys of an entry a table has; half a key for one that takes any."""
    return sum(key in form.keys for key in table) if isinstance(form, TableKind) else 0.5


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FormsKind(Kind):
    """One of several forms: told apart by shape (a text or a table), tables by a word (``tag``) or keys."""

    forms: tuple[Kind, ...]
    tag: str | None = None

    @property
    def tables(self) -> dict[Any, TableKind]:
        """The declared classes by the word of their tag."""
        by_word: dict[Any, TableKind] = {}
        for form in self.forms:
            if isinstance(form, TableKind):
                kind = next((declared.kind for declared in form.fields if declared.name == self.tag), None)
                words = kind.choices if isinstance(kind, ChoiceKind) else ()
                by_word.update(dict.fromkeys(words, form))
        return by_word

    def suits(self, value: Any) -> bool:
        """Tell whether one of the forms suits."""
        return any(form.suits(value) for form in self.forms)

    def form(self) -> str:
        """Return what may stand there."""
        if self.tag is not None:
            return f"a table with {self.tag} = {' or '.join(map(repr, self.tables))}"
        return " or ".join(form.expected for form in self.forms)

    def read(self, value: Any, place: Place) -> Any:
        """Return what the form that suits makes of it."""
        if self.tag is not None and isinstance(value, dict):
            tables, word = self.tables, value.get(self.tag)
            if isinstance(word, str | int) and word in tables:
                return tables[word].read(value, place)
            words = ChoiceKind(choices=tuple(tables))
            if word is None:
                return place.at(self.tag).refuse(None, words.expected, kind="missing")
            return words.read(word, place.at(self.tag))
        forms = [form for form in self.forms if form.suits(value)]
        if not forms:
            return self.wrong(value, place)
        if isinstance(value, dict):
            # A table of names may have any key: it is meant where no declared table has one of them.
            return max(forms, key=lambda form: _shared(form, value)).read(value, place)
        return forms[0].read(value, place)

    def write(self, value: Any) -> Any:
        """Return the entry as the form that it has writes it."""
        for form in self.forms:
            if form.holds(value):
                return form.write(value)
        raise TypeError(f"{value!r} has none of the declared forms")

    def schema(self) -> dict[str, Any]:
        """Return the schema of the forms."""
        return {"anyOf": [form.schema() for form in self.forms]}

    def example(self) -> Any:
        """Return the example of the first form."""
        return self.forms[0].example() if self.entry.example is None else self.entry.example
