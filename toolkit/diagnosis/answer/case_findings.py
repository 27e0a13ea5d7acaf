"""What a reader of an answer must know of the case itself: one run, filled samples, the record's state."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.records.use import UNSIGNED, CalibrationUse
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.standing import unapproved, withdrawal
from toolkit.diagnosis.case.repeats import repeated_runs
from toolkit.diagnosis.simulators.cells import record_of
from toolkit.errors import RegistryError
from toolkit.findings import Finding
from toolkit.inputs import is_regular
from toolkit.recording.hidden import hidden_findings

if TYPE_CHECKING:
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.fit.problem import Problem


def case_findings(problem: Problem) -> tuple[Finding, ...]:
    """Return notes on the recordings, one run only or inputs interpolated, and what the model has to tell."""
    case = problem.case
    findings: list[Finding] = list(problem.model.capability.findings)
    if case.simulated:
        findings.append(
            Finding(
                rule="case-simulated", where=case.path.name, level="note",
                message="the recordings are simulated: no real machine was measured",
            )
        )  # fmt: skip
    if len(problem.runs) == 1:
        findings.append(
            Finding(
                rule="case-one-run",
                where=case.path.name,
                level="note",
                message="one run only: contiguous blocks of it are held out, not whole runs",
            )
        )
    for place, earlier in repeated_runs(case.runs).items():
        findings.append(
            Finding(
                rule="case-equal-runs",
                where=case.runs[place].name,
                level="warning",
                message=f"every reading is that of {earlier}: of coarse or still readings that may be",
            )
        )
    for run in (*case.runs, *case.predict):
        findings += hidden_findings(run.hidden, run.name)
        if run.filled:
            counts = ", ".join(f"{count} of {name}" for name, count in run.filled)
            findings.append(
                Finding(
                    rule="case-filled",
                    where=run.name,
                    level="note",
                    message=f"missing samples of inputs were interpolated between their neighbours: {counts}",
                )
            )
    for name in ("FZ", "FZ_CMD"):
        loads = [run.columns[name] for run in case.runs if name in run.columns]
        if loads and float(np.nanmedian(np.concatenate(loads))) < 0:
            findings.append(
                Finding(
                    rule="case-load-sign",
                    where=f"{case.path.name}: {name}",
                    level="note",
                    message="most loads are negative: FZ is the load, positive; below zero there is no force",
                )
            )
    return tuple(findings)


def calibration_use(case: Case, calibrations: Path | None) -> CalibrationUse | None:
    """Return the calibration that a case names, and how it stands; None where it names none.

    A case has no date of its own: a record counts as in force where it is approved and not void on every day.
    A candidate is accepted, and what is made with it says that it is a draft.
    """
    name = case.simulation.calibration
    if not name:
        return None
    record = record_of(case, calibrations)
    reasons: tuple[str, ...] = ()
    signature = UNSIGNED
    if is_regular(case.path.parent / name):
        reasons = ("a file beside the case: no registry says whether it is approved",)
    elif calibrations is not None:
        registry = Registry(calibrations)
        try:
            status, signature = registry.status(record.id), registry.signature(record.id)
            states = withdrawal(status) or unapproved(registry, record, status)
            reasons = tuple(state.text for state in states)
        except RegistryError as error:
            reasons = (f"not approved: {error.what}",)
    return CalibrationUse(
        id=record.id,
        sha256=record.sha256,
        unverified=not record.verified,
        draft_reasons=reasons,
        signature=signature,
    )


def calibration_findings(case: Case, calibrations: Path | None) -> tuple[Finding, ...]:
    """Return notes on the calibration of a case that is no approved record, or an unverified one."""
    use = calibration_use(case, calibrations)
    if use is None:
        return ()
    reasons = list(use.draft_reasons)
    if use.unverified:
        reasons.append("imported, not fitted here: unverified")
    return tuple(
        Finding(rule="case-calibration", where=use.id, level="note", message=f"the calibration is {reason}")
        for reason in reasons
    )
