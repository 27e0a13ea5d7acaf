"""A throw-away certificate authority, to try seals with: its certificates prove nothing to anybody else."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, field
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    NoEncryption,
    PrivateFormat,
    pkcs12,
)

from toolkit.trust.seal.key import SealKey

_YEAR = dt.timedelta(days=365)


@dataclass(frozen=True, slots=True, kw_only=True)
class Authority:
    """A self-signed root and its key."""

    certificate: x509.Certificate
    private: Any = field(repr=False)

    @property
    def pem(self) -> bytes:
        """The root as a file of trusted certificates."""
        return self.certificate.public_bytes(Encoding.PEM)

    def issue(
        self,
        name: str,
        *,
        private: Any = None,
        first: dt.datetime | None = None,
        last: dt.datetime | None = None,
        digest: Any = None,
        time_stamps: bool = False,
        between: tuple[x509.Certificate, ...] = (),
    ) -> SealKey:
        """Return a key with a certificate for ``name``; default: curve P-256, for a year from yesterday.

        With ``time_stamps`` it is that of a time-stamp server.
        """
        private = private or ec.generate_private_key(ec.SECP256R1())
        usage = x509.KeyUsage(
            digital_signature=True, content_commitment=True, key_encipherment=False, data_encipherment=False,
            key_agreement=False, key_cert_sign=False, crl_sign=False, encipher_only=False,
            decipher_only=False,
        )  # fmt: skip
        builder = _builder(name, private, first, last).issuer_name(self.certificate.subject)
        builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        builder = builder.add_extension(usage, critical=True)
        builder = builder.add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(self.private.public_key()), critical=False
        )
        if time_stamps:
            stamps = x509.ExtendedKeyUsage([x509.oid.ExtendedKeyUsageOID.TIME_STAMPING])
            builder = builder.add_extension(stamps, critical=True)
        certificate = builder.sign(self.private, digest or hashes.SHA256())
        return SealKey(private=private, certificate=certificate, intermediates=(*between, self.certificate))

    def revoke(self, key: SealKey, *, on: dt.datetime) -> x509.CertificateRevocationList:
        """Return a revocation list with one certificate."""
        entry = x509.RevokedCertificateBuilder().serial_number(key.certificate.serial_number)
        return (
            x509.CertificateRevocationListBuilder()
            .issuer_name(self.certificate.subject)
            .last_update(on)
            .next_update(on + _YEAR)
            .add_revoked_certificate(entry.revocation_date(on).build())
            .sign(self.private, hashes.SHA256())
        )


def make_authority(
    name: str = "Throw-away authority", *, above: Authority | None = None, private: Any = None
) -> Authority:
    """Make a root of ten years, or an authority below another one."""
    private = private or ec.generate_private_key(ec.SECP256R1())
    now = dt.datetime.now(dt.UTC)
    issuer = above.certificate.subject if above else _names(name)
    builder = _builder(name, private, now - _YEAR, now + 10 * _YEAR).issuer_name(issuer)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=1), critical=True)
    signed = builder.sign(above.private if above else private, hashes.SHA256())
    return Authority(certificate=signed, private=private)


def to_pem(key: SealKey, passphrase: bytes | None = None) -> bytes:
    """Return a key with its chain as one PEM file."""
    lock = BestAvailableEncryption(passphrase) if passphrase else NoEncryption()
    private: bytes = key.private.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, lock)
    return private + b"".join(c.public_bytes(Encoding.PEM) for c in (key.certificate, *key.intermediates))


def to_pkcs12(key: SealKey, passphrase: bytes) -> bytes:
    """Return a key with its chain as PKCS #12."""
    lock = BestAvailableEncryption(passphrase)
    return pkcs12.serialize_key_and_certificates(
        b"seal", key.private, key.certificate, key.intermediates, lock
    )


def _builder(
    name: str, private: Any, first: dt.datetime | None, last: dt.datetime | None
) -> x509.CertificateBuilder:
    now = dt.datetime.now(dt.UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(_names(name))
        .public_key(private.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(first or now - dt.timedelta(days=1))
        .not_valid_after(last or now + _YEAR)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(private.public_key()), critical=False)
    )


def _names(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name)])
