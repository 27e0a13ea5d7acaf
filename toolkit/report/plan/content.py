"""A plan's sheet as a document: what to do, what it is expected to give, what it assumes and gives up."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

from toolkit.files import sha256_bytes
from toolkit.findings import Finding
from toolkit.report.content import Plot, ReportContent
from toolkit.report.document import Document, Rows, finding_table
from toolkit.report.style import Style
from toolkit.version import __version__

_SUBJECTS = {
    "session": "Plan of a calibration session",
    "test": "Plan of a tire test",
    "next": "Plan of the next run",
    "interval": "Plan of a calibration interval",
}
_MOST_PREDICTIONS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """An uncertainty that a plan is expected to give, in ``unit``; texts, as they are printed.

    ``reference`` is that of the record in force, or of the machine's protocol; ``span`` how sure it is.
    """

    quantity: str
    at: str
    unit: str
    reference: str
    asked: str
    expected: str
    span: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """A step of the operator: its run, what to do, and what is then applied."""

    run: str
    action: str
    applied: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSheet:
    """A plan of any kind, as its sheet prints it.

    ``basis`` is what it was planned from, ``size`` what it takes, ``summary`` what it gives. ``pairs`` (of
    a run that parts a class) and ``risks`` (of intervals) are rows of their tables.
    """

    kind: Literal["session", "test", "next", "interval"]
    subject: str
    basis: str
    size: str
    summary: str
    issued: dt.date
    uncertainties: tuple[Expected, ...] = ()
    steps: tuple[Step, ...] = ()
    pairs: tuple[tuple[str, ...], ...] = ()
    risks: tuple[tuple[str, ...], ...] = ()
    plots: tuple[Plot, ...] = ()
    assumptions: tuple[str, ...]
    gives_up: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def title(self) -> str:
        """What is planned, and for what."""
        return f"{_SUBJECTS[self.kind]}: {self.subject}"

    @property
    def id(self) -> str:
        """Identification: the same plan has the same on any day."""
        key = "\n".join(map(repr, (self.title, self.basis, self.steps, self.pairs, self.risks)))
        return f"PLAN-{sha256_bytes(key.encode())[:8].upper()}"


PLAN: Document[PlanSheet] = Document(
    name="plan", family="plan", package=__package__, required=("tk:plan.basis", "tk:plan.id")
)


def build_plan_content(sheet: PlanSheet, style: Style) -> ReportContent:
    """Return everything that a template of a plan's sheet can ask for."""
    return PLAN.content(
        sheet, style, title=sheet.title, identity=sheet.id, subject=_SUBJECTS[sheet.kind], issued=sheet.issued
    )


DECLARED = (
    PLAN.text("id", "identification of the plan, made from what it says", lambda sheet, _: sheet.id),
    PLAN.text("title", "title: what is planned, and for what", lambda sheet, _: sheet.title),
    PLAN.text("basis", "record, test or answer that it was planned from", lambda sheet, _: sheet.basis),
    PLAN.text("size", "what it takes: loads or rows, and the time", lambda sheet, _: sheet.size),
    PLAN.text("summary", "what it is expected to give", lambda sheet, _: sheet.summary),
    PLAN.date("issued", "day of the plan", lambda sheet, _: sheet.issued),
    PLAN.text("software", "program and version that made it", lambda *_: f"toolkit {__version__}"),
    finding_table(PLAN, "plan_findings", "instrument, record or load", lambda sheet: sheet.findings),
)


@PLAN.table(
    "plan_uncertainties",
    "what a session or a test is expected to give: one row a load or characteristic",
    """
    quantity|load or characteristic
    at|at which load
    unit|unit of the row
    reference|U of the record in force, or by the machine's protocol
    asked|U that was asked for
    expected|U that is expected, 95 %
    span|U that nine of ten sessions keep, or U by one standard uncertainty of the scatter
    """,
)
def uncertainties(sheet: PlanSheet, style: Style) -> Rows:
    """Return the uncertainties that are expected."""
    for row in sheet.uncertainties:
        numbers = (row.reference, row.asked, row.expected, row.span)
        yield row.quantity, style.decimal(row.at), row.unit, *(style.decimal(text) for text in numbers)


@PLAN.table(
    "plan_steps",
    "what the operator does, in this order",
    """
    step|number
    run|run, or direction of the drum
    action|what to do
    applied|loads, or values that are set
    done|room for a mark
    """,
)
def steps(sheet: PlanSheet, style: Style) -> Rows:
    """Return the steps, numbered."""
    return (
        (str(number), step.run, step.action, style.decimal(step.applied), "")
        for number, step in enumerate(sheet.steps, start=1)
    )


@PLAN.table(
    "plan_pairs",
    "what a run parts: expected log-evidence of a member over another",
    """
    true|the member that is true
    other|the member that it is held against
    recorded|by the recordings
    repeat|by a repeat of the best recording
    expected|by the run that is proposed
    """,
)
def pairs(sheet: PlanSheet, style: Style) -> Rows:
    """Return the pairs of members."""
    return ((true, false, *(style.decimal(text) for text in gains)) for true, false, *gains in sheet.pairs)


@PLAN.table(
    "plan_risks",
    "what intervals risk, the shortest first",
    """
    days|days from session to session
    beyond|chance to be beyond the tolerance at its end, percent
    sessions|sessions a year
    recalled|tests that are recalled a year, where tests a year were stated
    """,
)
def risks(sheet: PlanSheet, style: Style) -> Rows:
    """Return the intervals with their risks."""
    return (tuple(style.decimal(text) for text in row) for row in sheet.risks)


@PLAN.table("plan_assumptions", "what the plan rests on", "text|statement")
def assumptions(sheet: PlanSheet, _style: Style) -> Rows:
    """Return what the plan rests on."""
    return ((text,) for text in sheet.assumptions)


@PLAN.table("plan_given_up", "what the plan gives up", "text|statement")
def given_up(sheet: PlanSheet, _style: Style) -> Rows:
    """Return what the plan gives up."""
    return ((text,) for text in sheet.gives_up)


@PLAN.figures(
    {
        f"plan_figure_{number}": f"figure {number} of the plan: what each member predicts of an output, "
        "or what an interval risks"
        for number in range(1, _MOST_PREDICTIONS + 1)
    }
)
def figures(sheet: PlanSheet, _style: Style) -> Iterator[Plot]:
    """Return the first figures of the plan."""
    for number, plot in enumerate(sheet.plots[:_MOST_PREDICTIONS], start=1):
        yield replace(plot, name=f"plan_figure_{number}")
