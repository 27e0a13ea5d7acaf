"""The document of a diagnosis: what it has of its case and its search, beside what the answer tells."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterator
from typing import TYPE_CHECKING

from toolkit.report.content import Plot, ReportContent
from toolkit.report.diagnosis.answer import DIAGNOSIS, Told
from toolkit.report.diagnosis.plots import WHERE, search_plots
from toolkit.report.document import Rows
from toolkit.version import __version__

if TYPE_CHECKING:
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.diagnose import Result
    from toolkit.report.style import Style


def build_diagnosis_content(
    case: Case,
    result: Result,
    style: Style,
    *,
    issued: dt.date,
    use: CalibrationUse | None = None,
    model_sha256: str | None = None,
    by: str | None = None,
) -> ReportContent:
    """Return everything that a template of a diagnosis can ask for.

    Parameters
    ----------
    use : the calibration that the case names, and how it stands
    model_sha256 : of the answer's model file
    by : who has released the opinion on the cause; without a name the document says that nobody has
    """
    source = Told(
        answer=result.diagnosis,
        by=by,
        case=case,
        search=result.search,
        use=use,
        model_sha256=model_sha256,
        issued=issued,
    )
    return DIAGNOSIS.content(
        source,
        style,
        calibrations=() if use is None else (use,),
        title=source.answer.title,
        identity=source.id,
        subject="Diagnosis: simulation against recording",
        issued=issued,
    )


def diagnosis_plots(result: Result, style: Style) -> dict[str, Plot]:
    """Return the figures of a diagnosis by name; none where nothing was searched."""
    if result.search is None:
        return {}
    return DIAGNOSIS.plots(Told(answer=result.diagnosis, search=result.search), style)


def _calibrations(source: Told, _style: Style) -> str:
    if source.use is None:
        return "none"
    standing = (
        f", {source.use.status}" if source.use.draft else " UNVERIFIED" if source.use.unverified else ""
    )
    return f"{source.use.id} ({source.use.sha256}){standing}"


def _unverified(source: Told, _style: Style) -> bool:
    return source.use is not None and source.use.unverified


def _draft(source: Told, _style: Style) -> str | None:
    return f"Calibration {source.use.id}: {source.use.status}." if source.use and source.use.draft else None


DECLARED = (
    DIAGNOSIS.text("calibrations", "calibration records of the case, with their hashes", _calibrations),
    DIAGNOSIS.text(
        "model",
        "model file with what was found, and its hash",
        lambda source, _: (
            None if source.model_sha256 is None else f"model.toml, SHA-256 {source.model_sha256}"
        ),
    ),
    DIAGNOSIS.date("issued", "day of the diagnosis", lambda source, _: source.issued),
    DIAGNOSIS.text("software", "program and version that made it", lambda *_: f"toolkit {__version__}"),
    DIAGNOSIS.condition("unverified", "a calibration of the case is not verified", _unverified),
    DIAGNOSIS.condition(
        "draft",
        "a calibration of the case is not approved",
        lambda source, style: bool(_draft(source, style)),
    ),
    DIAGNOSIS.condition("effects", "an effect was found", lambda source, _: bool(source.answer.effects)),
    DIAGNOSIS.condition("no_effects", "no effect was found", lambda source, _: not source.answer.effects),
    DIAGNOSIS.condition(
        "incomplete",
        "the budget was spent before the search was at its end",
        lambda source, _: not source.answer.complete,
    ),
    DIAGNOSIS.mark(
        "unverified",
        "if.unverified diagnosis.calibrations",
        lambda source, style: (
            "UNVERIFIED: the calibration is a legacy import." if _unverified(source, style) else None
        ),
    ),
    DIAGNOSIS.mark("draft", "diagnosis.calibrations", _draft),
)


@DIAGNOSIS.table(
    "recorded",
    "recordings of the case",
    """
    run|file
    conditions|its conditions
    rows|rows
    sha256|beginning of the file's hash
    """,
)
def recorded(source: Told, _style: Style) -> Rows:
    """Return the recordings of the case."""
    for run in source.case.runs if source.case else ():
        conditions = ", ".join(f"{key} {value}" for key, value in run.conditions.items())
        yield run.name, conditions or "-", str(run.rows), run.sha256[:16]


@DIAGNOSIS.figures(
    {
        **{f"diagnosis_where_{i}": f"where the mismatch is, output {i}" for i in range(1, WHERE + 1)},
        "diagnosis_run": "the run with the largest mismatch, recorded and simulated",
    }
)
def mismatches(source: Told, style: Style) -> Iterator[Plot]:
    """Return where the mismatch is, and the run with the largest; nothing where nothing was searched."""
    if source.search is not None:
        yield from search_plots(source.search, source.answer, style)
