"""The laboratory's key: from a file outside the home, with its certificate, opened for one command.

PKCS #12 holds key and chain; beside a PEM key the chain stands in the same file or in the home's
``trust/laboratory.pem``. A passphrase is asked for once and neither stored nor printed.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat, load_pem_private_key, pkcs12

from toolkit.errors import TrustError
from toolkit.files import real_path
from toolkit.inputs import CERTIFICATE_FILE, read_regular
from toolkit.trust.seal.x509 import Trust, objection, read_certificates, subject

Ask = Callable[[Path], str]
"""Asks a person for the passphrase of a key file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SealKey:
    """A private key with its certificate and those between it and its root, ready to seal."""

    private: Any = field(repr=False)
    certificate: x509.Certificate
    intermediates: tuple[x509.Certificate, ...] = ()

    @property
    def chain(self) -> tuple[x509.Certificate, ...]:
        """The certificates that go into a seal: the signer's first, no self-signed root."""
        return (self.certificate, *(c for c in self.intermediates if c.issuer != c.subject))

    @property
    def name(self) -> str:
        """Whom the certificate names."""
        return subject(self.certificate)


def open_key(
    path: Path, *, ask: Ask, chain: Path | None = None, home: Path | None = None, trust: Trust | None = None
) -> SealKey:
    """Read a key file and the certificate that belongs to it.

    Parameters
    ----------
    ask : asked once, where the file is encrypted
    chain : PEM with the certificate, where the key file holds none
    home : the laboratory's home, in which no key may lie: homes are copied
    trust : what the home trusts, and which certificates it knows to be revoked

    Raises
    ------
    TrustError
        ``seal-key``: the file cannot be read, or lies in the home; ``seal-certificate``: no certificate
        belongs to the key, or one that has expired or was revoked, or too weak a key
    """
    if home is not None and real_path(path).is_relative_to(real_path(home)):
        raise _refused(
            "the key lies in the laboratory's home", path, "a private key in a folder that is copied",
            "a key file elsewhere",
            "move the key out of the home; only certificates belong there", "seal-key",
        )  # fmt: skip
    data = _bytes(path)
    try:
        private, certificates = _parts(data, None)
    except TypeError:
        try:
            private, certificates = _parts(data, ask(path).encode())
        except (ValueError, TypeError) as error:
            raise _refused(
                "the key file cannot be opened", path, "not by this passphrase", "the key's passphrase",
                "try again with the right one", "seal-key",
            ) from error  # fmt: skip
    except (ValueError, UnsupportedAlgorithm) as error:
        raise _refused(
            "the key file cannot be read", path, " ".join(str(error).split())[:120],
            "a private key as PEM or PKCS #12", "name another file", "seal-key",
        ) from error  # fmt: skip
    if chain is not None and chain.is_file():
        certificates += tuple(
            c for c in read_certificates(_bytes(chain), where=chain) if c not in certificates
        )
    public = _public(private.public_key())
    certificate = next((c for c in certificates if _public(c.public_key()) == public), None)
    if certificate is None:
        raise _refused(
            "no certificate belongs to the key", path, f"{len(certificates)} certificates of other keys",
            "the certificate of this key, in its file or in trust/laboratory.pem of the home",
            "put the chain into trust/laboratory.pem, or use a PKCS #12 file", "seal-certificate",
        )  # fmt: skip
    if not isinstance(private, rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey):
        raise _refused(
            "the key is of a kind that cannot seal both PDF and XML", path, type(private).__name__,
            "an RSA key, or one of an elliptic curve", "ask for a certificate of such a key", "seal-key",
        )  # fmt: skip
    intermediates = tuple(c for c in certificates if c != certificate)
    if reason := objection(certificate, intermediates, trust or Trust(), now=dt.datetime.now(dt.UTC)):
        raise _refused(
            "the laboratory's certificate cannot seal today", path, reason,
            "a certificate that is valid today and not revoked: RSA from 3072 bits or a curve from 256, "
            "signed by SHA-256 or better",
            "ask for a new certificate; nothing was sealed", "seal-certificate",
        )  # fmt: skip
    return SealKey(private=private, certificate=certificate, intermediates=intermediates)


def _parts(data: bytes, passphrase: bytes | None) -> tuple[Any, tuple[x509.Certificate, ...]]:
    """Return key and certificates; a TypeError asks for the passphrase."""
    if b"-----BEGIN" in data:
        private = load_pem_private_key(data, passphrase)
        inside = b"-----BEGIN CERTIFICATE-----" in data
        return private, tuple(x509.load_pem_x509_certificates(data)) if inside else ()
    try:
        key, certificate, intermediates = pkcs12.load_key_and_certificates(data, passphrase)
    except ValueError as error:
        # Of an encrypted file without a passphrase it says "invalid password".
        if passphrase is None and "password" in str(error).lower():
            raise TypeError("encrypted") from error
        raise
    if key is None:
        raise ValueError("the file holds no private key")
    return key, tuple(c for c in (certificate, *intermediates) if c is not None)


def _public(key: Any) -> bytes:
    encoded: bytes = key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
    return encoded


def _bytes(path: Path) -> bytes:
    try:
        return read_regular(path, CERTIFICATE_FILE)
    except OSError as error:
        raise _refused(
            "a file of the seal cannot be read", path, error.strerror, "the laboratory's key and certificate",
            "check --seal, or TOOLKIT_SEAL_KEY", "seal-key",
        ) from error  # fmt: skip


def _refused(what: str, where: object, got: object, expected: str, next_step: str, rule: str) -> TrustError:
    return TrustError(what, where=where, got=got, expected=expected, next_step=next_step, rule=rule)
