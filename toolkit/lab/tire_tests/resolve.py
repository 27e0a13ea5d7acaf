"""TEST to result: a folder of recordings or a reduced test, with the record that applies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from toolkit.errors import ConfigError, RecordError
from toolkit.lab.home import calibrations_folder

if TYPE_CHECKING:
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.calibration.registry.registry import Registry
    from toolkit.findings import Finding
    from toolkit.pipeline import TestResult
    from toolkit.recording.model import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolved:
    """A test's result, the record that made it, every finding; the recordings by path if they were read."""

    result: TestResult
    record: CalibrationRecord
    findings: tuple[Finding, ...]
    recordings: tuple[tuple[str, Recording], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Basis:
    """What a test's result rests on.

    The record is ``calibration`` where it is named, else the one in force on the test's date as known at
    ``known_at``; the protocol is that of the file named, else the test's own, else the machine's. A record
    that may not make a number (`registry.standing`) is refused, unless a ``draft`` is asked for: the result
    then says that it is one.
    """

    calibration: str | None = None
    calibrations: Path | None = None
    home: Path | None = None
    known_at: date | None = None
    draft: bool = False
    reader: Literal["calamine", "both"] = "calamine"
    protocol: Path | None = None


def resolve_test(test: Path, basis: Basis, *, step: Callable[[str], None] = lambda _name: None) -> Resolved:
    """Return the result of a TEST argument.

    A reduced test keeps the record that made it, which must still be in the registry, whole and with the same
    hash.

    Raises
    ------
    ToolkitError
        whatever stage cannot go on; nothing is written
    """
    from toolkit.calibration.registry.registry import Registry

    registry = Registry(calibrations_folder(basis.calibrations, basis.home))
    if test.is_dir():
        return _from_folder(test, registry, basis, step)
    if basis.protocol is not None:
        raise ConfigError(
            "a reduced test keeps the protocol that it was reduced by",
            where=test,
            got=f"--protocol {basis.protocol}",
            expected="a folder of recordings",
            next_step="process the recordings again with this protocol",
            rule="protocol-of-reduced",
        )
    return _from_file(test, registry, basis)


def _from_folder(test: Path, registry: Registry, basis: Basis, step: Callable[[str], None]) -> Resolved:
    from toolkit.calibration.registry.standing import standing
    from toolkit.machine import read_protocol
    from toolkit.pipeline import machine_of, process, read_test
    from toolkit.recording.folder import read_test_folder

    folder = read_test_folder(test)
    plan = None if basis.protocol is None else read_protocol(basis.protocol)
    machine = machine_of(folder, plan)
    on = date.fromisoformat(folder.info.date) if folder.info.date else None
    if basis.calibration is None and on is None:
        raise ConfigError(
            "the test has no date, so no calibration record can be chosen",
            where=test / "test.toml",
            got="no date",
            expected="date = YYYY-MM-DD",
            next_step="write the test's date into test.toml, or make a draft with --calibration ID --draft",
            rule="no-date",
        )
    stands = standing(registry, machine.name, on=on, known_at=basis.known_at, named=basis.calibration)
    use = stands.use(draft=basis.draft, where=test)
    recordings = read_test(folder, reader=basis.reader, step=step)
    result = process(folder, recordings, stands.record, protocol=plan, use=use)
    return Resolved(
        result=result,
        record=stands.record,
        findings=(*_findings(use), *result.findings),
        recordings=tuple((recording.name_in(test), recording) for recording in recordings),
    )


def _findings(use: CalibrationUse) -> list[Finding]:
    """Return what stands against a use of a record, as findings: reasons of a draft, later knowledge."""
    from toolkit.findings import Finding

    return [
        *(Finding(rule="draft", where=use.id, message=reason, level="error") for reason in use.draft_reasons),
        *(Finding(rule="known-since", where=use.id, message=text) for text in use.since),
    ]


def _from_file(test: Path, registry: Registry, basis: Basis) -> Resolved:
    from toolkit.calibration.registry.standing import Reason, standing
    from toolkit.recording.marks import is_own_output
    from toolkit.recording.safe_open import gate
    from toolkit.reduction.cells import checked
    from toolkit.testfile import read_test_file

    if not test.exists():
        raise ConfigError(
            "the test does not exist",
            where=test,
            got="no folder and no file",
            expected="a folder with test.toml and recordings, or a reduced test (.xlsx)",
            next_step="check the path",
            rule="no-test",
        )
    if not is_own_output(test):
        gate(test)
        raise ConfigError(
            "a single recording is not a test",
            where=test,
            got="a file",
            expected="a folder with test.toml and recordings, or a reduced test of 'toolkit process'",
            next_step="put it into a folder with a test.toml; 'toolkit inspect' reads single files",
            rule="not-a-test",
        )
    result = read_test_file(test)
    result = replace(result, reduced=checked(result.reduced))
    recorded = result.reduced.calibration
    record = registry.load(recorded.id)
    applied = record if basis.calibration in (None, recorded.id) else registry.load(basis.calibration)
    if applied.sha256 != recorded.sha256:
        raise RecordError(
            "the reduced test was made with another calibration record",
            where=test,
            got=f"{recorded.id}, {recorded.sha256[:16]}...",
            expected=f"{applied.id}, {applied.sha256[:16]}...",
            next_step="process the recordings again with the record that is wanted",
            rule="record-differs",
        )
    info = result.reduced.info
    on = date.fromisoformat(info.date) if info.date else None
    # That a record is of another machine was told when the file was made, and stays with it.
    stands = standing(registry, record.instrument, on=on, known_at=basis.known_at, named=record.id)
    # What the file was made with stays with it: a draft is issued by processing the recordings again.
    own_reasons = tuple(
        Reason(text=one, next_step="process the recordings again with a record in force")
        for one in recorded.draft_reasons
        if one not in {reason.text for reason in stands.reasons}
    )
    use = replace(stands, reasons=(*own_reasons, *stands.reasons)).use(draft=basis.draft, where=test)
    later = dict.fromkeys(one for one in (*recorded.since, *use.since) if one not in use.draft_reasons)
    use = replace(use, since=tuple(later))
    if use != recorded:
        result = replace(result, reduced=replace(result.reduced, calibration=use))
    return Resolved(result=result, record=record, findings=(*_findings(use), *result.findings))
