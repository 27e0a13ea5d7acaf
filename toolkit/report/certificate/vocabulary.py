"""The certificate's vocabulary: every ``tk:certificate.`` tag, its tables, figures and conditions.

Required of every template are the items without which a paper is no calibration certificate: ISO/IEC
17025:2017, 7.8.2.1 and 7.8.4.1.
"""

from __future__ import annotations

from toolkit.report.entries import Tables, catalogue_of, conditions_of, text_columns, values_of
from toolkit.report.vocabulary import Vocabulary

MOST_FIGURES = 6

_VALUES = values_of(
    "certificate",
    """
    id|text|unique identification of the certificate
    title|text|title
    laboratory|text|name of the laboratory
    address|text|its address
    place|text|where the calibration was done
    accreditation|text|accreditation, where one was stated
    customer|text|name and address of the customer
    item|text|what was calibrated
    instrument|text|instrument
    model|text|form of the calibration equation and method of its fit
    method|text|method of the calibration
    phase|text|state of the item: as found, as left, or not stated
    temperature|text|temperature during the calibration
    reference|text|reference standard
    reference_certificate|text|certificate of the reference standard
    traceability|text|statement of metrological traceability
    uncertainty|text|statement about the expanded uncertainty
    decision_rule|text|decision rule of the conformity statement, and its risk
    conformity|text|statement of conformity, or why there is none
    adjustment|text|results before and after adjustment, or what is known of them
    unverifiable|text|statement about the terms that the check loads could not verify
    opinions|text|opinions and interpretations, marked as such
    interval|text|calibration interval or due date; only where it was agreed
    replaces|text|the certificate that this one replaces
    amendment|text|why it was amended
    entered_by|text|who calibrated and entered the record
    checked_by|text|who checked the record
    approved_by|text|who approved it
    in_force_from|text|first day on which the record is in force
    status|text|status of the calibration record
    withdrawn|text|why and from when the record is void
    record|text|id of the calibration record
    record_hash|text|SHA-256 of the calibration record
    ledger_head|text|hash of the ledger's last line at the issue
    software|text|program and version that made the certificate
    record_software|text|programs and versions that made the record
    not_stated|text|what the session did not state
    issued|date|date of issue
    received|date|date of receipt of the item, where it was stated
    calibrated|date|date of the calibration
    approved_on|date|day of the approval
    """,
)

FIGURES = {
    f"residuals_{at}": f"residuals of load {at} over the load, with tolerance, uncertainty and check loads"
    for at in range(1, MOST_FIGURES + 1)
}


TABLES: Tables = {
    "cells": (
        "the indications: one row a cell",
        text_columns(
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
        text_columns(
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
        text_columns(
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
        text_columns(
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
        text_columns(
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
        text_columns(
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
        text_columns(
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
        text_columns(
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


CONDITIONS = conditions_of(
    {
        "simulated": "the instrument is a virtual machine",
        "draft": "the record is not approved, and the paper is no certificate",
        "withdrawn": "the record is withdrawn",
        "amended": "the certificate replaces another one",
        "interval_agreed": "an interval was agreed with the customer and stated",
        "gaps": "something that a certificate should say was not stated",
        "conformity_stated": "conformity is stated",
        "adjusted": "there are results before and after adjustment",
    },
    FIGURES,
    TABLES,
    _VALUES,
)

CERTIFICATE = Vocabulary(
    name="certificate",
    catalogue=catalogue_of(_VALUES, FIGURES, TABLES, CONDITIONS),
    figures=FIGURES,
    tables=TABLES,
    conditions=CONDITIONS,
    required=tuple(f"tk:certificate.{name}" for name in REQUIRED),
    marks={
        "draft": frozenset({"if.draft"}),
        "simulated": frozenset({"if.simulated"}),
        "withdrawn": frozenset({"if.withdrawn", "certificate.withdrawn"}),
        "amended": frozenset({"certificate.replaces"}),
    },
)
