"""Corrected copies: each recording whose Fy and Mz are not those of the record in force, with those that are.

The originals are only read. A copy has the same name and columns; every number but Fy and Mz is the
original's, and those two are the record's, in full. Of a CSV file nothing else changes (`csvcopy`). An index
beside the copies says which file each replaces, by its hash, and which record computed it.
"""

from __future__ import annotations

import datetime as dt
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from toolkit.arrays import Array
from toolkit.audit.context import Context, context_of
from toolkit.audit.day import CONTRADICTED, of_two_days
from toolkit.audit.identify import recompute
from toolkit.audit.model import CLEAN, INDEX, DisagreeingSides, columns_of
from toolkit.audit.other_files import off_the_curve, test_of
from toolkit.audit.sides import disputed, statement
from toolkit.audit.weigh import step_findings
from toolkit.calibration.registry.registry import Registry, instrument_of
from toolkit.calibration.registry.standing import Standing, standing
from toolkit.declared import Entry, json_value
from toolkit.errors import OutputError, ToolkitError
from toolkit.files import real_path, sha256_file
from toolkit.inputs import RECORDING_FILE, SETTINGS_FILE, read_input
from toolkit.publication import publication, settle
from toolkit.recording.csvcopy import with_numbers
from toolkit.recording.folder import TEST_FILE, nearest_test_toml
from toolkit.recording.formats import WRITERS
from toolkit.recording.formats.vectors import Written
from toolkit.recording.labview import write_labview
from toolkit.recording.marks import COPY, GENERATOR, OWN_OUTPUT
from toolkit.recording.read import read_recording
from toolkit.reduction.hub import with_load
from toolkit.reduction.prepare_rows import split_blocks
from toolkit.staging import PASSING
from toolkit.units import from_si, si_scale

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.recording.model import Recording

DISPUTED = "cells-disagree"


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectedCopy:
    """A corrected copy of a file."""

    path: str
    replaces_sha256: str
    sha256: Annotated[str | None, Entry("null where there is none")]
    record: str
    record_sha256: str
    reason: Annotated[str | None, Entry("why there is none")]
    unverified: bool
    draft: bool
    draft_reasons: tuple[str, ...]


def check_target(archive: Path, target: Path) -> None:
    """Refuse a folder in which a copy could meet an original.

    Raises
    ------
    OutputError
        ``repair-target``: the folder is the archive, inside it, or around it; or it holds other files
    """
    source_folder, target_folder = real_path(archive), real_path(target)
    if (
        source_folder == target_folder
        or source_folder in target_folder.parents
        or target_folder in source_folder.parents
    ):
        raise _refused(target, f"the archive is {source_folder}", "a folder apart from the archive")
    if target.exists() and not target.is_dir():
        raise _refused(target, "a file", "a folder")
    settle(target)
    results = (
        [path for path in target.iterdir() if not path.name.startswith(PASSING)] if target.is_dir() else []
    )
    if results and not (target / INDEX).is_file():
        raise _refused(target, "a folder with other files", f"an empty folder, or one with {INDEX} of before")


def write_copies(
    audit: ArchiveAudit,
    registry: Registry,
    target: Path,
    *,
    draft: bool = False,
    step: Callable[[str], None] = lambda _: None,
) -> tuple[CorrectedCopy, ...]:
    """Write the corrected copies of an audited archive and their index, together; return all of them.

    Files without a record in force, and those that are right, have no copy; where the record in force may
    not make a number (it is expired), the copy is refused unless a ``draft`` is asked for.

    Raises
    ------
    OutputError
        see `check_target`; or a copy cannot be written
    """
    check_target(audit.archive, target)
    standings: dict[tuple[str, str], Standing] = {}
    strays, apart = _strays(audit), of_two_days(audit.files.plain())
    copies: list[CorrectedCopy] = []
    with publication(target) as stage:
        for plain in audit.files.plain():
            if plain["repair"] is None or plain["grade"] in CLEAN or not plain["units"]:
                continue
            folder = (target / plain["path"]).parent
            if not real_path(folder).is_relative_to(real_path(target)):
                raise _refused(folder, "a link that leads outside", "a plain folder")
            key = (plain["in_force"], plain["date"])
            if key not in standings:
                standings[key] = standing(
                    registry,
                    instrument_of(key[0]),
                    on=dt.date.fromisoformat(key[1]),
                    known_at=audit.known_at,
                    named=key[0],
                )
            why = _refusal(plain, strays, apart)
            copies.append(_copy(audit.archive, plain, standings[key], stage, draft=draft, refusal=why))
            step(plain["path"])
        manifest = {
            "generator": GENERATOR,
            "marks": OWN_OUTPUT,
            "schema": 1,
            "known_at": audit.known_at.isoformat(),
            "heads": dict(audit.heads),
            "files": json_value(copies),
        }
        (stage / INDEX).write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    return tuple(copies)


def _strays(audit: ArchiveAudit) -> dict[str, str]:
    """Return the files that would lie off the curve of their test if they were corrected: path to message."""
    places: dict[str, list[int]] = {}
    tests: set[str] = set()
    for place, line in enumerate(audit.files.plain()):
        places.setdefault(test_of(line), []).append(place)
        if line["repair"] is not None and line["grade"] not in CLEAN:
            tests.add(test_of(line))
    found: dict[str, str] = {}
    for test in sorted(tests):
        found |= off_the_curve([audit.files.line(place) for place in places[test]])
    return found


