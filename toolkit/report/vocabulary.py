"""A vocabulary: the tags, figures, tables and conditions that one kind of document can ask for.

A test report and a calibration certificate are filled, checked and verified by the same machinery; what
differs is the vocabulary and the content that goes with it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from toolkit.report.entries import Spec, Tables
from toolkit.report.tags import EVERY_TABLE, FIGURES, TERM, catalogue, condition_names


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vocabulary:
    """What a kind of document can say.

    Attributes
    ----------
    name : ``report`` or ``certificate``
    catalogue : every tag, in the order of the manual
    figures, conditions : name to description; ``conditions`` are the names that ``tk:if.`` may have
    tables : name to (description, columns)
    required : tags that every template of the kind must hold
    marks : a mark that must stand in the document, and the tags that make a place for it
    open_values : values beyond the catalogue that some content can have; None for none
    """

    name: str
    catalogue: tuple[Spec, ...]
    figures: Mapping[str, str]
    tables: Tables
    conditions: Mapping[str, str]
    required: tuple[str, ...]
    marks: Mapping[str, frozenset[str]]
    open_values: re.Pattern[str] | None = None

    def value(self, path: str) -> Spec | None:
        """Return the catalogue's entry of a value, None for one that only a content can define."""
        return next((one for one in self.catalogue if one.path == path), None)

    def knows(self, path: str) -> bool:
        """Tell whether a value of that path can exist in some content."""
        found = self.value(path)
        if found is not None:
            return found.kind in ("text", "number", "date")
        return self.open_values is not None and self.open_values.fullmatch(path) is not None

    def knows_condition(self, name: str) -> bool:
        """Tell whether ``tk:if.<name>`` can be asked: a condition, a figure, a table or any value.

        ``tk:if.figure.gough`` and ``tk:if.gough`` ask the same.
        """
        family, _, rest = name.partition(".")
        own: Mapping[str, object] = {"figure": self.figures, "table": self.tables}.get(family, {})
        return name in self.conditions or rest in own or self.knows(name)

    def demanded(self, asked: tuple[str, ...]) -> tuple[str, ...]:
        """Return the tags that a template must hold: the kind's own, and those that a style file asks for.

        One style file serves an organisation's reports and its certificates: a tag of another kind of
        document is not asked of this one.
        """
        return tuple(dict.fromkeys([*self.required, *(one for one in asked if self.of_kind(one))]))

    def of_kind(self, tag: str) -> bool:
        """Tell whether a required tag can be meant for this kind of document."""
        own = _KINDS.get(self.name)
        return tag.startswith(own) if own else not tag.startswith(tuple(_KINDS.values()))


_KINDS = {name: f"tk:{name}." for name in ("certificate", "audit", "comparison", "diagnosis")}

REPORT = Vocabulary(
    name="report",
    catalogue=catalogue(),
    figures=FIGURES,
    tables=EVERY_TABLE,
    conditions=condition_names(),
    required=("tk:calibration.hash",),
    marks={
        "simulated": frozenset({"if.simulated", "simulated"}),
        "unverified": frozenset({"if.unverified", "calibration.status"}),
        "draft": frozenset({"calibration.status"}),
        "impossible": frozenset({"if.impossible"}),
    },
    open_values=TERM,
)

__all__ = ["REPORT", "Vocabulary"]
