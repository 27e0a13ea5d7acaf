"""Decimals that a style file states by name, against the unit that it chooses beside them."""

from __future__ import annotations

from collections.abc import Iterator

from toolkit.report.style import Style, kept
from toolkit.report.vocabulary import Vocabulary
from toolkit.report.word.lint import LintFinding


def coarse_decimals(style: Style, words: Vocabulary) -> Iterator[LintFinding]:
    """Yield each name whose decimals were right in another unit: whole newtons are no whole kilonewtons.

    Decimals by unit hold for that unit alone; those of a tag or a column hold whatever the unit is.
    """
    printed = [([entry.path], entry.unit, entry.spec) for entry in words.values]
    printed += [
        ([f"{name}.{column.name}", column.name], column.unit, column.spec)
        for name, table in words.tables.items()
        for column in table.columns
        if column.quantity
    ]
    said = set()
    for names, stated_in, spec in printed:
        unit, factor = style.unit(stated_in)
        digits, needed = style.digits(*names), kept(spec, factor)
        name = next((name for name in names if style.digits(name) is not None), "")
        if digits is None or needed == spec or digits >= int(needed[1:-1]) or name in said:
            continue
        said.add(name)
        yield LintFinding(
            rule="coarse-decimals", level="warning", part="style file", place=f"[decimals] {name}",
            message=f"{name} = {digits} prints {digits} decimals of {unit}; without it {needed[1:-1]} are "
            f"printed, as fine as {spec[1:-1]} of {stated_in}: values that differ print alike",
        )  # fmt: skip
