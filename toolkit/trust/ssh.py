"""SSH keys and signatures, as OpenSSH writes them.

A signature is what ``ssh-keygen -Y sign`` makes and ``ssh-keygen -Y verify`` proves without the toolkit
(OpenSSH, PROTOCOL.sshsig). Ed25519 is what a laboratory uses; RSA from 3072 bits and NIST's curves are taken
for keys that people have; DSA, short RSA keys and SHA-1 are refused.
"""

from __future__ import annotations

import base64
import binascii
import functools
import hashlib
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from toolkit.errors import TrustError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey, EllipticCurvePublicKey
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey
    from cryptography.hazmat.primitives.asymmetric.rsa import RSAPrivateKey, RSAPublicKey

    PublicObject = Ed25519PublicKey | RSAPublicKey | EllipticCurvePublicKey
    PrivateObject = Ed25519PrivateKey | RSAPrivateKey | EllipticCurvePrivateKey

MAGIC = b"SSHSIG"
BEGIN = "-----BEGIN SSH SIGNATURE-----"
END = "-----END SSH SIGNATURE-----"
RSA_BITS = 3072  # NIST SP 800-57: 128 bits of strength, and trust.md
ED25519 = "ssh-ed25519"
_CURVES = {
    "ecdsa-sha2-nistp256": ("nistp256", "secp256r1", "SHA256"),
    "ecdsa-sha2-nistp384": ("nistp384", "secp384r1", "SHA384"),
    "ecdsa-sha2-nistp521": ("nistp521", "secp521r1", "SHA512"),
}
_DIGESTS: dict[str, Literal["sha256", "sha512"]] = {"sha256": "sha256", "sha512": "sha512"}

Sign = Callable[[bytes], bytes]


class BadSignatureError(Exception):
    """A signature that proves nothing; the message says why."""


@dataclass(frozen=True, slots=True)
class PublicKey:
    """A public key: its kind, and its content as SSH writes it on the wire.

    >>> line = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIHLYyvkM0WuTMRE79NDWJ1VKjWPHV6sFqZPYQ+0nhFDQ anna"
    >>> parse_public(line).kind
    'ssh-ed25519'
    """

    kind: str
    blob: bytes

    @property
    def fingerprint(self) -> str:
        """``SHA256:...``, as ``ssh-keygen -l`` prints it."""
        return "SHA256:" + base64.b64encode(hashlib.sha256(self.blob).digest()).decode().rstrip("=")

    @property
    def line(self) -> str:
        """The key as ``authorized_keys`` and ``people.toml`` have it, without a comment."""
        return f"{self.kind} {base64.b64encode(self.blob).decode()}"

    @property
    def raw(self) -> bytes:
        """The 32 bytes of an Ed25519 key.

        Raises
        ------
        TrustError
            ``weak-key``: it is of another kind
        """
        if self.kind != ED25519:
            raise _refused(self.kind, ED25519)
        return _Reader(self.blob).skip().string()


def parse_public(line: str, *, where: object = None) -> PublicKey:
    """Read a public key's line, ``ssh-ed25519 AAAA... comment``.

    Raises
    ------
    TrustError
        ``weak-key``: no key, or one of a kind or length that is refused
    """
    try:
        return _public(line)
    except TrustError as error:
        raise _refused(error.got, error.expected or "a public key", where) from error


@functools.lru_cache(maxsize=1024)
def _public(line: str) -> PublicKey:
    parts = line.split()
    try:
        blob = base64.b64decode(parts[1], validate=True)
        kind = _Reader(blob).string().decode()
    except (IndexError, binascii.Error, ValueError, BadSignatureError) as error:
        raise _refused(line[:60], "ssh-ed25519 AAAA...") from error
    if kind != parts[0]:
        raise _refused(f"{parts[0]} around a key of kind {kind}", "one kind")
    key = PublicKey(kind, blob)
    public_object(key)
    return key


