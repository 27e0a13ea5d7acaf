"""A comparison of laboratories with something in every place of the template."""

from __future__ import annotations

import datetime as dt

from toolkit.comparison.laboratories import LaboratoryComparison, Results, compare_laboratories
from toolkit.report.laboratories.content import ComparedLaboratories

CONICITY = [
    Results(laboratory="A", values=(10.1, 9.9, 10.0), U=0.4),
    Results(laboratory="B", values=(10.4, 10.2), U=0.5),
    Results(laboratory="C", values=(9.7, 9.9), U=0.3),
    Results(laboratory="D", values=(12.0, 12.9), U=0.5),
    Results(laboratory="E", values=(10.0,)),
]
PLYSTEER = [
    Results(laboratory=name, values=values, U=4.0)
    for name, values in (("A", (101.0, 103.0)), ("B", (99.0, 99.4)), ("C", (104.0, 104.7)), ("E", (97.0,)))
]


def comparison() -> LaboratoryComparison:
    """Return two measurands with a consensus, one of them with an outlier."""
    return compare_laboratories(
        {"conicity": CONICITY, "plysteer": PLYSTEER}, unit="N", reference=None, sigma=None
    )


def compared(**changes: object) -> ComparedLaboratories:
    """Return the comparison as its document takes it."""
    entries = {
        "comparison": comparison(), "source": "results.csv", "sha256": "ab" * 32,
        "issued": dt.date(2026, 11, 24),
    }  # fmt: skip
    return ComparedLaboratories(**(entries | changes))  # type: ignore[arg-type]
