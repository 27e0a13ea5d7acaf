"""What is drawn of an archive: when each record was in force, what it computed, and the worst files."""

from __future__ import annotations

import datetime as dt
import heapq
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.audit.context import context_of
from toolkit.audit.identify import recompute
from toolkit.audit.inspection import Choices
from toolkit.audit.model import CLEAN, columns_of
from toolkit.audit.sides import disputed
from toolkit.errors import ToolkitError
from toolkit.recording.read import read_recording

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.arrays import Array
    from toolkit.audit.archive import ArchiveAudit
    from toolkit.calibration.registry.registry import Registry


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Days on which a record is in force, as known on the audit's day; ``end`` excluded, None: still.

    A record that is void on every day has its days as they were once decided, and ``void``.
    """

    record: str
    begin: dt.date | None
    end: dt.date | None
    void: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Timeline:
    """One instrument: the stretches of its records, and (record or grade, YYYY-MM, grade) -> files."""

    instrument: str
    stretches: tuple[Stretch, ...]
    counts: dict[tuple[str, str, str], int]
    first: dt.date
    last: dt.date


def timelines(
    files: Iterable[Mapping[str, Any]], registry: Registry, known_at: dt.date
) -> tuple[Timeline, ...]:
    """Return the timeline of every instrument that plain answers have dated files of."""
    counts: dict[str, Counter[tuple[str, str, str]]] = {}
    days: dict[str, tuple[str, str]] = {}
    for line in files:
        instrument, date = line["instrument"], line["date"]
        if instrument is None or date is None:
            continue
        who = line["record"] or line["grade"]
        counts.setdefault(instrument, Counter())[who, date[:7], line["grade"]] += 1
        first, last = days.get(instrument, (date, date))
        days[instrument] = (min(first, date), max(last, date))
    choices = Choices(registry=registry, known_at=known_at)
    return tuple(
        Timeline(
            instrument=name,
            stretches=_stretches(choices, name),
            counts=dict(counts[name]),
            first=dt.date.fromisoformat(days[name][0]),
            last=dt.date.fromisoformat(days[name][1]),
        )
        for name in sorted(counts)
    )


def _stretches(choices: Choices, instrument: str) -> tuple[Stretch, ...]:
    offered = choices.on(instrument, None)
    edges = choices.days(instrument)
    force = [choices.on(instrument, day).in_force for day in edges]
    stretches: list[Stretch] = []
    for status in sorted(
        offered.statuses, key=lambda statuse: (statuse.in_force_from or dt.date.max, statuse.id)
    ):
        if status.void_always:
            stretches.append(Stretch(record=status.id, begin=status.in_force_from, end=None, void=True))
            continue
        in_force_at = [i for i, record in enumerate(force) if record is not None and record.id == status.id]
        end = edges[in_force_at[-1] + 1] if in_force_at and in_force_at[-1] + 1 < len(edges) else None
        stretches.append(
            Stretch(record=status.id, begin=edges[in_force_at[0]] if in_force_at else None, end=end)
        )
    return tuple(stretches)


# The rows of the files that change most: what the file says, and what the record in force says.


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """One file, row by row: FY [N] and MZ [N·m] as it has them (``old``) and by the record (``new``).

    ``sha256`` is the hash of the file as it is now.
    """

    plain: dict[str, Any]
    old: dict[str, Array]
    new: dict[str, Array]
    sha256: str


def worst_files(audit: ArchiveAudit, count: int) -> list[dict[str, Any]]:
    """Return the files with the largest repair of FY, largest first; those that are right are left out."""
    bad = (
        (plain["repair"]["FY_max_abs_N"], number, plain)
        for number, plain in enumerate(audit.files.plain())
        if plain["repair"] is not None
        and plain["repair"]["FY_max_abs_N"] is not None
        and plain["grade"] not in CLEAN
        and not disputed(plain)
    )
    return [plain for _, _, plain in heapq.nlargest(count, bad)]


def traces(audit: ArchiveAudit, registry: Registry, count: int) -> Iterator[Trace]:
    """Yield the rows of the worst files; one that can no longer be read is left out."""
    for plain in worst_files(audit, count):
        try:
            yield trace_of(audit.archive, plain, registry)
        except ToolkitError:
            continue


def trace_of(archive: Path, plain: dict[str, Any], registry: Registry) -> Trace:
    """Return the rows of one file of an archive by its plain answer, which names a record in force.

    Raises
    ------
    ToolkitError
        the file can no longer be read, or its record fails a gate
    """
    path = archive / plain["path"]
    recording = read_recording(path, context_of(path).machine)
    columns = columns_of(recording)
    return Trace(
        plain=plain,
        old={load: recording[load].si for load in columns.loads},
        new=recompute(columns, registry.load(plain["in_force"])),
        sha256=recording.sha256,
    )