@functools.lru_cache(maxsize=1024)
def public_object(key: PublicKey) -> PublicObject:
    """Return the key for `cryptography`; a key has one spelling, so that nobody enrols one as two.

    Raises
    ------
    TrustError
        ``weak-key``
    """
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

    public = _read_public(key)
    if public.public_bytes(Encoding.OpenSSH, PublicFormat.OpenSSH).decode() != key.line:
        raise _refused(f"another spelling of a {key.kind} key", "the key as ssh-keygen writes it")
    return public


def _read_public(key: PublicKey) -> PublicObject:
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa

    parts = _Reader(key.blob).skip()
    try:
        if key.kind == ED25519:
            raw = parts.string()
            parts.end()
            return ed25519.Ed25519PublicKey.from_public_bytes(raw)
        if key.kind == "ssh-rsa":
            exponent, modulus = parts.integer(), parts.integer()
            parts.end()
            if modulus.bit_length() < RSA_BITS:
                raise _refused(f"RSA with {modulus.bit_length()} bits", f"Ed25519, or RSA from {RSA_BITS}")
            return rsa.RSAPublicNumbers(exponent, modulus).public_key()
        if key.kind in _CURVES:
            name, curve, _digest = _CURVES[key.kind]
            if parts.string().decode() != name:
                raise _refused(f"another curve in {key.kind}", name)
            point = parts.string()
            parts.end()
            curves = {"secp256r1": ec.SECP256R1(), "secp384r1": ec.SECP384R1(), "secp521r1": ec.SECP521R1()}
            return ec.EllipticCurvePublicKey.from_encoded_point(curves[curve], point)
    except (ValueError, BadSignatureError) as error:
        raise _refused(f"a damaged {key.kind} key", "a public key") from error
    raise _refused(key.kind, "ssh-ed25519, ecdsa-sha2-nistp256, or ssh-rsa from 3072 bits")


def public_of(private: PrivateObject) -> PublicKey:
    """Return the public half of a private key."""
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

    line = private.public_key().public_bytes(Encoding.OpenSSH, PublicFormat.OpenSSH).decode()
    return parse_public(line)


def sign_with(private: PrivateObject, data: bytes) -> bytes:
    """Return the raw SSH signature (algorithm and value) of bytes, by a private key in memory."""
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa, utils

    if isinstance(private, rsa.RSAPrivateKey):
        return _string(b"rsa-sha2-512") + _string(private.sign(data, padding.PKCS1v15(), hashes.SHA512()))
    if isinstance(private, ec.EllipticCurvePrivateKey):
        kind = public_of(private).kind
        value = private.sign(data, ec.ECDSA(getattr(hashes, _CURVES[kind][2])()))
        r, s = utils.decode_dss_signature(value)
        return _string(kind.encode()) + _string(_integer(r) + _integer(s))
    return _string(ED25519.encode()) + _string(private.sign(data))


def armoured(public: PublicKey, sign: Sign, message: bytes, namespace: str) -> str:
    """Return the signature of a message as the text that ``ssh-keygen -Y sign`` writes.

    ``sign`` is asked for the raw SSH signature of the bytes that the format prescribes: a key in memory, or
    an agent. ``namespace`` says what the signature is for, so that one made elsewhere is no decision here.
    """
    signature = sign(_signed_data(message, namespace, "sha512"))
    blob = (
        MAGIC + struct.pack(">I", 1) + _string(public.blob) + _string(namespace.encode()) + _string(b"")
        + _string(b"sha512") + _string(signature)
    )  # fmt: skip
    return _armour(blob)


