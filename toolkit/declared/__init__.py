'''Formats declared once: annotated frozen dataclasses to and from TOML and JSON.

A format is one frozen dataclass. Its annotations say what may stand in the file, its reader is one call, and
starter file, reference page and JSON schema are printed from the same lines:

>>> from dataclasses import dataclass
>>> from typing import Annotated, ClassVar, Literal
>>> @dataclass(frozen=True, slots=True, kw_only=True)
... class Drum:
...     """The road."""
...     surface: Annotated[Literal["convex", "flat"], Entry("shape of the surface")]
...     speed_m_s: Annotated[float, Unit("km/h"), Above(0), Entry("surface speed", key="speed")]
...     diameter_m: Annotated[float | None, Unit("m", plain=True), Entry("diameter", key="diameter")] = None
>>> @dataclass(frozen=True, slots=True, kw_only=True)
... class Rig:
...     """A rig."""
...     FORMAT: ClassVar[Format] = Format(title="rig", schema=1)
...     name: Annotated[str, Entry("name of the rig")]
...     drum: Drum
...     repeats: Annotated[int, AtLeast(1), Entry("of every condition")] = 1
>>> rig = read_text(Rig, b"""
... name = "R1"
... [drum]
... surface = "flat"
... speed = { value = 72, unit = "km/h" }""", where="rig.toml")
>>> rig.drum.speed_m_s, rig.repeats
(20.0, 1)
>>> plain(rig)["drum"]["speed"]
{'value': 72, 'unit': 'km/h'}
>>> read_text(Rig, b"""name = "R1"
... [drum]
... surfaces = "flat"
... speed = { value = -72, unit = "km/h" }""", where="rig.toml")
Traceback (most recent call last):
toolkit.errors.ConfigError: 2 entries cannot be used
  where:    rig.toml
  got:      drum.surfaces: unknown key; did you mean 'surface'?
              3 | surfaces = "flat"
            drum.speed: -72 km/h cannot be used; expected { value = NUMBER, unit = "km/h" } above 0 km/h
              4 | speed = { value = -72, unit = "km/h" }
  expected: what stands with each of them
  next:     correct every entry that is named

**Types.** ``bool``, ``int``, ``float`` (finite), ``str`` (not empty unless `Text` says so),
``datetime.date``, ``pathlib.Path``, ``Literal[...]``, ``X | None``, ``tuple[X, ...]``, ``tuple[X, Y]`` of
a fixed length, ``Mapping[str, X]``, a dataclass (a table), ``tuple[Dataclass, ...]`` (``[[name]]``), ``A
| B`` (told apart by shape: "a text or a table"; two dataclasses by a ``Literal`` field that both have, else
by their keys),
``Any`` (judged elsewhere). Annotations are evaluated: import what they name, not under ``TYPE_CHECKING``.

**Marks** stand in ``Annotated``; those of a list are meant for its elements, but for `Size` and
`Distinct`:

- `Entry`: help text, key where it differs from the field's name, example, what a fault says was expected,
  rule id of its own, former spellings of the key;
- `Above` `AtLeast` `Below` `AtMost`: bounds, in the unit of the field;
- `Unit`: ``{ value = 80, unit = "km/h" }``, held in SI as a `Quantity`, a float that remembers how it was
  written; ``plain=True`` takes a number alone too, ``beside="unit"`` one whose unit stands in the entry
  ``unit`` of the same table;
- `Text` (empty, stripped, pattern, from a number), `Day` (a date held as ISO 8601 text), `UnitName`;
- `Short`: a value alone stands for a table with one entry;
- `Size`, `Distinct`; `Keyed` for tables whose keys are names, ``[cells.D51]``, and `Names` for texts or
  keys that are among names given or declared by another entry: ``Names(of="loads")``.

**A class** says of its format in ``FORMAT``: title, rule ids of wrong and missing entries, next step,
schema number and readers of older ones. Checks between entries are a method ``faults(self) ->
Iterator[Fault]``, asked once every entry by itself is right; its faults come with line and path like all
others, and the key of each is relative to the class's table: ``Fault(key=("column", 2, "unit"), got=...,
expected=..., rule=...)``.

**Files**: `read` and `read_text`; `build` for entries that were parsed or merged elsewhere (``Source``
names file and text, and what was taken from another file); `attempt` where faults are wanted and no
error. `plain` and `toml_text` write; what is read again is equal.
**Answers**: `answer` makes the JSON document of a dataclass, ``"schema": 1`` first; those that a
function builds key by key are typed dictionaries (`declared.answers`). `object_of` reads a document back; a
number that may be NaN is an `OrNan`, and a property that is `derived` stands in the document too. **Pages**:
`starter`, `reference`, `json_schema`.

**To convert a format**: (1) write its malformed files as a parametrised test; (2) declare the classes
with the field names that the code uses; (3) give ``FORMAT`` the rule ids of today; (4) turn checks
between entries into ``faults``; (5) delete the reader; (6) add the class to
`tests/declared/test_declared_formats.py`, which holds that its starter file is valid and its written form
reads back equal.
'''

from toolkit.declared.declaration import table_of
from toolkit.declared.describe import json_schema, reference, starter
from toolkit.declared.documents import object_of
from toolkit.declared.faults import Fault, Source, refuse
from toolkit.declared.marks import (
    Above,
    AtLeast,
    AtMost,
    Below,
    Day,
    Distinct,
    Entry,
    Format,
    Keyed,
    Names,
    OrNan,
    Quantity,
    Short,
    Size,
    Text,
    Unit,
    UnitName,
    derived,
)
from toolkit.declared.text import answer, attempt, build, json_value, plain, read, read_text, toml_text
from toolkit.spelling import nearest

__all__ = [
    "Above",
    "AtLeast",
    "AtMost",
    "Below",
    "Day",
    "Distinct",
    "Entry",
    "Fault",
    "Format",
    "Keyed",
    "Names",
    "OrNan",
    "Quantity",
    "Short",
    "Size",
    "Source",
    "Text",
    "Unit",
    "UnitName",
    "answer",
    "attempt",
    "build",
    "derived",
    "json_schema",
    "json_value",
    "nearest",
    "object_of",
    "plain",
    "read",
    "read_text",
    "reference",
    "refuse",
    "starter",
    "table_of",
    "toml_text",
]
