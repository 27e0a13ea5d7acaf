"""Signing keys: a file that a passphrase opens, or the SSH agent, which never shows the key.

A private key is read, used and let go; it stands in no message, no log and in no laboratory's home.
"""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import TrustError
from toolkit.files import real_path
from toolkit.inputs import read_regular
from toolkit.trust.ssh import PublicKey, Sign, armoured, parse_public, public_of, sign_with

AGENT = "SSH_AUTH_SOCK"
_LARGEST = 64 * 1024  # bytes: a key file or an agent's answer is far smaller
_SECONDS = 60.0  # an agent may ask its owner to touch a token
_IDENTITIES, _IDENTITIES_ANSWER, _SIGN, _SIGN_ANSWER = 11, 12, 13, 14  # draft-miller-ssh-agent
_SHA512 = 4  # flag: an RSA key signs by SHA-512

Passphrase = Callable[[], str]


@dataclass(frozen=True, slots=True)
class Signer:
    """A key that can sign now; ``sign`` gives the raw SSH signature of bytes."""

    public: PublicKey
    sign: Sign

    def armour(self, message: bytes, namespace: str) -> str:
        """Return the signature of a message for a purpose, as ``ssh-keygen -Y sign`` writes it."""
        return armoured(self.public, self.sign, message, namespace)


def open_signer(path: Path, passphrase: Passphrase) -> Signer:
    """Return the signer of a key file; a public key's file means the agent's key of that name.

    ``passphrase`` is asked only where the file is encrypted.

    Raises
    ------
    TrustError
        ``signing-key``: the file or the agent cannot be used; ``weak-key``
    """
    data = _content(path)
    if not data.lstrip().startswith(b"-----BEGIN"):
        return agent_signer(parse_public(data.decode(errors="replace"), where=path))
    _demand_outside(path)
    return _signer(path, data, passphrase)


def make_key(path: Path, passphrase: str, comment: str) -> PublicKey:
    """Write a new Ed25519 key, encrypted, and its public half beside it (``.pub``); never over a file.

    Raises
    ------
    TrustError
        ``signing-key``: there is a file, or it cannot be written
    """
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, PrivateFormat

    _demand_outside(path)
    if not passphrase:
        raise _unusable(path, "an empty passphrase", "a passphrase that is not empty")
    private = Ed25519PrivateKey.generate()
    public = public_of(private)
    text = private.private_bytes(
        Encoding.PEM, PrivateFormat.OpenSSH, BestAvailableEncryption(passphrase.encode())
    )
    name = path.with_name(path.name + ".pub")
    written: list[Path] = []
    try:
        for place, data, mode in ((path, text, 0o600), (name, f"{public.line} {comment}\n".encode(), 0o644)):
            _write_new(place, data, mode, written)
    except OSError as error:
        for place in written:  # a key without its public half is none
            place.unlink(missing_ok=True)
        raise _unusable(path, error.strerror, "a path where no file is, and FILE.pub neither") from error
    return public


def agent_keys() -> tuple[PublicKey, ...]:
    """Return the keys of the SSH agent that can be used here, in its order.

    Raises
    ------
    TrustError
        ``signing-key``: no agent answers
    """
    answer = _agent(bytes([_IDENTITIES]), _IDENTITIES_ANSWER)
    (count,) = struct.unpack(">I", answer[:4])
    fields = list(_fields(answer[4:]))
    keys = []
    for blob in fields[: 2 * count : 2]:
        kind = next(_fields(blob), b"").decode(errors="replace")
        try:
            keys.append(parse_public(PublicKey(kind, blob).line))
        except TrustError:
            continue  # a kind that is refused stays in the agent for other uses
    return tuple(keys)


