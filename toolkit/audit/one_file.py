"""One file of an archive: which calibration computed it, what was in force, what would change."""

from __future__ import annotations

import datetime as dt
import functools
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np

from toolkit.arrays import Array
from toolkit.audit.candidates import cannot_correct
from toolkit.audit.context import Context, MachineSource, context_of
from toolkit.audit.estimate import EstimatedCalibration, estimate
from toolkit.audit.identify import identify_columns, recompute
from toolkit.audit.inspection import Choices
from toolkit.audit.model import (
    INDEX,
    Columns,
    DisagreeingSides,
    Grade,
    Repair,
    Segment,
    SkippedRecord,
    columns_of,
)
from toolkit.audit.structure import structure_findings
from toolkit.audit.weigh import impossible, inclinations, steps, weighed
from toolkit.calibration.registry.clock import in_future
from toolkit.calibration.registry.registry import Registry
from toolkit.channels import REVERSALS, ROTATIONS, Rotation, seen_by_cells, signs
from toolkit.declared import Entry, Keyed, OrNan
from toolkit.errors import ToolkitError
from toolkit.files import parse_json, read_toml, sha256_bytes, sha256_file
from toolkit.findings import Finding
from toolkit.inputs import RECORDING_FILE, limit_of, read_regular
from toolkit.machine import load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.recording.cut import cut_findings
from toolkit.recording.folder import nearest_test_toml
from toolkit.recording.hidden import hidden_findings
from toolkit.recording.marks import is_corrected_copy, machine_in, own_output
from toolkit.recording.model import Recording
from toolkit.recording.read import read_recording
from toolkit.reduction.blocks import Block
from toolkit.reduction.health import quality, tare_finding, tare_under_load
from toolkit.reduction.hub import with_load
from toolkit.reduction.prepare_rows import split_blocks
from toolkit.reduction.protocol import nearest_load, nearest_step


@dataclass(frozen=True, slots=True, kw_only=True)
class ArchivedCondition:
    """The mean of a load block of a file, and what the record in force changes.

    In the machine's axes; what it changes is new minus old.
    """

    first_row: Annotated[int, Entry("from 1")]
    last_row: int
    SA_deg: Annotated[float | None, Entry("null without that channel")]
    FZ_N: OrNan
    FY_N: Annotated[float | None, Entry("null where the file has none of its own")]
    MZ_Nm: Annotated[float | None, Entry("null where the file has none of its own")]
    FY_change_N: Annotated[float | None, Entry("null without a record in force")]
    MZ_change_Nm: Annotated[float | None, Entry("null without a record in force")]
    step_SA_deg: Annotated[float | None, Entry("slip angle of the protocol's step; null where none is near")]
    step_FZ_N: Annotated[float | None, Entry("load of the protocol's step; null where none is near")]


