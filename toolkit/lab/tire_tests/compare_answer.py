"""What `toolkit compare` answers: the JSON document in SI, and tables for people in the units of choice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict

from toolkit.calibration.records.use import UsedRecord
from toolkit.comparison.laboratories import LaboratoryComparison
from toolkit.comparison.model import Spread
from toolkit.declared.answers import entry_of, merged
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import (
    DeliveredDocument,
    DraftKeys,
    EstimateEntry,
    Timed,
    Timing,
    delivered_keys,
    document_table,
    draft_keys,
    finding_lines,
    mark_words,
    signature_words,
)
from toolkit.listing import table

if TYPE_CHECKING:
    from toolkit.comparison.model import Comparison, Difference, Entry, Precision, Repeats
    from toolkit.report.comparison.content import Compared
    from toolkit.report.deliver import Delivered
    from toolkit.report.style import Style


class ComparedEntry(TypedDict):
    """A test or a table that is compared."""

    label: str
    kind: str
    source: str
    simulated: bool
    calibration: UsedRecord | None
    unverified: bool
    conditions: Annotated[Mapping[str, str | None], "day, operator, surface, ..."]


class DifferenceEntry(TypedDict):
    """One quantity of one entry against the reference."""

    table: str
    quantity: str
    rotation: str | None
    SA_rad: float | None
    load_N: float
    label: str
    reference: EstimateEntry
    other: EstimateEntry
    difference: EstimateEntry
    difference_percent: float | None
    standard_uncertainty_if_nothing_were_shared: float
    p: float | None
    p_holm: Annotated[float | None, "corrected for the number of comparisons"]
    significant: bool


class PatternEffect(TypedDict):
    """A pull divided into what turns with the tread pattern and what turns with the body."""

    quantity: str
    load_N: float
    regular: EstimateEntry
    reversed: EstimateEntry
    pattern: EstimateEntry
    body: EstimateEntry


class FactorEntry(TypedDict):
    """A factor of repeats, and its level in each test."""

    factor: str
    levels: list[str | None]
    varied: bool
    same_as: Annotated[list[str], "factors that changed together with it"]
    note: Annotated[str | None, "why it is not told apart"]


class IntermediateEntry(TypedDict):
    """Intermediate precision with one factor different, ISO 5725-3."""

    factor: str
    levels: int
    s_I: float
    s_between: float | None
    F: float | None
    p: float | None
    p_holm: float | None
    significant: bool


class PrecisionEntry(TypedDict):
    """How well tests of one tire agree in one quantity at one load."""

    quantity: str
    rotation: str
    load_N: float
    n: int
    mean: float
    s: Spread
    repeatability_s_r: Spread | None
    repeatability_limit_r: float | None
    intermediate: list[IntermediateEntry]
    farthest: Annotated[str, "test farthest from the mean"]
    grubbs_p: float | None
    grubbs_p_holm: float | None
    outlier: bool


class RepeatsEntry(TypedDict):
    """Precision of tests of one tire by ISO 5725-3."""

    factors: list[FactorEntry]
    reproducibility: str | None
    reproducibility_note: str
    precision: list[PrecisionEntry]


class WrittenComparison(Timed):
    """What a comparison wrote."""

    figures: Annotated[Mapping[str, Path], "pictures that were written, by name"]
    document: Annotated[DeliveredDocument | None, "Word document and PDF, where they were asked for"]


class CompareAnswer(WrittenComparison, DraftKeys):
    """Tests held against each other, or against a maker's table; SI, angles in rad."""

    mode: str
    axes: str
    level: Annotated[float, "of significance"]
    reference: str
    entries: list[ComparedEntry]
    differences: list[DifferenceEntry]
    significant: Annotated[int, "how many differences are"]
    repeats: Annotated[RepeatsEntry | None, "where tests repeat each other"]
    pattern_effect: list[PatternEffect]
    left_out: Annotated[list[str], "what could not be compared, and why"]

    findings: list[FindingEntry]


class LaboratoryKeys(WrittenComparison):
    """What the answer on laboratories says beside the comparison itself."""

    mode: Annotated[str, "always laboratories"]
    source: str


CompareForms = CompareAnswer | merged(LaboratoryComparison, LaboratoryKeys)
"""Of tests, and with ``--laboratories``."""