def agent_signer(public: PublicKey) -> Signer:
    """Return the signer of a key that the agent holds.

    Raises
    ------
    TrustError
        ``signing-key``: no agent answers, or it does not hold the key
    """
    if public not in agent_keys():
        raise _unusable(
            public.fingerprint, "the agent does not hold it", "a key of the agent: ssh-add -l", add=True
        )

    def sign(data: bytes) -> bytes:
        flags = _SHA512 if public.kind == "ssh-rsa" else 0
        request = bytes([_SIGN]) + _string(public.blob) + _string(data) + struct.pack(">I", flags)
        return next(_fields(_agent(request, _SIGN_ANSWER)))

    return Signer(public, sign)


def _signer(path: Path, data: bytes, passphrase: Passphrase) -> Signer:
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
    from cryptography.hazmat.primitives.serialization import load_ssh_private_key

    try:
        try:
            private = load_ssh_private_key(data, None)
        except TypeError:  # it is encrypted
            private = load_ssh_private_key(data, passphrase().encode())
    except UnsupportedAlgorithm as error:
        raise _unusable(path, "a kind of key that is not supported", "ssh-ed25519") from error
    except (ValueError, TypeError) as error:
        raise _unusable(path, "a damaged key, or another passphrase", "an OpenSSH private key") from error
    if not isinstance(private, ed25519.Ed25519PrivateKey | rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey):
        raise _unusable(path, "a kind of key that is refused", "ssh-ed25519")
    return Signer(public_of(private), lambda message: sign_with(private, message))


def _demand_outside(path: Path) -> None:
    home = next((folder for folder in real_path(path).parents if (folder / "calibrations").is_dir()), None)
    if home is not None:
        raise TrustError(
            "a private key lies in a laboratory's home", where=path, got=f"inside {home}, which is copied",
            expected="a key outside of every home",
            next_step="move the key, for example to ~/.ssh; a copy of the home may hold it already",
            rule="signing-key",
        )  # fmt: skip


def _content(path: Path) -> bytes:
    try:
        data = read_regular(path)
    except (OSError, ValueError) as error:
        raise _unusable(
            path,
            getattr(error, "strerror", error),
            "an OpenSSH private key, or the public key of one in the agent",
        ) from error
    if len(data) > _LARGEST:
        raise _unusable(path, f"{len(data)} bytes", "a key file")
    return data


def _write_new(path: Path, data: bytes, mode: int, written: list[Path]) -> None:
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    written.append(path)
    with os.fdopen(handle, "wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())


def _agent(request: bytes, expected: int) -> bytes:
    place = os.environ.get(AGENT)
    if not place:
        raise _unusable(f"${AGENT}", "no agent", "a running ssh-agent", add=True)
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as line:
            line.settimeout(_SECONDS)
            line.connect(place)
            line.sendall(struct.pack(">I", len(request)) + request)
            (size,) = struct.unpack(">I", _receive(line, 4))
            answer = _receive(line, min(size, _LARGEST))
    except (OSError, struct.error) as error:
        raise _unusable(
            place, f"the agent does not answer: {error}", "a running ssh-agent", add=True
        ) from error
    if not answer or answer[0] != expected:
        raise _unusable(place, "the agent refused", "its consent to sign", add=True)
    return answer[1:]


def _receive(line: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size and (part := line.recv(size - len(data))):
        data += part
    if len(data) < size:
        raise OSError("it ended its answer early")
    return data


def _fields(data: bytes) -> Iterator[bytes]:
    at = 0
    while at + 4 <= len(data):
        (size,) = struct.unpack(">I", data[at : at + 4])
        yield data[at + 4 : at + 4 + size]
        at += 4 + size


def _string(data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + data


def _unusable(where: object, got: object, expected: str, *, add: bool = False) -> TrustError:
    return TrustError(
        "a signing key cannot be used", where=where, got=got, expected=expected,
        next_step="add the key: ssh-add FILE" if add else "check the path and the passphrase, or make a key: "
        "toolkit person key FILE",
        rule="signing-key",
    )  # fmt: skip
