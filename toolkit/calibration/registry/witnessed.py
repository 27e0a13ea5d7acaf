"""What witnesses have signed of a laboratory's ledgers, held against the ledgers of today.

Each checkpoint that a witness signed is kept in ``trust/witnessed`` of the home. A ledger that is no
continuation of one of them was cut off or rewritten, however sound its own chain is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from toolkit.errors import ToolkitError
from toolkit.inputs import read_regular
from toolkit.trust.anchor import Comparison, compare
from toolkit.trust.checkpoint import SUFFIX, Checkpoint, parse_checkpoint

ORIGIN = "toolkit/"
"""What the name of a laboratory's log begins with; the instrument follows."""


def witnessed(
    calibrations: Path, name: str, lines: Callable[[], Sequence[str]]
) -> Iterator[tuple[str, Comparison]]:
    """Yield how a ledger stands to each checkpoint that a witness signed of it, by the file's name.

    ``lines`` are those of the ledger; they are asked for only where there is a checkpoint.

    Raises
    ------
    TrustError
        ``checkpoint``: what stands there is none
    """
    for file, checkpoint in _checkpoints(calibrations, f"{name}-"):
        if checkpoint.origin == f"{ORIGIN}{name}":  # else of an instrument whose name begins with this one's
            yield file.name, compare(lines(), checkpoint)


def contradicted(calibrations: Path, name: str, lines: Callable[[], Sequence[str]]) -> str | None:
    """Say which witness contradicts a ledger; None where none does."""
    try:
        for file, comparison in witnessed(calibrations, name, lines):
            if comparison.continuity != "continues":
                return f"it is not the one that a witness signed, {file}: {comparison.why}"
    except (ToolkitError, OSError) as error:
        reason = getattr(error, "got", None) or error
        return f"what a witness signed of it cannot be read: {reason}"
    return None


def attested(calibrations: Path) -> frozenset[str]:
    """Return the names of the ledgers of which a witness has signed entries; the unreadable tell nothing."""
    try:
        checkpoints = [checkpoint for _, checkpoint in _checkpoints(calibrations, "")]
    except (ToolkitError, OSError):
        return frozenset()
    return frozenset(point.origin.removeprefix(ORIGIN) for point in checkpoints if point.size)


def _checkpoints(calibrations: Path, start: str) -> Iterator[tuple[Path, Checkpoint]]:
    for file in sorted((calibrations.parent / "trust" / "witnessed").glob(f"*{SUFFIX}")):
        if file.name.startswith(start):  # a name is no pattern: whoever states it may write * and /
            yield file, parse_checkpoint(read_regular(file).decode(errors="replace"), where=file)
