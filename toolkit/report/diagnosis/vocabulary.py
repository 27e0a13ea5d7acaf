"""The vocabulary of a diagnosis: every ``tk:diagnosis.`` tag, its tables, figures and conditions."""

from __future__ import annotations

from toolkit.report.diagnosis.entries import FIGURES, TABLES, VALUES, WHERE
from toolkit.report.entries import catalogue_of, conditions_of
from toolkit.report.vocabulary import Vocabulary

CONDITIONS = conditions_of(
    {
        "unverified": "a calibration of the case is not verified",
        "draft": "a calibration of the case is not approved",
        "effects": "an effect was found",
        "no_effects": "no effect was found",
        "incomplete": "the budget was spent before the search was at its end",
    },
    FIGURES,
    TABLES,
    VALUES,
)

DIAGNOSIS = Vocabulary(
    name="diagnosis",
    catalogue=catalogue_of(VALUES, FIGURES, TABLES, CONDITIONS),
    figures=FIGURES,
    tables=TABLES,
    conditions=CONDITIONS,
    required=("tk:diagnosis.case", "tk:diagnosis.id"),
    marks={
        "unverified": frozenset({"if.unverified", "diagnosis.calibrations"}),
        "draft": frozenset({"diagnosis.calibrations"}),
    },
)

__all__ = ["CONDITIONS", "DIAGNOSIS", "FIGURES", "TABLES", "WHERE"]
