"""What a document can say of a diagnosis: values, tables and figures, of its own page or of a report's."""

from __future__ import annotations

from toolkit.report.entries import Tables, text_columns, values_of

WHERE = 3  # figures of places at most
FIGURES = {
    "diagnosis_errors": "error on held-out rows over the noise, before and after: the chart of ten seconds",
    **{f"diagnosis_where_{i}": f"where the mismatch is, output {i}" for i in range(1, WHERE + 1)},
    "diagnosis_run": "the run with the largest mismatch, recorded and simulated",
}

VALUES = values_of(
    "diagnosis",
    """
    id|text|identification of the diagnosis, made from its case
    title|text|title of the case
    verdict|text|verdict in one sentence
    summary|text|what was found, in one sentence with numbers; a result
    opinion|text|what is taken for the cause: an opinion, not a result (ISO/IEC 17025, 7.8.7)
    opinion_by|text|who has released the opinion
    basis|text|what the opinion rests on
    where|text|where the mismatch is
    held_out_by|text|what was held out
    remains|text|what remains unexplained
    not_observable|text|effects of which these recordings can tell nothing, and why
    case|text|case file and its hash, which covers the recordings
    calibrations|text|calibration records of the case, with their hashes
    model|text|model file with what was found, and its hash
    complete|text|what a spent budget left out
    issued|date|day of the diagnosis
    software|text|program and version that made it
    """,
)


TABLES: Tables = {
    "found": (
        "effects that were found: statement and equation",
        text_columns(
            """
            effect|effect and the channel it acts on
            class|effects that this recording cannot tell it from
            statement|what it says, in words
            equation|its equation
            """
        ),
    ),
    "found_parameters": (
        "fitted parameters of the effects",
        text_columns(
            """
            effect|effect
            parameter|parameter
            value|fitted value
            unit|unit
            interval|95 % interval
            runs|runs in which it acts
            """
        ),
    ),
    "errors": (
        "root mean square errors on rows that no fit has seen",
        text_columns(
            """
            output|output
            unit|unit
            nominal|simulation as declared
            refitted|its parameters refitted, no new physics
            augmented|with the effects
            noise|noise floor
            """
        ),
    ),
    "rejected": (
        "alternatives that explain the recordings worse",
        text_columns(
            """
            effect|effect that was found
            alternative|effect that was tried in its place
            less|log-likelihood less than with the effect
            """
        ),
    ),
    "nominal": (
        "parameters of the simulation before and after",
        text_columns(
            """
            parameter|parameter
            unit|unit
            before|as declared
            after|with the effects
            prior|prior standard deviation
            shift|change over the prior standard deviation
            """
        ),
    ),
    "not_found": (
        "effects that were not found, and how large each would have had to be",
        text_columns(
            """
            effect|effect
            size|smallest size seen with 80 % power
            unit|unit
            """
        ),
    ),
    "next": ("what to measure next", text_columns("measure|measurement")),
    "recorded": (
        "recordings of the case",
        text_columns(
            """
            run|file
            conditions|its conditions
            rows|rows
            sha256|beginning of the file's hash
            """
        ),
    ),
    "diagnosis_findings": (
        "departures from what was expected",
        text_columns(
            """
            rule|rule, for 'toolkit explain'
            level|error, warning or note
            where|file or channel
            message|what was found
            """
        ),
    ),
}

# A report that is given an answer has what the answer itself holds, without its case's recordings.
_OF_THE_CASE = ("calibrations", "model", "issued", "software")
REPORT_VALUES = tuple(one for one in VALUES if one.path.partition(".")[2] not in _OF_THE_CASE)
REPORT_FIGURES = {"diagnosis_errors": FIGURES["diagnosis_errors"]}
REPORT_TABLES: Tables = {name: entry for name, entry in TABLES.items() if name != "recorded"}