def disagreement(plain: Mapping[str, Any]) -> str:
    """Return in words why nothing is computed of a disputed file."""
    return statement(DisagreeingSides(**plain["sides"]), plain["variant"])


def _refusal(plain: Mapping[str, Any], strays: Mapping[str, str], apart: Mapping[str, str]) -> str | None:
    """Return why a file must not be corrected by its cells, None where nothing speaks against it."""
    if disputed(plain):
        return f"{DISPUTED}: {disagreement(plain)}"
    if plain["path"] in apart:
        return f"{CONTRADICTED}: {apart[plain['path']]}"
    stray = strays.get(plain["path"])
    return None if stray is None else f"stray-file: corrected, {stray}"


def _check_steps(
    recording: Recording, new: Mapping[str, Array], context: Context, record: CalibrationRecord
) -> str | None:
    """Return why corrected values contradict themselves: they step where the recorded ones go on."""
    loaded = with_load(recording, machine=context.machine, record=record)
    blocks = () if context.is_tare else split_blocks(loaded, context.machine)[0]
    after = step_findings(loaded, new, blocks, recording.name)
    return f"discontinuity: corrected, {after[0].message}" if after else None


def _copy(
    archive: Path,
    plain: Mapping[str, Any],
    standing: Standing,
    stage: Path,
    *,
    draft: bool,
    refusal: str | None,
) -> CorrectedCopy:
    record = standing.record
    path, place = archive / plain["path"], stage / plain["path"]
    failed: str | None = None
    sha256: str | None = None
    use: CalibrationUse | None = None
    try:
        use = standing.use(draft=draft, where=path)
        context = context_of(path)
        data = read_input(path, RECORDING_FILE)
        recording = read_recording(path, context.machine, data=data)
        new = recompute(columns_of(recording), record)
        if recording.sha256 != plain["sha256"]:
            failed = "the file changed since it was audited"
        else:
            failed = refusal or _check_steps(recording, new, context, record)
        if failed is None:
            _write(place, recording, data, new, use)
            sha256 = sha256_file(place)
            _keep_test(path, archive, stage)
    except OutputError:
        raise
    except ToolkitError as error:
        failed = f"{error.rule}: {error.what}" + (f": {error.got}" if use is None else "")
    return CorrectedCopy(
        path=plain["path"],
        replaces_sha256=plain["sha256"],
        sha256=sha256,
        record=record.id,
        record_sha256=record.sha256,
        reason=failed,
        unverified=use is not None and use.unverified,
        draft=use is not None and use.draft,
        draft_reasons=() if use is None else use.draft_reasons,
    )


def _write(
    place: Path, recording: Recording, data: bytes, new: Mapping[str, Array], use: CalibrationUse
) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    if recording.format == "csv":
        columns_in_file = {column.symbol: column.values.tolist() for column in _replaced(recording, new)}
        place.write_bytes(with_numbers(data, columns_in_file, recording.machine, where=recording.path))
        return
    title = f"{COPY} {recording.name}, sha256 {recording.sha256}; Fy and Mz by {use.id}"
    title += f"; {use.mark}" if use.mark else ""
    if recording.format in WRITERS:
        place.write_bytes(WRITERS[recording.format](_copied_columns(recording, new), title))
        return
    machine = recording.machine
    units = {column.symbol: column.unit for column in machine.columns}
    columns: dict[str, Array] = {}
    for channel in recording.series:
        if channel.symbol in units:
            unit, name = units[channel.symbol], channel.symbol
        else:
            unit, name = channel.unit, f"{channel.symbol} [{channel.unit}]"
        values = channel.values if unit == channel.unit else from_si(channel.si, unit)
        columns[name] = np.asarray(from_si(new[channel.symbol], unit) if channel.symbol in new else values)
    write_labview(place, machine, columns, simulated=recording.simulated, title=title)


def _replaced(recording: Recording, new: Mapping[str, Array]) -> list[Written]:
    return [column for column in _copied_columns(recording, new) if column.symbol in new]


def _copied_columns(recording: Recording, new: Mapping[str, Array]) -> list[Written]:
    return [
        Written(
            symbol=channel.symbol,
            header=channel.header,
            unit=channel.unit,
            values=new[channel.symbol] / si_scale(channel.unit) if channel.symbol in new else channel.values,
        )
        for channel in recording.series
    ]


def _keep_test(path: Path, archive: Path, stage: Path) -> None:
    # The test's own test.toml goes along, as it is: without it a copy has no date and no machine.
    toml = nearest_test_toml(path.parent)
    root = Path(os.path.abspath(archive))  # noqa: PTH100  links are not followed
    if toml is None or root not in toml.parents:
        return
    place = stage / toml.parent.relative_to(root) / TEST_FILE
    if not place.exists():
        place.write_bytes(read_input(toml, SETTINGS_FILE))


def _refused(target: Path, actual: str, expected: str) -> OutputError:
    return OutputError(
        "corrected copies cannot be written there",
        where=target,
        got=actual,
        expected=expected,
        next_step="name another folder with --repair; the originals are never touched",
        rule="repair-target",
    )
