"""The audit summary's vocabulary: every ``tk:audit.`` tag, its tables, its figure and its conditions."""

from __future__ import annotations

from toolkit.report.entries import Tables, catalogue_of, conditions_of, text_columns, values_of
from toolkit.report.vocabulary import Vocabulary

FIGURES = {"audit_years": "files by the year of their test: right, and not right"}

_VALUES = values_of(
    "audit",
    """
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
    """,
    units={"audit.largest_FY": ("N", ".1f"), "audit.largest_MZ": ("N*m", ".2f")},
)

TABLES: Tables = {
    "audit_grades": (
        "the grades: one row for each that occurs",
        text_columns(
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
        text_columns(
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
        text_columns(
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
        text_columns(
            """
            rule|rule, for 'toolkit explain'
            count|how often
            means|what it means
            do|what to do
            """
        ),
    ),
}

CONDITIONS = conditions_of(
    {
        "reports_to_amend": "a report rests on files that are not right",
        "all_right": "every file is right",
    },
    FIGURES,
    TABLES,
    _VALUES,
)

AUDIT = Vocabulary(
    name="audit",
    catalogue=catalogue_of(_VALUES, FIGURES, TABLES, CONDITIONS),
    figures=FIGURES,
    tables=TABLES,
    conditions=CONDITIONS,
    required=("tk:audit.heads",),
    marks={},
)
