"""`calibrate`, and what the new session says about the years before it: as found, and the control chart."""

from __future__ import annotations

import contextlib
import dataclasses
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.calibration.control.as_found import as_found, as_found_findings, phase_of
from toolkit.calibration.control.chart import chart_findings, control_chart
from toolkit.calibration.registry import settled
from toolkit.calibration.registry.candidate import Candidate
from toolkit.calibration.registry.candidate import calibrate as enter
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import reason_of
from toolkit.calibration.session.read import read_session
from toolkit.errors import ToolkitError
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.calibration.dcc.standard import Standards
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.ledger import Ledger
    from toolkit.calibration.registry.people_log import PeopleLog


class _Rehearsed(Registry):
    """A copy that nobody signs: its lines were judged where they are, and what is tried needs no key."""

    def __init__(self, folder: Path, original: Ledger) -> None:
        super().__init__(folder)
        self._original = original

    def _judged(self, instrument: str, ledger: Ledger, people: PeopleLog) -> Ledger:
        del instrument, people
        return dataclasses.replace(
            ledger, damage=ledger.damage or self._original.damage, void=self._original.void
        )


# A copy of an instrument's folder in which a change can be tried: the registry itself is only read.


@contextlib.contextmanager
def rehearsal(registry: Registry, instrument: str) -> Iterator[Registry]:
    """Yield a registry of one instrument that is thrown away at the end.

    What is done there meets the same gates and answers the same as in the registry; a write that was
    cut off is none of the copy. Errors name the places of the registry.
    """
    with tempfile.TemporaryDirectory(prefix="toolkit-rehearsal-") as place:
        copy = Path(place) / "calibrations"
        copy.mkdir()
        settled.copy_files(registry.folder / instrument, copy / instrument)
        try:
            yield _Rehearsed(copy, registry.ledger(instrument))
        except ToolkitError as error:
            parts = {
                key: text.replace(str(copy), str(registry.folder)) if text else text
                for key, text in error.as_dict().items()
                if key != "what"
            }
            raise type(error)(error.what, **parts) from error


def calibrate(
    session_file: Path,
    registry: Registry,
    *,
    machine: str | None = None,
    again: bool = False,
    standards: Standards | None = None,
) -> Candidate:
    """Enter a session's candidate record and judge it against the instrument's history.

    The history is judged after the record was entered: where it cannot be, that is a finding, not an error.

    Raises
    ------
    ToolkitError
        as `registry.candidate.calibrate`; nothing is written
    """
    candidate = enter(session_file, registry, machine=machine, again=again, standards=standards)
    return dataclasses.replace(
        candidate, findings=candidate.findings + control_findings(registry, candidate.record)
    )


def rehearse(
    session_file: Path,
    registry: Registry,
    *,
    machine: str | None = None,
    again: bool = False,
    standards: Standards | None = None,
) -> Candidate:
    """Return what `calibrate` would, and make nothing: it is done in a copy of the instrument's folder.

    The record has the id and the hash that it would get now, and a path where nothing lies yet.

    Raises
    ------
    ToolkitError
        as `calibrate`
    """
    with rehearsed(session_file, registry, machine=machine, again=again, standards=standards) as (
        copy,
        candidate,
    ):
        return dataclasses.replace(candidate, path=registry.folder / candidate.path.relative_to(copy.folder))


@contextlib.contextmanager
def rehearsed(
    session_file: Path,
    registry: Registry,
    *,
    machine: str | None = None,
    again: bool = False,
    standards: Standards | None = None,
) -> Iterator[tuple[Registry, Candidate]]:
    """Yield a copy of an instrument's registry into which its session was entered, and the candidate there.

    Raises
    ------
    ToolkitError
        as `calibrate`
    """
    instrument = read_session(session_file, standards=standards).instrument
    with rehearsal(registry, instrument) as copy:
        yield copy, calibrate(session_file, copy, machine=machine, again=again, standards=standards)


def control_findings(registry: Registry, record: CalibrationRecord) -> tuple[Finding, ...]:
    """Return the findings of a session's record against the sessions and records before it."""
    findings: tuple[Finding, ...] = ()
    if phase_of(record) == "as_found":
        findings += _judged("as-found", record, lambda: as_found_findings(as_found(registry, record)))
    if record.data_file("check") is not None and len(registry.ids(record.instrument)) > 1:
        findings += _judged(
            "chart", record, lambda: chart_findings(control_chart(registry, record.instrument), record.id)
        )
    return findings


def _judged(
    rule: str, record: CalibrationRecord, judge: Callable[[], tuple[Finding, ...]]
) -> tuple[Finding, ...]:
    try:
        return judge()
    except ToolkitError as error:
        return (Finding(rule=rule, where=record.id, message=f"could not be judged: {reason_of(error)}"),)
