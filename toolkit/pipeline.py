"""Raw recordings to characteristics: the only place that chains the stages."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.records.use import CalibrationUse
from toolkit.characteristics.characterise import characterise
from toolkit.characteristics.model import Characteristics
from toolkit.errors import ConfigError, RecordingError
from toolkit.findings import Finding
from toolkit.machine import Machine, Protocol, load_machine, own_text
from toolkit.recording.cut import cut_findings
from toolkit.recording.folder import TestFolder
from toolkit.recording.hidden import hidden_findings
from toolkit.recording.model import Recording
from toolkit.recording.read import read_recording
from toolkit.reduction.corrections import tare_of_file
from toolkit.reduction.health import health_findings
from toolkit.reduction.model import ReducedTest, Tare
from toolkit.reduction.reduce import reduce_test
from toolkit.reduction.sweep import sweeps_of


@dataclass(frozen=True, slots=True, kw_only=True)
class TestResult:
    """A test from end to end."""

    __test__ = False  # not a pytest class

    reduced: ReducedTest
    characteristics: Characteristics

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of every stage."""
        return (*self.reduced.findings, *self.characteristics.findings)


def read_test(
    folder: TestFolder,
    *,
    reader: Literal["calamine", "both"] = "calamine",
    step: Callable[[str], None] = lambda _name: None,
) -> tuple[Recording, ...]:
    """Read every recording of a test, all or nothing; ``step`` is told each name."""
    machine = load_machine(folder.info.machine)
    recordings = []
    for path in folder.files:
        recordings.append(read_recording(path, machine, reader=reader))
        step(path.name)
    return tuple(recordings)


def machine_of(folder: TestFolder, protocol: Protocol | None = None) -> Machine:
    """Return a test's machine with the protocol that applies: ``protocol``, the test's own, the machine's.

    Raises
    ------
    ConfigError
        ``no-indications``: no calibration record can ever compute its forces
    """
    machine = load_machine(folder.info.machine)
    if not machine.indications:
        raise ConfigError(
            "the machine has no indications: it computes its forces itself",
            where=machine.name,
            got=", ".join(f"{column.symbol} ({column.role})" for column in machine.columns),
            expected='columns with role = "indication", from which a calibration record computes FY and MZ',
            next_step="fit each file by its own forces: toolkit fit FILE --machine "
            f"{folder.info.machine}; or record its cells too, and state them in the definition",
            rule="no-indications",
        )  # fmt: skip
    applied = protocol or folder.protocol
    return machine if applied is None else dataclasses.replace(machine, protocol=applied)


def process(
    folder: TestFolder,
    recordings: tuple[Recording, ...],
    record: CalibrationRecord,
    *,
    protocol: Protocol | None = None,
    use: CalibrationUse | None = None,
) -> TestResult:
    """Reduce, fit and characterise the recordings of a test with one calibration record.

    ``protocol`` goes before the test's own, and that before the machine's. ``use`` says how the record
    stands for the test (`Standing.use`); without it the result is a draft.

    Raises
    ------
    RecordingError
        rule ``no-recordings``: all are sweeps
    """
    machine = machine_of(folder, protocol)
    speeds = dict(folder.sweeps)
    named = [
        (recording.name_in(folder.folder), recording, folder.rotation_of(recording.path))
        for recording in recordings
    ]
    settled = [entry for entry in named if entry[1].path not in speeds]
    if named and not settled:
        raise RecordingError(
            "every recording of the test is a sweep", where=folder.folder, got=f"{len(named)} sweeps",
            expected="recordings of settled slip angles beside them, which give the loads and the curves",
            next_step="add them to the folder, or leave their names out of [sweeps]", rule="no-recordings",
        )  # fmt: skip
    tare, tare_findings = declared_tare(folder, machine), tare_health(folder, machine, record)
    reduced = reduce_test(
        info=folder.info, machine=machine, record=record, recordings=settled, tare=tare, use=use
    )
    sweeps, findings = sweeps_of(
        [(*entry, speeds[entry[1].path]) for entry in named if entry[1].path in speeds],
        machine=machine, record=record, info=folder.info, tare=tare,
    )  # fmt: skip
    of_reading = [
        finding
        for name, one, _ in named
        for finding in (*hidden_findings(one.hidden, name), *cut_findings(one.cut, name))
    ]
    reduced = dataclasses.replace(
        reduced,
        findings=(*reduced.findings, *tare_findings, *findings, *of_reading),
        definition=own_text(folder.info.machine),
    )
    characteristics = characterise(reduced, machine=machine, record=record, sweeps=sweeps)
    return TestResult(reduced=reduced, characteristics=characteristics)


def declared_tare(folder: TestFolder, machine: Machine) -> Tare | None:
    """Return the tare that ``test.toml`` declares, as values or as a file, in the machine's units."""
    if folder.tare_file is not None:
        return tare_of_file(read_recording(folder.tare_file, machine), machine)
    if not folder.tare_values:
        return None
    unit = machine.indications[0].unit
    return Tare(
        source="test.toml",
        values=tuple((name, value) for name, value, _ in folder.tare_values),
        unit=unit,
        u=tuple((column.symbol, dict(folder.tare_u)[column.symbol]) for column in machine.indications)
        if folder.tare_u
        else (),
    )


def tare_health(folder: TestFolder, machine: Machine, record: CalibrationRecord) -> list[Finding]:
    """Return what the channels of the recorded tare show; nothing where there is none."""
    if folder.tare_file is None:
        return []
    recording = read_recording(folder.tare_file, machine)
    return health_findings(
        recording, recording.name_in(folder.folder), stretches=[slice(0, recording.rows)],
        read=record.indications,
    )  # fmt: skip