def check(text: str, message: bytes, namespace: str) -> PublicKey:
    """Return the key that signed a message; whose it is, the caller decides.

    Raises
    ------
    BadSignatureError
        it is no signature, one of another message or for another purpose, or by a key or
        digest that is refused
    """
    lines = text.strip().splitlines()
    if len(lines) < 3 or lines[0] != BEGIN or lines[-1] != END:
        raise BadSignatureError("it is no SSH signature")
    try:
        blob = base64.b64decode("".join(lines[1:-1]), validate=True)
    except binascii.Error as error:
        raise BadSignatureError("its text is damaged") from error
    if blob[:10] != MAGIC + struct.pack(">I", 1):
        raise BadSignatureError("it is no SSH signature of version 1")
    if text != _armour(blob):
        raise BadSignatureError("its text is not as ssh-keygen writes it")
    parts = _Reader(blob[10:])
    public_blob, purpose, reserved, digest, signature = (parts.string() for _ in range(5))
    parts.end()
    if reserved:
        raise BadSignatureError("there is more in it than there should be")
    if purpose != namespace.encode():
        raise BadSignatureError(
            f"it was made for {purpose.decode(errors='replace')!r}, not for {namespace!r}"
        )
    name = digest.decode(errors="replace")
    if name not in _DIGESTS:
        raise BadSignatureError(f"its digest {name!r} is refused")
    try:
        key = PublicKey(_Reader(public_blob).string().decode(), public_blob)
        check_raw(key, signature, _signed_data(message, namespace, _DIGESTS[name]))
    except (TrustError, UnicodeDecodeError) as error:
        raise BadSignatureError(getattr(error, "got", None) or "its key is damaged") from error
    return key


def check_raw(key: PublicKey, signature: bytes, data: bytes) -> None:
    """Hold a raw SSH signature against the bytes that it signs.

    Raises
    ------
    BadSignatureError
        it does not hold, or by an algorithm that is refused
    TrustError
        ``weak-key``
    """
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, padding, rsa, utils

    parts = _Reader(signature)
    algorithm, value = parts.string().decode(errors="replace"), parts.string()
    parts.end()
    public = public_object(key)
    try:
        if isinstance(public, ed25519.Ed25519PublicKey) and algorithm == ED25519:
            public.verify(value, data)
        elif isinstance(public, rsa.RSAPublicKey) and algorithm in ("rsa-sha2-256", "rsa-sha2-512"):
            digest = hashes.SHA512() if algorithm.endswith("512") else hashes.SHA256()
            public.verify(value, data, padding.PKCS1v15(), digest)
        elif isinstance(public, ec.EllipticCurvePublicKey) and algorithm == key.kind:
            numbers = _Reader(value)
            r, s = numbers.integer(), numbers.integer()
            numbers.end()
            digest_of_curve = getattr(hashes, _CURVES[key.kind][2])()
            public.verify(utils.encode_dss_signature(r, s), data, ec.ECDSA(digest_of_curve))
        else:
            raise BadSignatureError(f"its algorithm {algorithm!r} is refused for a key of kind {key.kind}")
    except (InvalidSignature, ValueError) as error:
        raise BadSignatureError("the key did not sign this content") from error


def _armour(blob: bytes) -> str:
    text = base64.b64encode(blob).decode()
    lines = [text[at : at + 70] for at in range(0, len(text), 70)]
    return "\n".join([BEGIN, *lines, END, ""])


def _signed_data(message: bytes, namespace: str, digest: Literal["sha256", "sha512"]) -> bytes:
    return (
        MAGIC + _string(namespace.encode()) + _string(b"") + _string(digest.encode())
        + _string(hashlib.new(digest, message).digest())
    )  # fmt: skip


def _string(data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + data


def _integer(value: int) -> bytes:
    return _string(value.to_bytes(value.bit_length() // 8 + 1, "big"))


class _Reader:
    """Strings and integers of SSH's wire format, one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def string(self) -> bytes:
        start = self._at + 4
        if start > len(self._data):
            raise BadSignatureError("it is cut off")
        (size,) = struct.unpack(">I", self._data[self._at : start])
        if start + size > len(self._data):
            raise BadSignatureError("it is cut off")
        self._at = start + size
        return self._data[start : self._at]

    def integer(self) -> int:
        value = int.from_bytes(self.string(), "big", signed=True)
        if value < 0:
            raise BadSignatureError("a number in it is negative")
        return value

    def skip(self) -> _Reader:
        self.string()
        return self

    def end(self) -> None:
        if self._at != len(self._data):
            raise BadSignatureError("there is more in it than there should be")


def _refused(got: object, expected: str, where: object = None) -> TrustError:
    return TrustError(
        "a key cannot be used", where=where, got=got, expected=expected,
        next_step="make a key with: ssh-keygen -t ed25519", rule="weak-key",
    )  # fmt: skip
