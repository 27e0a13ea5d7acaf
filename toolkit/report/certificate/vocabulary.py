"""The certificate's vocabulary: every ``tk:certificate.`` tag, its tables, figures and conditions.

Required of every template are the items without which a paper is no calibration certificate: ISO/IEC
17025:2017, 7.8.2.1 and 7.8.4.1.
"""

from __future__ import annotations

from toolkit.report.columns import Column
from toolkit.report.tags import Kind, Spec
from toolkit.report.vocabulary import Tables, Vocabulary

MOST_FIGURES = 6

_TEXTS = """
id|unique identification of the certificate
title|title
laboratory|name of the laboratory
address|its address
place|where the calibration was done
accreditation|accreditation, where one was stated
customer|name and address of the customer
item|what was calibrated
instrument|instrument
model|form of the calibration equation and method of its fit
method|method of the calibration
phase|state of the item: as found, as left, or not stated
temperature|temperature during the calibration
reference|reference standard
reference_certificate|certificate of the reference standard
traceability|statement of metrological traceability
uncertainty|statement about the expanded uncertainty
decision_rule|decision rule of the conformity statement, and its risk
conformity|statement of conformity, or why there is none
adjustment|results before and after adjustment, or what is known of them
unverifiable|statement about the terms that the check loads could not verify
opinions|opinions and interpretations, marked as such
interval|calibration interval or due date; only where it was agreed
replaces|the certificate that this one replaces
amendment|why it was amended
entered_by|who calibrated and entered the record
checked_by|who checked the record
approved_by|who approved it
in_force_from|first day on which the record is in force
status|status of the calibration record
withdrawn|why and from when the record is void
record|id of the calibration record
record_hash|SHA-256 of the calibration record
ledger_head|hash of the ledger's last line at the issue
software|program and version that made the certificate
record_software|programs and versions that made the record
not_stated|what the session did not state
"""

_DATES = """
issued|date of issue
received|date of receipt of the item, where it was stated
calibrated|date of the calibration
approved_on|day of the approval
"""

FIGURES = {
    f"residuals_{at}": f"residuals of load {at} over the load, with tolerance, uncertainty and check loads"
    for at in range(1, MOST_FIGURES + 1)
}

_CONDITIONS = {
    "simulated": "the instrument is a virtual machine",
    "draft": "the record is not approved, and the paper is no certificate",
    "withdrawn": "the record is withdrawn",
    "amended": "the certificate replaces another one",
    "interval_agreed": "an interval was agreed with the customer and stated",
    "gaps": "something that a certificate should say was not stated",
    "conformity_stated": "conformity is stated",
    "adjusted": "there are results before and after adjustment",
}


def _columns(lines: str) -> tuple[Column, ...]:
    return tuple(
        Column(name=name.strip(), kind="text", description=text)
        for name, text in (line.split("|") for line in lines.strip().splitlines())
    )


TABLES: Tables = {
    "cells": (
        "the indications: one row a cell",
        _columns(
            """
            cell|name
            serial|serial number
            unit|unit of its indication
            minimum|smallest indication of the fitted data
            maximum|largest indication of the fitted data
            resolution|resolution, where it was stated
            """
        ),
    ),
    "coefficients": (
        "the equation of every load: one row a term",
        _columns(
            """
            load|load
            term|term
            full|coefficient in full precision
            issued|coefficient as issued
            standard_error|standard error
            unit|unit of the load for one unit of the term
            """
        ),
    ),
    "uncertainty": (
        "expanded uncertainty at full scale and over the range",
        _columns(
            """
            load|load
            at|value of the load
            percent_fs|the same in percent of full scale
            U|expanded uncertainty, at most two significant digits
            unit|unit of load and uncertainty
            k|coverage factor
            p|coverage probability in percent
            dof|effective degrees of freedom
            """
        ),
    ),
    "budget": (
        "components of the uncertainty at full scale",
        _columns(
            """
            load|load
            component|component
            evaluation|type A or B
            distribution|distribution
            u|standard uncertainty
            unit|unit
            dof|degrees of freedom
            share|share of the variance in percent
            source|what the figure comes from
            """
        ),
    ),
    "fit": (
        "the reference loads and the residuals of the fit: one row a load",
        _columns(
            """
            load|load
            unit|unit
            minimum|smallest reference load
            maximum|largest reference load
            n|number of reference loads
            dof|degrees of freedom
            residual_sd|residual standard deviation
            largest|largest residual, with sign
            """
        ),
    ),
    "check": (
        "the check loads: reference, result and deviation",
        _columns(
            """
            load|load
            row|number of the check load
            reference|reference load
            result|load from the equation
            deviation|result minus reference
            U|expanded uncertainty of the deviation
            tolerance|tolerance
            unit|unit
            verdict|statement of conformity by the decision rule
            """
        ),
    ),
    "adjustment": (
        "before and after adjustment",
        _columns(
            """
            load|load
            found_by|record that was in force when the instrument came in
            as_found|largest deviation as found, by that record
            at|reference load of the largest deviation as found
            as_left|largest deviation of the new equation, check loads where there are some
            tolerance|tolerance
            unit|unit
            U_found|expanded uncertainty of the deviation as found, by the as-found session
            U_left|expanded uncertainty of the deviation as left
            """
        ),
    ),
    "unverifiable": (
        "terms that the check loads could not verify",
        _columns(
            """
            load|load
            term|term
            """
        ),
    ),
}

REQUIRED = (
    "title id laboratory address place customer method item calibrated issued checked_by temperature "
    "uncertainty traceability record_hash ledger_head"
).split()


def _specs(lines: str, kind: Kind) -> list[Spec]:
    return [
        Spec(path=f"certificate.{name}", kind=kind, description=text)
        for name, text in (line.split("|") for line in lines.strip().splitlines())
    ]


def _vocabulary() -> Vocabulary:
    values = [*_specs(_TEXTS, "text"), *_specs(_DATES, "date")]
    captions = [
        Spec(path=f"caption.{name}", kind="text", description=f"caption of the figure: {text}")
        for name, text in FIGURES.items()
    ]
    conditions = dict(_CONDITIONS)
    conditions |= {name: f"there is a figure: {text}" for name, text in FIGURES.items()}
    conditions |= {name: f"the table has rows: {text}" for name, (text, _) in TABLES.items()}
    conditions |= {one.path: f"there is a value: {one.description}" for one in values}
    listed = [
        *values,
        *captions,
        *(Spec(path=f"figure.{name}", kind="figure", description=text) for name, text in FIGURES.items()),
        *(
            Spec(path=f"table.{name}", kind="table", description=text, columns=columns)
            for name, (text, columns) in TABLES.items()
        ),
        *(
            Spec(path=f"if.{name}", kind="if", description=f"kept when {text}")
            for name, text in conditions.items()
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
    ]
    return Vocabulary(
        name="certificate",
        catalogue=tuple(listed),
        figures=FIGURES,
        tables=TABLES,
        conditions=conditions,
        required=tuple(f"tk:certificate.{name}" for name in REQUIRED),
        marks={
            "draft": frozenset({"if.draft"}),
            "simulated": frozenset({"if.simulated"}),
            "withdrawn": frozenset({"if.withdrawn", "certificate.withdrawn"}),
            "amended": frozenset({"certificate.replaces"}),
        },
    )


CERTIFICATE = _vocabulary()
