"""The audit summary's vocabulary: every ``tk:audit.`` tag, its tables, its figure and its conditions."""

from __future__ import annotations

from toolkit.report.columns import Column
from toolkit.report.tags import Spec
from toolkit.report.vocabulary import Tables, Vocabulary

FIGURES = {"audit_years": "files by the year of their test: right, and not right"}

_VALUES = """
id|text|identification of the audit, made from its archive, its registry and its day of knowledge
title|text|title
archive|text|name of the archive's folder
known_at|date|day of knowledge
files|number|files of the archive
right|number|files whose Fy and Mz are those of the record in force
not_right|number|the other files that could be read
unreadable|number|files that could not be read
undated|number|files without a test date
largest_FY|number|largest change of Fy of any row
largest_MZ|number|largest change of Mz of any row
conclusion|text|what the audit found, in one paragraph
heads|text|instruments and the heads of their ledgers
refused|text|records that were left out, with the reason
since_good|text|what a failed as-found session touches, where it was asked for
reports|text|what is known of the reports, where it was asked for
software|text|program and version that made the audit
"""

_UNITS = {"largest_FY": ("N", ".1f"), "largest_MZ": ("N*m", ".2f")}


def _columns(lines: str) -> tuple[Column, ...]:
    return tuple(
        Column(name=name.strip(), kind="text", description=text)
        for name, text in (line.split("|") for line in lines.strip().splitlines())
    )


TABLES: Tables = {
    "audit_grades": (
        "the grades: one row for each that occurs",
        _columns(
            """
            grade|grade
            files|number of files
            share|share of all files in percent
            meaning|what it means
            """
        ),
    ),
    "audit_tests": (
        "the tests that change most",
        _columns(
            """
            test|folder of the test
            date|date of the test
            files|files that are not right, of all
            FY|largest change of Fy of any row, N
            MZ|largest change of Mz of any row, N·m
            stiffness|largest change of the cornering stiffness, percent
            conicity|largest change of the conicity, N
            plysteer|largest change of the plysteer, N
            """
        ),
    ),
    "audit_reports": (
        "the reports that rest on files that are not right",
        _columns(
            """
            report|report
            linked_by|what links it to the archive
            tests|tests that it rests on
            files|files that are not right, of all
            """
        ),
    ),
    "audit_findings": (
        "the findings by rule",
        _columns(
            """
            rule|rule, for 'toolkit explain'
            count|how often
            means|what it means
            do|what to do
            """
        ),
    ),
}

AUDIT = Vocabulary(
    name="audit",
    catalogue=(
        *(
            Spec(
                path=f"audit.{name}",
                kind=kind,  # type: ignore[arg-type]
                description=text,
                unit=_UNITS.get(name, (None, "g"))[0],
                spec=_UNITS.get(name, (None, "g"))[1],
            )
            for name, kind, text in (line.split("|") for line in _VALUES.strip().splitlines())
        ),
        *(Spec(path=f"figure.{name}", kind="figure", description=text) for name, text in FIGURES.items()),
        *(
            Spec(path=f"caption.{name}", kind="text", description=f"caption of the figure {name}")
            for name in FIGURES
        ),
        *(
            Spec(path=f"table.{name}", kind="table", description=text, columns=columns)
            for name, (text, columns) in TABLES.items()
        ),
    ),
    figures=FIGURES,
    tables=TABLES,
    conditions={
        "reports_to_amend": "a report rests on files that are not right",
        "all_right": "every file is right",
        **{name: f"the audit has the figure {name}" for name in FIGURES},
        **{name: f"the audit has rows for the table {name}" for name in TABLES},
    },
    required=("tk:audit.heads",),
    marks={},
)