def changes(
    recording: Recording, columns: Columns, blocks: Sequence[Block], new: Mapping[str, Array] | None
) -> tuple[ArchivedCondition, ...]:
    """Return what the record in force would change in a recording's load blocks.

    ``new`` are FY [N] and MZ [N·m] by that record (`toolkit.audit.identify.recompute`), None without one.
    """
    if not blocks:
        return ()
    protocol = recording.machine.protocol
    rows: dict[str, Array] = {load: recording[load].si for load in columns.loads}
    if new is not None:
        rows |= {f"d{load}": new[load] - rows[load] for load in columns.loads}
    step = None
    if recording.has("SA"):
        rows["SA"] = recording["SA"].si
        step = nearest_step(float(rows["SA"].mean()), protocol)
    stacked = np.stack(list(rows.values()))
    table = np.array([stacked[:, block.rows].mean(axis=1) for block in blocks])
    means = dict(zip(rows, table.T.tolist(), strict=True))
    nothing = [None] * len(blocks)
    return tuple(
        ArchivedCondition(
            first_row=block.start + 1,
            last_row=block.stop,
            SA_deg=None if SA is None else math.degrees(SA),
            FZ_N=block.mean_FZ,
            FY_N=FY,
            MZ_Nm=MZ,
            FY_change_N=dFY,
            MZ_change_Nm=dMZ,
            step_SA_deg=None if step is None else math.degrees(step),
            step_FZ_N=nearest_load(block.mean_FZ, protocol),
        )
        for block, SA, FY, MZ, dFY, dMZ in zip(
            blocks, *(means.get(name, nothing) for name in ("SA", "FY", "MZ", "dFY", "dMZ")), strict=True
        )
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ArchivedNote:
    """What a person should know of a file."""

    rule: str
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ArchivedFile:
    """A file of an archive: which calibration computed it, and what the right one changes."""

    path: Annotated[str, Entry("relative to the archive, with /")]
    sha256: str | None
    size: int | None
    instrument: str | None = None
    date: dt.date | None = None
    test: Annotated[str | None, Entry("folder of its test.toml; . at or above the archive")] = None
    rotation: Rotation = "forward"
    to_SAE: Annotated[
        tuple[tuple[str, int], ...], Keyed(), Entry("sign of each channel on the way to SAE axes")
    ] = ()
    own_protocol: Annotated[bool, Entry("whether its test declares another than the machine's")] = False
    rows: int | None = None
    grade: Grade
    record: str | None = None
    variant: Annotated[
        str | None, Entry("how the record was changed: E5 negative in FY, MZ; what all candidates share")
    ] = None
    issued: Annotated[bool | None, Entry("whether the coefficients were those of the certificate")] = None
    candidates: Annotated[tuple[str, ...], Entry("of an ambiguous file")] = ()
    segments: tuple[Segment, ...] = ()
    sides: Annotated[
        DisagreeingSides | None, Entry("where rows disagree with their cells: which side is wrong")
    ] = None
    in_force: Annotated[str | None, Entry("the record in force on the date of the test")] = None
    repair: Repair | None = None
    conditions: tuple[ArchivedCondition, ...] = ()
    estimate: Annotated[
        EstimatedCalibration | None, Entry("of an unknown calibration: what the digits prove of it")
    ] = None
    skipped: tuple[SkippedRecord, ...] = ()
    reason: Annotated[str | None, Entry("why it cannot be read or judged; it may begin with a rule")]
    test_toml: Annotated[str | None, Entry("what is wrong with its test.toml")] = None
    units: Annotated[tuple[tuple[str, str], ...], Keyed(), Entry("of its channels")] = ()
    values_sha256: Annotated[str | None, Entry("of its numbers, whatever the file around them")] = None
    modified: Annotated[dt.date | None, Entry("day on which it was last saved, by its own properties")] = None
    notes: tuple[ArchivedNote, ...] = ()
    reports: Annotated[tuple[str, ...] | None, Entry("that rest on its test", sparse=True)] = None


NO_RECORDING = "no-recording"
_LOCKS = ("~$", ".~lock.", "._")
_BESIDE = (".ds_store", "thumbs.db", "desktop.ini")
_PROSE = (".txt", ".md", ".log", ".doc", ".docx", ".odt", ".rtf", ".pdf", ".ini", ".html", ".htm", ".msg",
          ".eml", ".png", ".jpg", ".jpeg", ".gif", ".tif", ".tiff", ".bmp", ".ppt", ".pptx")  # fmt: skip
_NO_TABLE = ("unreadable", "missing-column", "unknown-column", "unknown-unit", "no-data", "not-a-workbook",
             "ambiguous-text", "encoding")  # fmt: skip


def beside_recordings(name: str, rule: str | None) -> bool:
    """Tell whether a file that is refused by a rule is none that anybody would take for a recording.

    Lock files of office programs, and notes, letters and pictures that hold no table of the machine.

    >>> beside_recordings("test/~$FM_run_1.xlsx", "not-a-workbook")
    True
    >>> beside_recordings("test/notes.txt", "missing-column"), beside_recordings("a.xlsx", "no-data")
    (True, False)
    """
    plain = name.rpartition("/")[2].casefold()
    if plain.startswith(_LOCKS) or plain in _BESIDE:
        return True
    return plain.endswith(_PROSE) and (rule or "unreadable") in _NO_TABLE


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnOutput:
    """A file that is a result of the toolkit: no part of the archive."""

    sha256: str


class Auditor:
    """Audits files one after another; what the registry offers is asked once an instrument and day."""

    def __init__(self, archive: Path, registry: Registry, known_at: dt.date | None) -> None:
        self.archive = archive
        self._root = Path(os.path.abspath(archive))  # noqa: PTH100  links are not followed
        self.choices = Choices(registry=registry, known_at=known_at)
        self._toml = functools.lru_cache(maxsize=64)(read_toml)
        nearest = functools.lru_cache(maxsize=64)(nearest_test_toml)
        self._test = functools.lru_cache(maxsize=64)(self._folder_of)
        self._copies = functools.lru_cache(maxsize=256)(_copies_of)
        self._find = lambda path: nearest(path.parent)  # what is no folder holds no test.toml

    def __call__(self, name: str) -> ArchivedFile | OwnOutput:
        """Audit one file by its path in the archive; what it holds never raises."""
        path = self.archive / name
        try:
            size = path.stat().st_size
            data = read_regular(path, RECORDING_FILE) if size <= limit_of(RECORDING_FILE) else None
            # The gate refuses a larger one without reading it; of others the reader tells the hash.
            large = sha256_file(path) if data is None else ""
        except OSError as error:
            return unreadable(name, f"no-file: {error.strerror}")
        # A workbook's marks are looked at where it is opened, or not to be opened as a recording.
        workbook = data is not None and data.startswith(b"PK")
        if data is not None and not workbook and own_output(data):
            return OwnOutput(sha256=sha256_bytes(data))
        context, trouble = self._context(path, data or b"")
        try:
            recording = read_recording(path, context.machine, data=data)
            choice = self.choices.on(context.machine.name, context.date)
            loaded = with_load(recording, machine=context.machine, record=choice.in_force)
            blocks = () if context.is_tare else split_blocks(loaded, context.machine)[0]
        except ToolkitError as error:
            sha256 = large if data is None else sha256_bytes(data)
            if workbook and data is not None and own_output(data):
                return OwnOutput(sha256=sha256)
            reason = f"{error.rule or 'unreadable'}: {error.what}" + (
                f", got {error.got}" if error.got else ""
            )
            if beside_recordings(name, error.rule):
                reason, trouble = f"{NO_RECORDING}: {error.what}", None
            return unreadable(name, reason, sha256=sha256, size=size, context=trouble)
        columns = columns_of(recording)
        instrument = context.machine.name
        screen = self.choices.screen(instrument, columns)
        in_force = choice.in_force
        fits = in_force is not None and cannot_correct(in_force, columns) is None
        new = recompute(columns, in_force) if in_force is not None and fits else None
        identification = identify_columns(
            columns,
            choice.records,
            on=context.date,
            in_force=in_force,
            void=choice.void,
            screen=screen,
            new=new,
        )
        identification = weighed(identification, loaded, columns, blocks, choice.records, new, in_force)
        table: Mapping[str, Any] = {} if context.test_toml is None else self._toml(context.test_toml)
        rotation = self._rotation(path, context, table)
        reversal = table.get("reversal")
        direction = seen_by_cells(rotation, reversal) if reversal in REVERSALS else rotation
        sae = signs(context.machine.axes, "SAE", direction)
        changed = changes(loaded, columns, blocks, new)
        return ArchivedFile(
            path=name,
            sha256=recording.sha256,
            size=size,
            instrument=instrument,
            date=context.date,
            rows=recording.rows,
            grade=identification.grade,
            record=identification.record,
            variant=identification.variant,
            issued=identification.issued,
            candidates=identification.candidates,
            segments=identification.segments,
            sides=identification.sides,
            in_force=identification.in_force,
            repair=identification.repair,
            skipped=identification.skipped,
            reason=None if columns.loads else "no-own-values: the file has no FY and no MZ of its own",
            test_toml=trouble,
            test=None if context.test_toml is None else self._test(context.test_toml),
            rotation=rotation,
            to_SAE=tuple(sae.items()),
            own_protocol="protocol" in table,
            units=tuple((channel.symbol, channel.unit) for channel in recording.series),
            values_sha256=sha256_bytes(b"".join(channel.values.tobytes() for channel in recording.series)),
            modified=recording.saved,
            conditions=changed,
            estimate=estimate(columns, identification.segments, screen)
            if identification.grade == "unknown"
            else None,
            notes=tuple(
                ArchivedNote(rule=finding.rule, message=finding.message)
                for finding in (
                    *_impossible(name, recording, changed, in_force.id if in_force is not None else None),
                    *quality(recording, name),
                    *_tare(loaded, context, name),
                    *steps(loaded, columns, blocks, name),
                    *structure_findings(
                        [asdict(change) for change in changed], context.machine.protocol.load_tolerance, name
                    ),
                    *self._copied(path, data or b"", recording.sha256, name),
                    *hidden_findings(recording.hidden, name),
                    *cut_findings(recording.cut, name),
                )
            ),
        )

    def _context(self, path: Path, data: bytes) -> tuple[Context, str | None]:
        # A test.toml that cannot be used must not hide what its recordings hold: they have no date then.
        try:
            context = context_of(path, own=lambda: machine_in(data), read=self._toml, find=self._find)
            return context, None if context.future is None else f"time: {in_future(context.future)}"
        except ToolkitError as error:
            file_machine = machine_in(data)
            source: MachineSource = "default" if file_machine is None else "file"
            machine = load_machine(file_machine or DEFAULT_MACHINE)
            trouble = (
                f"{error.rule or 'test-toml'}: {error.what}"
                f"{'' if error.where is None else f' ({error.where})'}; got {error.got}, "
                f"expected {error.expected}"
            )
            return Context(machine=machine, machine_source=source, date=None, test_toml=None), trouble

    def _copied(self, path: Path, data: bytes, sha256: str, name: str) -> tuple[Finding, ...]:
        if not is_corrected_copy(data) and not any(sha256 in self._copies(up) for up in path.parents):
            return ()
        message = (
            "a corrected copy: its Fy and Mz were computed from the cells beside them, so that they agree "
            "proves nothing of the cells"
        )
        return (Finding(rule="corrected-copy", where=name, message=message, level="note"),)

    def _folder_of(self, toml: Path) -> str:
        try:
            return toml.parent.relative_to(self._root).as_posix()
        except ValueError:
            return "."

    def _rotation(self, path: Path, context: Context, table: Mapping[str, Any]) -> Rotation:
        if context.test_toml is None:
            return "forward"
        rotation_entry, exceptions = table.get("rotation"), table.get("rotations")
        if isinstance(exceptions, dict):
            absolute = self._root / path.relative_to(self.archive)
            inside = absolute.relative_to(context.test_toml.parent).as_posix()
            rotation_entry = exceptions.get(inside, exceptions.get(path.name, rotation_entry))
        return cast("Rotation", rotation_entry) if rotation_entry in ROTATIONS else "forward"


def _copies_of(folder: Path) -> frozenset[str]:
    # The hashes that the index of corrected copies in a folder names (`toolkit.audit.corrected`).
    try:
        index = parse_json(read_regular(folder / INDEX, RECORDING_FILE))
        return frozenset(str(entry["sha256"]) for entry in index["files"] if entry["sha256"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return frozenset()


def _tare(recording: Recording, context: Context, name: str) -> tuple[Finding, ...]:
    error = tare_under_load(recording, context.machine) if context.is_tare else None
    return () if error is None else (tare_finding(error, name, level="note"),)


def _impossible(
    name: str, recording: Recording, blocks: tuple[ArchivedCondition, ...], in_force: str | None
) -> tuple[Finding, ...]:
    rows = [f"rows {b.first_row}-{b.last_row}" for b in blocks]
    IA = inclinations(recording, [(b.first_row - 1, b.last_row) for b in blocks])
    angles = [None if b.SA_deg is None else math.radians(b.SA_deg) for b in blocks]
    stored = [(b.FZ_N, SA, b.FY_N, b.MZ_Nm) for b, SA in zip(blocks, angles, strict=True)]
    findings = impossible(name, rows, stored, values="the stored Fy and Mz are impossible", IA=IA)
    if in_force is None:
        return findings
    new = [
        (b.FZ_N, SA, _sum(b.FY_N, b.FY_change_N), _sum(b.MZ_Nm, b.MZ_change_Nm))
        for b, SA in zip(blocks, angles, strict=True)
    ]
    return (
        *findings,
        *impossible(name, rows, new, values=f"Fy and Mz by {in_force} are impossible too", IA=IA),
    )


def _sum(stored: float | None, change: float | None) -> float | None:
    return None if stored is None or change is None else stored + change


def unreadable(
    name: str, reason: str, *, sha256: str | None = None, size: int | None = None, context: str | None = None
) -> ArchivedFile:
    """Return the row of a file that cannot be read; ``reason`` begins with a rule id."""
    grade: Grade = "no_recording" if reason.startswith(f"{NO_RECORDING}:") else "unreadable"
    return ArchivedFile(path=name, sha256=sha256, size=size, grade=grade, reason=reason, test_toml=context)
