"""The vocabulary of a comparison: every ``tk:comparison.`` tag, its tables, figures and conditions."""

from __future__ import annotations

from toolkit.characteristics.catalogue import comparison_figures
from toolkit.report.entries import Tables, catalogue_of, conditions_of, text_columns, values_of
from toolkit.report.vocabulary import Vocabulary

FIGURES = {
    f"compared_{one.name}": f"{one.title} against load, a series an entry" for one in comparison_figures()
}

_VALUES = values_of(
    "comparison",
    """
    id|text|identification of the comparison, made from what is compared
    title|text|title
    mode|text|what the comparison is about
    reference|text|what all others are compared with
    conclusion|text|what was found, in numbers
    method|text|how differences and their significance are decided
    calibrations|text|calibration records of the tests, with their hashes
    reproducibility|text|reproducibility, or why there is none
    shown|text|which rows the tables of differences show
    left_out|text|what could not be compared, and why
    issued|date|day of the comparison
    software|text|program and version that made it
    """,
)


_DIFFERENCES = text_columns(
    """
    quantity|quantity, with slip angle and direction of rotation
    load|load
    unit|unit of the row
    reference|value of the reference, with expanded uncertainty
    label|what is compared with it
    other|its value, with expanded uncertainty
    difference|difference, with expanded uncertainty
    p|p value adjusted over the table
    significant|a star, or nothing
    """
)

TABLES: Tables = {
    "compared": (
        "what is compared: one row a test or a maker's table",
        text_columns(
            """
            label|name
            what|tire, or the kind of table
            surface|surface
            pressure|inflation pressure
            day|date of the test
            operator|operator
            mounting|mounting
            calibration|calibration record
            """
        ),
    ),
    "differences": ("differences of characteristics from the reference", _DIFFERENCES),
    "curve_differences": ("significant differences of FY and MZ at slip angles", _DIFFERENCES),
    "factors": (
        "factors of repeats: what changed between them",
        text_columns(
            """
            factor|factor
            levels|its level in each test
            note|what can be said of it
            """
        ),
    ),
    "precision": (
        "repeatability and intermediate precision: one row a quantity and load",
        text_columns(
            """
            quantity|quantity, with direction of rotation
            load|load
            unit|unit of the row
            n|number of tests
            mean|mean
            s|standard deviation of all
            s_r|repeatability standard deviation, where tests of the same conditions are there
            limit|repeatability limit
            intermediate|intermediate precision by factor; * where the factor adds significantly
            """
        ),
    ),
    "pattern": (
        "pattern effect from a regular and a reversed belt",
        text_columns(
            """
            quantity|definition of PRAT
            load|load
            unit|unit of the row
            regular|PRAT of the regular belt
            reversed|PRAT of the reversed belt
            pattern|pattern effect
            body|body effect
            """
        ),
    ),
    "comparison_findings": (
        "departures from what was expected",
        text_columns(
            """
            rule|rule, for 'toolkit explain'
            level|error, warning or note
            where|test, file or condition
            message|what was found
            """
        ),
    ),
}

CONDITIONS = conditions_of(
    {
        "simulated": "one of the tests is of a virtual machine",
        "unverified": "one of the tests was computed by an unverified record",
        "draft": "one of the tests was computed by a record that was not in force for it",
        "repeats": "the tests are repeats of one tire",
        "no_findings": "nothing departs from what was expected",
    },
    FIGURES,
    TABLES,
    _VALUES,
)

COMPARISON = Vocabulary(
    name="comparison",
    catalogue=catalogue_of(_VALUES, FIGURES, TABLES, CONDITIONS),
    figures=FIGURES,
    tables=TABLES,
    conditions=CONDITIONS,
    required=("tk:comparison.calibrations", "tk:comparison.id"),
    marks={
        "simulated": frozenset({"if.simulated"}),
        "unverified": frozenset({"if.unverified", "comparison.calibrations"}),
        "draft": frozenset({"comparison.calibrations"}),
    },
)
