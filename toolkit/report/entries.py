"""Entries of a vocabulary, made from what a kind of document lists: values, figures, tables, conditions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal, cast

from toolkit.report.columns import Column

Kind = Literal["text", "number", "date", "figure", "table", "if", "row"]
Tables = Mapping[str, tuple[str, tuple[Column, ...]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spec:
    """One entry of the catalogue."""

    path: str
    kind: Kind
    description: str
    unit: str | None = None
    spec: str = "g"
    columns: tuple[Column, ...] = ()


def text_columns(lines: str) -> tuple[Column, ...]:
    r"""Return columns of text from lines ``name|description``.

    >>> [one.name for one in text_columns("load|load of the row\nunit|its unit")]
    ['load', 'unit']
    """
    return tuple(
        Column(name=name.strip(), kind="text", description=text)
        for name, text in (line.split("|") for line in lines.strip().splitlines())
    )


def values_of(
    family: str, lines: str, units: Mapping[str, tuple[str, str]] | None = None
) -> tuple[Spec, ...]:
    """Return the values ``tk:<family>.<name>`` from lines ``name|kind|description``.

    ``units`` is the unit and the default format of each path that has some.

    >>> [(one.path, one.kind) for one in values_of("audit", "id|text|its identification")]
    [('audit.id', 'text')]
    """
    made = []
    for line in lines.strip().splitlines():
        name, kind, text = line.split("|")
        path = f"{family}.{name.strip()}"
        unit, spec = (units or {}).get(path, (None, "g"))
        made.append(Spec(path=path, kind=cast("Kind", kind), description=text, unit=unit, spec=spec))
    return tuple(made)


def conditions_of(
    own: Mapping[str, str], figures: Mapping[str, str], tables: Tables, values: Iterable[Spec]
) -> dict[str, str]:
    """Return every name that ``tk:if.<name>`` may have: a kind's own conditions, figures, tables and values.

    A condition and a table of one name ask the condition.
    """
    names = dict(own)
    names |= {name: f"there is a figure: {text}" for name, text in figures.items()}
    names |= {name: f"the table has rows: {text}" for name, (text, _) in tables.items() if name not in names}
    return names | {one.path: f"there is a value: {one.description}" for one in values}


def catalogue_of(
    values: Iterable[Spec], figures: Mapping[str, str], tables: Tables, conditions: Mapping[str, str]
) -> tuple[Spec, ...]:
    """Return every entry in the order of the manual: values, captions, figures, tables, conditions, rows."""
    captions = [
        Spec(path=f"caption.{name}", kind="text", description=f"caption of the figure: {text}")
        for name, text in figures.items()
    ]
    drawn = [Spec(path=f"figure.{name}", kind="figure", description=text) for name, text in figures.items()]
    listed = [
        Spec(path=f"table.{name}", kind="table", description=text, columns=columns)
        for name, (text, columns) in tables.items()
    ]
    asked = [
        Spec(path=f"if.{name}", kind="if", description=f"kept when {text}")
        for name, text in conditions.items()
    ]
    rows = [
        Spec(
            path=f"row.{column.name}",
            kind="row",
            unit=column.unit,
            spec=column.spec,
            description=f"{column.description} (in the prototype row of tk:table.{name})",
        )
        for name, (_, columns) in tables.items()
        for column in columns
    ]
    return (*values, *captions, *drawn, *listed, *asked, *rows)
