"""One file of an archive: which calibration computed it, what was in force, what would change."""

from __future__ import annotations

import datetime as dt
import functools
import math
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from toolkit.audit.candidates import cannot_correct
from toolkit.audit.context import Context, MachineSource, context_of
from toolkit.audit.estimate import Estimate, estimate
from toolkit.audit.identify import identify_columns, recompute
from toolkit.audit.inspection import Choices
from toolkit.audit.model import INDEX, Grade, Identification, columns_of
from toolkit.audit.quality import impossible, inclinations
from toolkit.audit.structure import structure_findings
from toolkit.audit.weigh import steps, weighed
from toolkit.calibration.registry.clock import in_future
from toolkit.calibration.registry.registry import Registry
from toolkit.channels import REVERSALS, ROTATIONS, Rotation, seen_by_cells, signs
from toolkit.errors import ToolkitError
from toolkit.files import parse_json, read_toml, sha256_bytes, sha256_file
from toolkit.findings import Finding
from toolkit.inputs import RECORDING_FILE, limit_of, read_regular
from toolkit.machine import load_machine
from toolkit.machine.default import DEFAULT_MACHINE
from toolkit.recording.folder import nearest_test_toml
from toolkit.recording.hidden import hidden_findings
from toolkit.recording.marks import is_corrected_copy, machine_in, own_output
from toolkit.recording.read import read_recording
from toolkit.reduction.health import quality, tare_finding, tare_under_load
from toolkit.reduction.hub import with_load
from toolkit.reduction.prepare_rows import split_blocks
from toolkit.reduction.protocol import nearest_load, nearest_step

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from toolkit.audit.model import Columns
    from toolkit.recording.model import Recording
    from toolkit.reduction.blocks import Block


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One load block: its rows (from 1), its means as the file has them, and new minus old [N, N·m].

    In the machine's axes. ``SA_deg`` is None without that channel; ``FY_N`` and ``MZ_Nm`` without the
    file's own; the changes without a record in force. ``step_SA_deg`` and ``step_FZ_N`` are the nominal
    condition of the machine's protocol, None where it has none so near.
    """

    first_row: int
    last_row: int
    SA_deg: float | None
    FZ_N: float
    FY_N: float | None
    MZ_Nm: float | None
    FY_change_N: float | None
    MZ_change_Nm: float | None
    step_SA_deg: float | None
    step_FZ_N: float | None


def changes(
    recording: Recording,
    columns: Columns,
    blocks: Sequence[Block],
    new: Mapping[str, NDArray[np.float64]] | None,
) -> tuple[Change, ...]:
    """Return what the record in force would change in a recording's load blocks.

    ``new`` are FY [N] and MZ [N·m] by that record (`toolkit.audit.identify.recompute`), None without one.
    """
    if not blocks:
        return ()
    protocol = recording.machine.protocol
    rows: dict[str, NDArray[np.float64]] = {load: recording[load].si for load in columns.loads}
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
        Change(
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
class FileAudit:
    """What is known of one file. ``path`` is relative to the archive, with ``/``.

    ``identification`` is None where the file is unreadable; ``reason`` then begins with the rule that
    refused it.
    ``context`` tells why its test.toml could not be used, None where it could or there is none. ``test`` is
    the folder of its test.toml, relative to the archive (``.``: at or above it); ``to_SAE`` the sign that
    each channel has in SAE axes, ``own_protocol`` whether the test declares another than the machine's.
    ``units`` are those of its columns by symbol, ``values_sha256`` the hash of its numbers whatever the file
    around them. ``modified`` is the day on which the file, by its own properties, was last saved.
    ``changes`` are its load blocks, ``estimate`` its own equation where no record explains it, ``notes``
    what else its rows show.
    """

    path: str
    sha256: str | None
    size: int | None
    instrument: str | None
    date: dt.date | None
    rows: int | None
    identification: Identification | None
    reason: str | None
    context: str | None = None
    test: str | None = None
    rotation: Rotation = "forward"
    to_SAE: tuple[tuple[str, int], ...] = ()
    own_protocol: bool = False
    units: tuple[tuple[str, str], ...] = ()
    values_sha256: str | None = None
    modified: dt.date | None = None
    changes: tuple[Change, ...] = ()
    estimate: Estimate | None = None
    notes: tuple[Finding, ...] = ()

    @property
    def grade(self) -> Grade:
        """The file's grade."""
        if self.identification is not None:
            return self.identification.grade
        return "no_recording" if (self.reason or "").startswith(f"{NO_RECORDING}:") else "unreadable"


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

    def __call__(self, name: str) -> FileAudit | OwnOutput:
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
        return FileAudit(
            path=name,
            sha256=recording.sha256,
            size=size,
            instrument=instrument,
            date=context.date,
            rows=recording.rows,
            identification=identification,
            reason=None if columns.loads else "no-own-values: the file has no FY and no MZ of its own",
            context=trouble,
            test=None if context.test_toml is None else self._test(context.test_toml),
            rotation=rotation,
            to_SAE=tuple(sae.items()),
            own_protocol="protocol" in table,
            units=tuple((channel.symbol, channel.unit) for channel in recording.series),
            values_sha256=sha256_bytes(b"".join(channel.values.tobytes() for channel in recording.series)),
            modified=recording.saved,
            changes=changed,
            estimate=estimate(columns, identification.segments, screen)
            if identification.grade == "unknown"
            else None,
            notes=(
                *_impossible(name, recording, changed, in_force.id if in_force is not None else None),
                *quality(recording, name),
                *_tare(loaded, context, name),
                *steps(loaded, columns, blocks, name),
                *structure_findings(
                    [asdict(change) for change in changed], context.machine.protocol.load_tolerance, name
                ),
                *self._copied(path, data or b"", recording.sha256, name),
                *hidden_findings(recording.hidden, name),
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
    name: str, recording: Recording, blocks: tuple[Change, ...], in_force: str | None
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
    name: str,
    reason: str,
    *,
    sha256: str | None = None,
    size: int | None = None,
    context: str | None = None,
) -> FileAudit:
    """Return the row of a file that cannot be read; ``reason`` begins with a rule id."""
    return FileAudit(
        path=name, sha256=sha256, size=size, instrument=None, date=None, rows=None, identification=None,
        reason=reason, context=context,
    )  # fmt: skip
