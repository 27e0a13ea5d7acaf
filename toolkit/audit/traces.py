"""The rows of the files that change most: what the file says, and what the record in force says."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.audit.columns import columns_of
from toolkit.audit.context import context_of
from toolkit.audit.identify import recompute
from toolkit.audit.model import CLEAN
from toolkit.errors import ToolkitError
from toolkit.recording.read import read_recording

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from toolkit.audit.archive import ArchiveAudit
    from toolkit.calibration.registry.registry import Registry


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """One file, row by row: FY [N] and MZ [N·m] as it has them (``old``) and by the record (``new``)."""

    plain: dict[str, Any]
    old: dict[str, NDArray[np.float64]]
    new: dict[str, NDArray[np.float64]]


def worst_files(audit: ArchiveAudit, count: int) -> list[dict[str, Any]]:
    """Return the files with the largest repair of FY, largest first; those that are right are left out."""
    bad = (
        (plain["repair"]["FY_max_abs_N"], number, plain)
        for number, plain in enumerate(audit.files.plain())
        if plain["repair"] is not None
        and plain["repair"]["FY_max_abs_N"] is not None
        and plain["grade"] not in CLEAN
    )
    return [plain for _, _, plain in heapq.nlargest(count, bad)]


def traces(audit: ArchiveAudit, registry: Registry, count: int) -> Iterator[Trace]:
    """Yield the rows of the worst files; one that can no longer be read is left out."""
    for plain in worst_files(audit, count):
        path = audit.archive / plain["path"]
        try:
            recording = read_recording(path, context_of(path).machine)
            record = registry.load(plain["in_force"])
        except ToolkitError:
            continue
        columns = columns_of(recording)
        yield Trace(
            plain=plain,
            old={load: recording[load].si for load in columns.loads},
            new=recompute(columns, record),
        )
