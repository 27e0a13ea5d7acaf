"""A witness: a second place that remembers the last checkpoint of a log and signs only what continues it.

It is a folder (on a share, at another laboratory, on a stick) with one file a log: the newest checkpoint that
it has countersigned. It keeps no lines; the laboratory proves by a path that its log only grew. A fork is
refused, and stays refused: the witness never forgets what it has signed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import TrustError
from toolkit.files import write_atomic
from toolkit.inputs import read_regular
from toolkit.trust.checkpoint import Checkpoint, parse_checkpoint
from toolkit.trust.keys import Signer
from toolkit.trust.merkle import consistency_proof, consistent, leaf_hash

SUFFIX = ".checkpoint"


@dataclass(frozen=True, slots=True)
class Witnessed:
    """What a witness has signed now, and the size that it knew before (0: nothing)."""

    checkpoint: Checkpoint
    before: int


def countersign(
    folder: Path, name: str, signer: Signer, checkpoint: Checkpoint, lines: Sequence[str], *, time: int
) -> Witnessed:
    """Let the witness of a folder sign a checkpoint of a log at a time (POSIX seconds).

    Raises
    ------
    TrustError
        ``ledger-fork``: what it signed before is no beginning of this log; ``ledger-rollback``: it has signed
        more; ``checkpoint``: the folder's file is damaged. Nothing is signed then
    OutputError
        the folder cannot be written to
    """
    path = place(folder, checkpoint.origin)
    before = remembered(path)
    if before is not None:
        _hold(before, checkpoint, lines, path)
    signed = checkpoint.cosigned(name, signer, time)
    write_atomic(path, signed.text)
    return Witnessed(signed, 0 if before is None else before.size)


def place(folder: Path, origin: str) -> Path:
    """Return the file of a log in a witness's folder; a log's name may hold what a file's name cannot."""
    return folder / f"{hashlib.sha256(origin.encode()).hexdigest()[:32]}{SUFFIX}"


def remembered(path: Path) -> Checkpoint | None:
    """Return the newest checkpoint that a witness has signed; None where it knows nothing of the log.

    Raises
    ------
    TrustError
        ``checkpoint``: the file is there and is no checkpoint
    """
    try:
        text = read_regular(path).decode()
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise TrustError(
            "a witness's memory cannot be read", where=path, got=error,
            expected="the checkpoint that it signed last",
            next_step="restore the witness's folder; it must not begin again", rule="checkpoint",
        ) from error  # fmt: skip
    return parse_checkpoint(text, where=path)


def _hold(before: Checkpoint, checkpoint: Checkpoint, lines: Sequence[str], where: Path) -> None:
    if checkpoint.size < before.size:
        raise TrustError(
            "the ledger has become shorter than a witness knows it", where=where,
            got=f"{checkpoint.size} entries",
            expected=f"the {before.size} entries that were witnessed, or more",
            next_step="find who removed entries; restore the ledger from a copy", rule="ledger-rollback",
        )  # fmt: skip
    leaves = [leaf_hash(line.encode()) for line in lines[: checkpoint.size]]
    path = consistency_proof(leaves, before.size)
    if not consistent(before.size, before.root, checkpoint.size, checkpoint.root, path):
        raise TrustError(
            "the ledger is not the one that a witness knows", where=where,
            got=f"other entries among the first {before.size}",
            expected=f"a continuation of the {before.size} entries that were witnessed",
            next_step="find who rewrote entries; restore the ledger from a copy", rule="ledger-fork",
        )  # fmt: skip
