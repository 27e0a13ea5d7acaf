"""Checkpoints: what a log was at a moment, signed (C2SP tlog-checkpoint), and countersigned by witnesses.

    rig.calibrations.example
    41
    5wHqDQwl...=

    — anna yH3v...
    — witness-north 4gAJ...

The first line is the log's name, then its size and the root of its tree; each line after the blank is a
signature: the signer's name, then in base64 the four first bytes of the key's hash and the signature
(C2SP signed-note). A witness signs the time with it (C2SP tlog-cosignature, ``cosignature/v1``).

A witness is a second place that remembers the last checkpoint of a log and signs only what continues it. It
is a folder (on a share, at another laboratory, on a stick) with one file a log: the newest checkpoint that it
has countersigned. It keeps no lines; the laboratory proves by a path that its log only grew. A fork is
refused, and stays refused: the witness never forgets what it has signed.
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from toolkit.errors import TrustError
from toolkit.files import write_atomic
from toolkit.inputs import read_regular
from toolkit.trust.keys import Signer
from toolkit.trust.merkle import HASH_BYTES, consistency_proof, consistent, leaf_hash
from toolkit.trust.ssh import PublicKey

_NOTE, _COSIGNATURE = b"\x01", b"\x04"
_ID = 4  # bytes of a key's hash before the signature
_SIGNATURE = 64  # bytes of an Ed25519 signature
_DASH = "— "


@dataclass(frozen=True, slots=True)
class NoteSignature:
    """One signature line: whose, the key's hash, and the bytes (of a witness with the time before them)."""

    name: str
    key_id: bytes
    value: bytes

    @property
    def line(self) -> str:
        """The line as it stands in a checkpoint."""
        return f"{_DASH}{self.name} {base64.b64encode(self.key_id + self.value).decode()}\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """Size and root of a log, by its name, with its signatures."""

    origin: str
    size: int
    root: bytes
    signatures: tuple[NoteSignature, ...] = ()

    @property
    def body(self) -> str:
        """What is signed: name, size and root, a line each."""
        return f"{self.origin}\n{self.size}\n{base64.b64encode(self.root).decode()}\n"

    @property
    def text(self) -> str:
        """The checkpoint as a file has it."""
        return self.body + "\n" + "".join(signature.line for signature in self.signatures)

    def signed(self, name: str, signer: Signer) -> Checkpoint:
        """Return the checkpoint with one more signature, of the log's own people."""
        value = _raw(signer, self.body.encode())
        signature = NoteSignature(name, key_id(name, signer.public, _NOTE), value)
        return replace(self, signatures=(*self.signatures, signature))

    def cosigned(self, name: str, signer: Signer, time: int) -> Checkpoint:
        """Return the checkpoint with a witness's signature at a time (POSIX seconds)."""
        value = struct.pack(">Q", time) + _raw(signer, _witnessed(self.body, time))
        signature = NoteSignature(name, key_id(name, signer.public, _COSIGNATURE), value)
        return replace(self, signatures=(*self.signatures, signature))


def parse_checkpoint(text: str, *, where: object = None) -> Checkpoint:
    """Read a checkpoint.

    Raises
    ------
    TrustError
        ``checkpoint``: it is none
    """
    try:
        body, signatures = text.split("\n\n", 1)
        origin, size, root = body.split("\n")
        value = base64.b64decode(root, validate=True)
        lines = tuple(_signature(line) for line in signatures.splitlines())
        whole = bool(origin) and size.isdecimal() and str(int(size)) == size and len(value) == HASH_BYTES
        checkpoint = Checkpoint(origin=origin, size=int(size), root=value, signatures=lines)
        whole = whole and checkpoint.text == text  # base64 has more than one spelling
    except (ValueError, binascii.Error) as error:
        raise _unreadable(text, where) from error
    if not whole:
        raise _unreadable(text, where)
    return checkpoint


def _unreadable(text: str, where: object) -> TrustError:
    return TrustError(
        "a checkpoint cannot be read", where=where, got=text[:80],
        expected="the log's name, its size and its root, a line each; a blank line; signatures",
        next_step="take it again from the document, or from the witness", rule="checkpoint",
    )  # fmt: skip


def key_id(name: str, key: PublicKey, kind: bytes) -> bytes:
    """Return the four bytes by which a signature line names its key (C2SP signed-note)."""
    return hashlib.sha256(name.encode() + b"\n" + kind + key.raw).digest()[:_ID]


def _signature(line: str) -> NoteSignature:
    if not line.startswith(_DASH):
        raise ValueError(line)
    name, _, value = line.removeprefix(_DASH).partition(" ")
    data = base64.b64decode(value, validate=True)
    if not name or len(data) <= _ID:
        raise ValueError(line)
    return NoteSignature(name, data[:_ID], data[_ID:])


def _witnessed(body: str, time: int) -> bytes:
    return f"cosignature/v1\ntime {time}\n{body}".encode()


def _raw(signer: Signer, data: bytes) -> bytes:
    """Return the 64 bytes of an Ed25519 signature; the key's kind was asked for by `PublicKey.raw`."""
    return signer.sign(data)[-_SIGNATURE:] if signer.public.raw else b""


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
