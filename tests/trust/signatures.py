"""Who signed a checkpoint, by C2SP signed-note and tlog-cosignature, and by no code of the toolkit."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from toolkit.trust.checkpoint import Checkpoint
from toolkit.trust.ssh import PublicKey


def signed_by(checkpoint: Checkpoint, name: str, key: PublicKey) -> bool:
    """Tell whether a key's owner signed a checkpoint under that name."""
    return any(_holds(key, value, _body(checkpoint)) for value in _values(checkpoint, name, key, b"\x01"))


def witnessed_at(checkpoint: Checkpoint, name: str, key: PublicKey) -> int | None:
    """Return the time (POSIX seconds) at which a witness signed; None where it did not."""
    for value in _values(checkpoint, name, key, b"\x04"):
        (time,) = struct.unpack(">Q", value[:8])
        if _holds(key, value[8:], f"cosignature/v1\ntime {time}\n".encode() + _body(checkpoint)):
            return int(time)
    return None


def _body(checkpoint: Checkpoint) -> bytes:
    return checkpoint.text.partition("\n\n")[0].encode() + b"\n"


def _values(checkpoint: Checkpoint, name: str, key: PublicKey, kind: bytes) -> Iterator[bytes]:
    number = hashlib.sha256(name.encode() + b"\n" + kind + key.raw).digest()[:4]
    yield from (line.value for line in checkpoint.signatures if (line.name, line.key_id) == (name, number))


def _holds(key: PublicKey, value: bytes, data: bytes) -> bool:
    try:
        Ed25519PublicKey.from_public_bytes(key.raw).verify(value, data)
    except InvalidSignature:
        return False
    return True
