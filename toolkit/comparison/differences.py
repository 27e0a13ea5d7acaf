"""Differences from the reference, each with what is left of the uncertainty when the shared has cancelled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from toolkit.characteristics.catalogue import compared
from toolkit.characteristics.model import Row
from toolkit.characteristics.uncertain import Uncertain, weighted
from toolkit.comparison.at_load import at_load
from toolkit.comparison.model import PARTS, Difference, Entry, Part, PatternEffect
from toolkit.comparison.significance import holm, two_sided_p
from toolkit.units import in_both

Series = tuple[str, str, float | None]
_SAME_ANGLE = 1e-6  # rad


def series_of(rows: Sequence[Row]) -> dict[Series, list[Row]]:
    """Return the rows that are compared, by (name, rotation, slip angle)."""
    series: dict[Series, list[Row]] = {}
    for row in rows:
        if row.characteristic.compared:
            angle = None if row.SA_rad is None else round(row.SA_rad / _SAME_ANGLE) * _SAME_ANGLE
            series.setdefault((row.name, row.rotation, angle), []).append(row)
    return series


def differences(entries: Sequence[Entry], *, level: float) -> tuple[tuple[Difference, ...], tuple[str, ...]]:
    """Return every difference of the others from the first entry, and what could not be compared.

    Significance is decided over each table as a whole: characteristics, and forces at slip angles.
    """
    reference = entries[0]
    base = series_of(reference.rows)
    compared_rows: list[Difference] = []
    left_out: list[str] = []
    for other in entries[1:]:
        other_series = series_of(other.rows)
        lacking: dict[str, None] = {}
        beyond: dict[float, None] = {}
        for series, rows in base.items():
            if series not in other_series:
                lacking[_said(series)] = None
                continue
            for row in sorted(rows, key=lambda row: row.load_N):
                number = at_load(other_series[series], row.load_N, owner=other.identity)
                if number is None:
                    beyond[round(row.load_N)] = None
                else:
                    compared_rows.append(_difference(series, row, number, other.label))
        left_out += _left_out(other.label, lacking, beyond)
    return tuple(row for part in PARTS for row in _decided(compared_rows, part, level)), tuple(left_out)


def _difference(series: Series, row: Row, number: Uncertain, label: str) -> Difference:
    name, rotation, angle = series
    difference = weighted([(1.0, number), (-1.0, row.number)]).estimate()
    reference, other = row.number.estimate(), number.estimate()
    return Difference(
        part="curves" if angle is not None else "characteristics",
        name=name,
        rotation=rotation,
        SA_rad=angle,
        load_N=row.load_N,
        label=label,
        reference=reference,
        other=other,
        difference=difference,
        u_apart=math.hypot(reference.u, other.u),
        p=two_sided_p(difference.value, difference.u, difference.dof),
        p_holm=None,
        significant=False,
    )


def _decided(differences: Sequence[Difference], part: Part, level: float) -> list[Difference]:
    table = [difference for difference in differences if difference.part == part]
    adjusted = holm([difference.p for difference in table])
    return [
        replace(difference, p_holm=p, significant=p is not None and p < level)
        for difference, p in zip(table, adjusted, strict=True)
    ]


def _said(series: Series) -> str:
    name, rotation, angle = series
    return name + ("" if rotation == "both" else f" {rotation}") if angle is None else f"{name} {rotation}"


def _left_out(label: str, lacking: dict[str, None], beyond: dict[float, None]) -> list[str]:
    sentences = []
    if lacking:
        sentences.append(f"{label} has no {', '.join(lacking)}")
    if beyond:
        sentences.append(f"{label} does not reach the load {in_both(list(beyond), 'N', '.0f')}")
    return sentences


def pattern_effects(entries: Sequence[Entry]) -> tuple[PatternEffect, ...]:
    """Return the pattern effects of two prototypes whose belt cords mirror each other.

        pattern effect = (PRAT_regular + PRAT_reversed)/2,   body effect = (PRAT_regular - PRAT_reversed)/2

    The belt's part of PRAT changes its sign with the cords, the tread's does not (source document, 6.1.1). By
    either definition of PRAT, at 0 deg and at FY = 0; empty without one regular and one reversed belt.
    """
    regular = [entry for entry in entries if entry.condition("belt") == "regular"]
    turned = [entry for entry in entries if entry.condition("belt") == "reversed"]
    if len(regular) != 1 or len(turned) != 1:
        return ()
    regular_series, turned_series = series_of(regular[0].rows), series_of(turned[0].rows)
    effects = []
    for declared in compared():
        series = (declared.name, "both", None)
        if not declared.belt_sign or series not in turned_series:
            continue
        for row in sorted(regular_series.get(series, ()), key=lambda row: row.load_N):
            other = at_load(turned_series[series], row.load_N, owner=turned[0].identity)
            if other is not None:
                effects.append(
                    PatternEffect(
                        name=declared.name,
                        load_N=row.load_N,
                        regular=row.number.estimate(),
                        reversed=other.estimate(),
                        pattern=weighted([(0.5, row.number), (0.5, other)]).estimate(),
                        body=weighted([(0.5, row.number), (-0.5, other)]).estimate(),
                    )
                )
    return tuple(effects)
