"""Pattern effect: what the tread adds to PRAT, from two prototypes whose belt cords mirror each other.

    pattern effect = (PRAT_regular + PRAT_reversed)/2,   body effect = (PRAT_regular - PRAT_reversed)/2

The belt's part of PRAT changes its sign with the cords, the tread's does not (source document, 6.1.1). By
either definition of PRAT, at 0 deg and at FY = 0.
"""

from __future__ import annotations

from collections.abc import Sequence

from toolkit.characteristics.uncertain import weighted
from toolkit.comparison.at_load import at_load
from toolkit.comparison.differences import series_of
from toolkit.comparison.model import Entry, PatternEffect

NAMES = ("PRAT", "PRAT_at_FY_zero")


def pattern_effect(entries: Sequence[Entry]) -> tuple[PatternEffect, ...]:
    """Return the pattern effect of the one regular and the one reversed belt; empty without such a pair."""
    regular = [one for one in entries if one.condition("belt") == "regular"]
    turned = [one for one in entries if one.condition("belt") == "reversed"]
    if len(regular) != 1 or len(turned) != 1:
        return ()
    ours, theirs = series_of(regular[0].rows), series_of(turned[0].rows)
    found = []
    for name in NAMES:
        series = (name, "both", None)
        for row in sorted(ours.get(series, ()), key=lambda one: one.load_N):
            other = (
                at_load(theirs[series], row.load_N, owner=turned[0].identity) if series in theirs else None
            )
            if other is not None:
                found.append(
                    PatternEffect(
                        name=name,
                        load_N=row.load_N,
                        regular=row.number.estimate(),
                        reversed=other.estimate(),
                        pattern=weighted([(0.5, row.number), (0.5, other)]).estimate(),
                        body=weighted([(0.5, row.number), (-0.5, other)]).estimate(),
                    )
                )
    return tuple(found)