def compare_answer(
    comparison: Comparison,
    findings: Sequence[Finding],
    drawn: Mapping[str, Path],
    document: Delivered | None,
    timing: Timing,
) -> CompareAnswer:
    """Return a comparison as the JSON answer, in SI (angles in rad, stiffness per rad) and SAE axes."""
    repeats = comparison.repeats
    return entry_of(
        CompareAnswer, comparison,
        axes="SAE",
        reference=comparison.reference.label,
        entries=[_entry(entry) for entry in comparison.entries],
        differences=[_difference(difference) for difference in comparison.differences],
        significant=sum(difference.significant for difference in comparison.differences),
        repeats=None if repeats is None else _repeats(repeats),
        pattern_effect=[entry_of(PatternEffect, pull, quantity=pull.name) for pull in comparison.pattern],
        findings=[finding.as_dict() for finding in findings],
        **draft_keys(*comparison.uses),
        **written_keys(drawn, document, timing),
    )  # fmt: skip


def written_keys(drawn: Mapping[str, Path], document: Delivered | None, timing: Timing) -> WrittenComparison:
    """Return what an answer says of a comparison's files and of its time."""
    return {
        "figures": drawn,
        "document": None if document is None else delivered_keys(document),
        "timing": timing,
    }


def _entry(entry: Entry) -> ComparedEntry:
    unverified = entry.calibration is not None and entry.calibration.unverified
    return entry_of(ComparedEntry, entry, unverified=unverified)


def _difference(difference: Difference) -> DifferenceEntry:
    base = difference.reference.value
    return entry_of(
        DifferenceEntry, difference,
        table=difference.part, quantity=difference.name,
        difference_percent=100 * difference.difference.value / abs(base) if base else None,
        standard_uncertainty_if_nothing_were_shared=difference.u_apart,
    )  # fmt: skip


def _repeats(repeats: Repeats) -> RepeatsEntry:
    return entry_of(
        RepeatsEntry, repeats,
        factors=[entry_of(FactorEntry, factor, factor=factor.name) for factor in repeats.factors],
        precision=[_precision_entry(precision) for precision in repeats.precisions],
    )  # fmt: skip


def _precision_entry(precision: Precision) -> PrecisionEntry:
    return entry_of(
        PrecisionEntry, precision, quantity=precision.name,
        s=precision.total, repeatability_s_r=precision.repeatability,
        repeatability_limit_r=precision.limit_r,
        intermediate=[entry_of(IntermediateEntry, factor, s_I=factor.s) for factor in precision.factors],
        grubbs_p=precision.outlier_p, grubbs_p_holm=precision.outlier_p_holm,
    )  # fmt: skip


def comparison_text(compared: Compared, style: Style, drawn: Mapping[str, Path]) -> str:
    """Return a comparison for people, with the tables of its document."""
    from toolkit.comparison.model import SECTIONS
    from toolkit.report.comparison import content
    from toolkit.report.comparison.cells import conclusion, shown_rows

    comparison, findings = compared.comparison, compared.findings
    simulated = "  SIMULATED" if any(entry.simulated for entry in comparison.entries) else ""
    marks = simulated + mark_words(*comparison.uses)
    parts = [f"comparison of {comparison.mode}, reference {comparison.reference.label}{marks}"]
    parts += [signature_words(*comparison.uses), _conditions(comparison), conclusion(comparison)]
    tables = {"characteristics": content.differences, "curves": content.curve_differences}
    for part in SECTIONS:
        if any(difference.part == part for difference in comparison.differences):
            parts.append(f"{part}: {shown_rows(comparison, part)[1]}; * marks what is significant")
            parts.append(document_table(tables[part], compared, style))
    parts += [document_table(declared, compared, style) for declared in (content.factors, content.precision)]
    if comparison.repeats is not None:
        parts.append(comparison.repeats.reproducibility_note)
    parts.append(document_table(content.pattern, compared, style))
    if comparison.left_out:
        parts.append("\n".join(f"not compared: {reason}" for reason in comparison.left_out))
    if drawn:
        parts.append("\n".join(str(path) for path in drawn.values()))
    if findings:
        lines = finding_lines(findings)
        parts.append("\n".join([f"findings: {len(findings)} (toolkit explain RULE tells more)", *lines]))
    return "\n\n".join(part_text for part_text in parts if part_text)


def _conditions(comparison: Comparison) -> str:
    """Return what the entries state: what differs as a table, what is the same in one line each."""
    names = dict.fromkeys(name for entry in comparison.entries for name, value in entry.conditions if value)
    rows, shared = [], []
    for name in names:
        values = [entry.condition(name) for entry in comparison.entries]
        if len(set(values)) == 1:
            shared.append(f"{name}: {values[0]}")
        else:
            rows.append([name, *(str(value or "-") for value in values)])
    head = table(
        ["", *(entry.label for entry in comparison.entries)], rows, align="<" * (len(comparison.entries) + 1)
    )
    return "\n".join(
        line for line in (head, "the same in all:" if shared else "", *(f"  {s}" for s in shared)) if line
    )
