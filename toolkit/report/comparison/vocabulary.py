"""The vocabulary of a comparison: every ``tk:comparison.`` tag, its tables, figures and conditions."""

from __future__ import annotations

from toolkit.report.columns import Column
from toolkit.report.comparison.plots import FIGURES as DRAWN
from toolkit.report.tags import Spec
from toolkit.report.vocabulary import Tables, Vocabulary

FIGURES = {f"compared_{one.name}": f"{one.title} against load, a series an entry" for one in DRAWN}

_VALUES = """
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
"""


def _columns(lines: str) -> tuple[Column, ...]:
    return tuple(
        Column(name=name.strip(), kind="text", description=text)
        for name, text in (line.split("|") for line in lines.strip().splitlines())
    )


_DIFFERENCES = _columns(
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
        _columns(
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
        _columns(
            """
            factor|factor
            levels|its level in each test
            note|what can be said of it
            """
        ),
    ),
    "precision": (
        "repeatability and intermediate precision: one row a quantity and load",
        _columns(
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
        _columns(
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
        _columns(
            """
            rule|rule, for 'toolkit explain'
            level|error, warning or note
            where|test, file or condition
            message|what was found
            """
        ),
    ),
}

CONDITIONS = {
    "simulated": "one of the tests is of a virtual machine",
    "unverified": "one of the tests was computed by an unverified record",
    "repeats": "the tests are repeats of one tire",
    "no_findings": "nothing departs from what was expected",
    **{name: f"there is a figure: {text}" for name, text in FIGURES.items()},
    **{name: f"the table has rows: {text}" for name, (text, _) in TABLES.items()},
    **{
        f"comparison.{name}": f"there is a value: {text}"
        for name, _, text in (line.split("|") for line in _VALUES.strip().splitlines())
    },
}

COMPARISON = Vocabulary(
    name="comparison",
    catalogue=(
        *(
            Spec(path=f"comparison.{name}", kind=kind, description=text)  # type: ignore[arg-type]
            for name, kind, text in (line.split("|") for line in _VALUES.strip().splitlines())
        ),
        *(Spec(path=f"figure.{name}", kind="figure", description=text) for name, text in FIGURES.items()),
        *(
            Spec(path=f"caption.{name}", kind="text", description=f"caption of the figure: {text}")
            for name, text in FIGURES.items()
        ),
        *(
            Spec(path=f"table.{name}", kind="table", description=text, columns=columns)
            for name, (text, columns) in TABLES.items()
        ),
        *(
            Spec(path=f"if.{name}", kind="if", description=f"kept when {text}")
            for name, text in CONDITIONS.items()
        ),
        *(
            Spec(
                path=f"row.{column.name}",
                kind="row",
                description=f"{column.description} (in the prototype row of tk:table.{name})",
            )
            for name, (_, columns) in TABLES.items()
            for column in columns
        ),
    ),
    figures=FIGURES,
    tables=TABLES,
    conditions=CONDITIONS,
    required=("tk:comparison.calibrations", "tk:comparison.id"),
    marks={
        "simulated": frozenset({"if.simulated"}),
        "unverified": frozenset({"if.unverified", "comparison.calibrations"}),
    },
)
