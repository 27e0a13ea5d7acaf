"""Inspection: what one recording holds, which calibration computed it, and what would be right.

What the registry offers for a file is asked once an instrument, and once a stretch of days (`Choices`): which
record is in force changes only on the days that the ledger names, so an archive of thousands of test
dates asks for a few of them.
"""

from __future__ import annotations

import bisect
import datetime as dt
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.audit.context import Context, context_of
from toolkit.audit.identify import identify_columns, recompute
from toolkit.audit.model import CLEAN, TELLS, Columns, Identification, Which, columns_of, in_words
from toolkit.audit.screen import Screen, Signature, layout, screen_of
from toolkit.audit.sides import statement
from toolkit.audit.weigh import impossible, inclinations, steps, weighed
from toolkit.calibration.registry.clock import in_future
from toolkit.errors import RecordError, RegistryError
from toolkit.findings import Finding
from toolkit.recording.cut import cut_findings
from toolkit.recording.hidden import hidden_findings
from toolkit.recording.read import read_recording
from toolkit.reduction.blocks import Block, block_means, find_blocks, is_tare
from toolkit.reduction.health import health_findings, tare_finding, tare_under_load
from toolkit.reduction.hub import with_load
from toolkit.reduction.prepare_rows import split_blocks
from toolkit.units import si_scale

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.arrays import Array
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.registry.registry import RefusedRecord, Registry
    from toolkit.calibration.registry.status import RecordStatus
    from toolkit.recording.model import Recording


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadBlock:
    """Rows at one load (from 1 at the first data row) and their means; own and corrected FY [N], MZ [N·m].

    None where the file has no own column or no record corrects it.
    """

    first_row: int
    last_row: int
    tare: bool
    FZ_N: float
    SA_rad: float
    FY_file_N: float | None
    MZ_file_Nm: float | None
    FY_N: float | None
    MZ_Nm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the registry offers for an instrument and a day."""

    records: tuple[CalibrationRecord, ...]
    refused: tuple[RefusedRecord, ...]
    statuses: tuple[RecordStatus, ...]
    in_force: CalibrationRecord | None
    today: CalibrationRecord | None
    trouble: str | None

    @property
    def void(self) -> tuple[str, ...]:
        """Ids of the records that are void on every day."""
        return tuple(status.id for status in self.statuses if status.void_always)

    def status(self, record_id: str | None) -> RecordStatus | None:
        """Return a record's status, None where it is not known."""
        return next((status for status in self.statuses if status.id == record_id), None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inspection:
    """One inspected file.

    ``corrected_by`` is the record in force on the test's date, else in force today; ``unverified``: it is a
    legacy import.
    """

    recording: Recording
    context: Context
    blocks: tuple[LoadBlock, ...]
    first_row: LoadBlock
    slip_angle_rad: float
    identification: Identification | None
    columns: Columns
    corrected_by: str | None
    choice: Choice | None
    findings: tuple[Finding, ...]
    unverified: bool = False


_NOT_BY_THESE_CELLS: dict[Which, str] = {
    "cells": "the cells were changed; Fy and Mz as the file has them are right",
    "open": "the cells disagree with Fy and Mz, and nothing says which side is wrong",
}


def choose(
    registry: Registry,
    instrument: str,
    *,
    on: dt.date | None,
    known_at: dt.date | None = None,
    offered: Choice | None = None,
) -> Choice:
    """Return the records that may have computed a file, and the one in force on the test's day.

    ``offered``: the choice of another day, whose records need not be read and checked again.
    """
    now = registry.ledger(instrument).known_on(known_at)
    if offered is not None:
        if on is None or offered.trouble is not None:
            return replace(offered, in_force=None)
        return replace(offered, in_force=_in_force(registry, instrument, on, now))
    records, refused = registry.usable(instrument)
    trouble: str | None = None
    statuses: list[RecordStatus] = []
    force: dict[dt.date, CalibrationRecord | None] = {}
    try:
        by_id = registry.statuses(instrument, known_at=now) if records else {}
        statuses = [by_id[record.id] for record in records]
        for day in {now, on or now}:
            force[day] = _in_force(registry, instrument, day, now)
    except RegistryError as error:
        trouble = f"{error.what}: {error.got}" if error.got else error.what
    return Choice(
        records=records,
        refused=refused,
        statuses=tuple(statuses),
        in_force=None if on is None else force.get(on),
        today=force.get(now),
        trouble=trouble,
    )


def _in_force(
    registry: Registry, instrument: str, on: dt.date, known_at: dt.date
) -> CalibrationRecord | None:
    try:
        return registry.in_force(instrument, on=on, known_at=known_at)
    except RecordError:
        return None  # it fails a gate: `usable` has refused it already, with the reason
    except RegistryError as error:
        if error.rule == "no-record-in-force":
            return None
        raise


def inspect_file(
    path: Path, registry: Registry | None, *, machine: str | None = None, known_at: dt.date | None = None
) -> Inspection:
    """Inspect one recording.

    Parameters
    ----------
    path : the recording
    registry : None where there is no laboratory home; then nothing is identified
    machine : name of the machine where neither test.toml nor the file should decide
    known_at : the day of knowledge, default today

    Raises
    ------
    RecordingError, ConfigError, UnitError
        the file or its test.toml cannot be used
    """
    context = context_of(path, machine=machine)
    recording = read_recording(path, context.machine)
    columns = columns_of(recording)
    choice = (
        None
        if registry is None
        else choose(registry, context.machine.name, on=context.date, known_at=known_at)
    )
    corrector = None if choice is None else choice.in_force or choice.today
    loaded_recording = with_load(recording, machine=context.machine, record=corrector)
    if not context.is_tare:
        split_blocks(loaded_recording, context.machine)  # refuses a file that holds no load at all
    identification, corrected, why = None, None, None
    stepping: tuple[Finding, ...] = ()
    if choice is not None:
        if columns.loads:
            identification = identify_columns(
                columns, choice.records, on=context.date, in_force=choice.in_force, void=choice.void
            )
            blocks_of_rows = () if context.is_tare else split_blocks(loaded_recording, context.machine)[0]
            fits = corrector is not None and _uncorrected(context, columns, choice, corrector) is None
            new = recompute(columns, corrector) if corrector is not None and fits else None
            identification = weighed(
                identification, loaded_recording, columns, blocks_of_rows, choice.records, new, corrector
            )
            stepping = steps(loaded_recording, columns, blocks_of_rows, path.name)
        why = _uncorrected(context, columns, choice, corrector)
        if identification is not None and identification.sides is not None and why is None:
            side = identification.sides.side
            why = None if side == "forces" else _NOT_BY_THESE_CELLS[side]
        corrected = recompute(columns, corrector) if corrector is not None and why is None else None
    first, *blocks = _blocks(loaded_recording, corrected)
    loaded = [block for block in blocks if not block.tare] or blocks
    rows = sum(block.last_row - block.first_row + 1 for block in loaded)
    return Inspection(
        recording=recording,
        context=context,
        blocks=tuple(blocks),
        first_row=first,
        slip_angle_rad=sum(b.SA_rad * (b.last_row - b.first_row + 1) for b in loaded) / rows,
        identification=identification,
        columns=columns,
        corrected_by=corrector.id if corrector is not None and corrected else None,
        unverified=corrector is not None and not corrector.verified,
        choice=choice,
        findings=(
            *_impossible(path, recording, blocks, corrector),
            *_findings(path, identification, choice),
            *stepping,
            *_of_context(path, context, why),
            *_of_channels(loaded_recording, path, context, corrector),
            *hidden_findings(recording.hidden, path.name),
            *cut_findings(recording.cut, path.name),
        ),
    )


def _of_channels(
    recording: Recording, path: Path, context: Context, corrector: CalibrationRecord | None
) -> list[Finding]:
    """Return what the channels show in the load blocks, or in a tare."""
    read = None if corrector is None else corrector.indications
    if context.is_tare:
        error = tare_under_load(recording, context.machine)
        loaded = [] if error is None else [tare_finding(error, path.name, level="error")]
        return [
            *loaded,
            *health_findings(recording, path.name, stretches=[slice(0, recording.rows)], read=read),
        ]
    blocks, _ = split_blocks(recording, context.machine)
    return health_findings(recording, path.name, stretches=[block.rows for block in blocks], read=read)


def _impossible(
    path: Path, recording: Recording, blocks: Sequence[LoadBlock], corrector: CalibrationRecord | None
) -> tuple[Finding, ...]:
    """Return what no tire can do, of the file's own values and of the corrected ones."""
    loads = [block for block in blocks if not block.tare]
    IA = inclinations(recording, [(b.first_row - 1, b.last_row) for b in loads])
    rows = [f"rows {block.first_row}-{block.last_row}" for block in loads]
    stored_blocks = [(b.FZ_N, b.SA_rad, b.FY_file_N, b.MZ_file_Nm) for b in loads]
    findings = impossible(path.name, rows, stored_blocks, values="the stored Fy and Mz are impossible", IA=IA)
    if corrector is None:
        return findings
    new = [(b.FZ_N, b.SA_rad, b.FY_N, b.MZ_Nm) for b in loads]
    return (
        *findings,
        *impossible(path.name, rows, new, values=f"Fy and Mz by {corrector.id} are impossible too", IA=IA),
    )


def withdrawal(inspection: Inspection) -> RecordStatus | None:
    """Return the status of the record that computed a file where it was withdrawn, else None."""
    identification, choice = inspection.identification, inspection.choice
    status = (
        choice.status(identification.record) if identification is not None and choice is not None else None
    )
    return status if status is not None and status.state == "withdrawn" else None


def wrong_signs(inspection: Inspection) -> str | None:
    """Return how the record that computed a file differs in sign from the one that corrects it, in words."""
    from toolkit.audit.candidates import turned_against

    identification, choice = inspection.identification, inspection.choice
    if (
        identification is None
        or choice is None
        or identification.variant is not None
        or inspection.corrected_by is None
    ):
        return None
    by_id = {record.id: record for record in choice.records}
    mine, right = by_id.get(identification.record or ""), by_id.get(inspection.corrected_by)
    if mine is None or right is None:
        return None
    return turned_against(mine, right, inspection.columns.loads)


def _uncorrected(
    context: Context, columns: Columns, choice: Choice, record: CalibrationRecord | None
) -> str | None:
    """Return why a file has no corrected values, None where it has."""
    from toolkit.audit.candidates import cannot_correct

    if record is not None:
        reason = cannot_correct(record, columns)
        return None if reason is None else f"{record.id} does not fit the file: {reason}"
    if choice.trouble is not None:
        return choice.trouble
    days = "today" if context.date is None else f"on the test's date, {context.date.isoformat()}, or today"
    return f"no record of {context.machine.name} is in force {days}"


def _of_context(path: Path, context: Context, why: str | None) -> tuple[Finding, ...]:
    findings = []
    if context.future is not None:
        message = f"{in_future(context.future)}; the file counts as undated"
        findings.append(Finding(rule="test-toml", where=path.name, message=message))
    if why is not None:
        message = f"no corrected values: {why}"
        findings.append(Finding(rule="not-corrected", where=path.name, message=message, level="note"))
    return tuple(findings)


def _blocks(recording: Recording, corrected: dict[str, Array] | None) -> tuple[LoadBlock, ...]:
    # The first row stands before the blocks, as one of its own.
    first = Block(start=0, stop=1, mean_FZ=float(recording["FZ"].si[0]))
    blocks = (first, *find_blocks(recording["FZ"].si))
    rows = [(block.start, block.stop) for block in blocks]
    nothing: list[float | None] = [None] * len(blocks)

    def own(symbol: str) -> list[float | None]:
        if not recording.has(symbol):
            return nothing
        series = recording[symbol]
        means: list[float | None] = (block_means(series.values, rows) * si_scale(series.unit)).tolist()
        return means

    def right(symbol: str) -> list[float | None]:
        values = (corrected or {}).get(symbol)
        means: list[float | None] = nothing if values is None else block_means(values, rows).tolist()
        return means

    smallest = min(recording.machine.protocol.loads_N, default=0.0)
    SA = block_means(recording["SA"].si, rows).tolist() if recording.has("SA") else [math.nan] * len(blocks)
    values = zip(blocks, SA, own("FY"), own("MZ"), right("FY"), right("MZ"), strict=True)
    return tuple(
        LoadBlock(
            first_row=block.start + 1,
            last_row=block.stop,
            tare=is_tare(block, smallest_load=smallest),
            FZ_N=block.mean_FZ,
            SA_rad=SA_rad,
            FY_file_N=FY_file,
            MZ_file_Nm=MZ_file,
            FY_N=FY,
            MZ_Nm=MZ,
        )
        for block, SA_rad, FY_file, MZ_file, FY, MZ in values
    )


def _findings(
    path: Path, identification: Identification | None, choice: Choice | None
) -> tuple[Finding, ...]:
    where = path.name
    if choice is None:
        text = "no laboratory home was found, so nobody can say which calibration computed the file"
        return (Finding(rule="no-home", where=where, message=text),)
    findings = [
        Finding(rule="refused-record", where=record.id, message=f"left out as a candidate: {record.reason}")
        for record in choice.refused
    ]
    if choice.trouble is not None:
        findings.append(Finding(rule="registry-damaged", where=where, message=choice.trouble))
    if identification is not None and identification.grade not in CLEAN:
        who = in_words(identification.record, identification.candidates, identification.variant)
        text = f"Fy and Mz were computed {TELLS[identification.grade]}{f' ({who})' if who else ''}"
        if identification.sides is not None and identification.sides.side != "forces":
            text = statement(identification.sides, identification.variant)
        findings.append(Finding(rule=f"identified-{identification.grade}", where=where, message=text))
    return tuple(findings)


@dataclass(slots=True, kw_only=True, eq=False)
class Choices:
    """The registry as known on a day, remembered as far as it was asked."""

    registry: Registry
    known_at: dt.date | None
    _edges: dict[str, tuple[dt.date, ...]] = field(default_factory=dict)
    _made: dict[tuple[str, int | None], Choice] = field(default_factory=dict)
    _screens: dict[tuple[str, Signature], Screen] = field(default_factory=dict)

    def on(self, instrument: str, day: dt.date | None) -> Choice:
        """Return what the registry offers for an instrument and a day; None: a test without a date."""
        edges = self.days(instrument)
        key = (instrument, None if day is None else bisect.bisect_right(edges, day))
        if key not in self._made:
            first = self._made.get((instrument, None))
            if first is None:
                first = choose(self.registry, instrument, on=None, known_at=self.known_at)
                self._made[instrument, None] = first
            if day is not None:
                self._made[key] = choose(
                    self.registry, instrument, on=day, known_at=self.known_at, offered=first
                )
        return self._made[key]

    def screen(self, instrument: str, columns: Columns) -> Screen:
        """Return the screen of an instrument's records for files of a layout."""
        key = (instrument, layout(columns))
        if key not in self._screens:
            self._screens[key] = screen_of(self.on(instrument, None).records, columns)
        return self._screens[key]

    def days(self, instrument: str) -> tuple[dt.date, ...]:
        """Return the days on which the record in force may change."""
        if instrument not in self._edges:
            try:
                entries = self.registry.ledger(instrument).entries
            except RegistryError:
                entries = ()
            since_days = {entry.since for entry in entries if entry.since is not None}
            self._edges[instrument] = tuple(sorted(since_days))
        return self._edges[instrument]
