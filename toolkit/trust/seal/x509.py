"""Certificates: which are trusted, whether a signer's holds at the time of a seal, and what is too weak.

A path from the signer to a trusted certificate is built and checked by RFC 5280 (pyhanko-certvalidator),
offline. Beyond it, each certificate of the path, the trusted one too, must be valid at the time of the seal,
and its key strong enough: RSA from 3072 bits, elliptic curves from 256 (BSI TR-02102-1; ETSI TS 119 312).
A revocation counts from any date: without a time stamp nobody can tell that a seal is older.
"""

from __future__ import annotations

import asyncio
import datetime as dt
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec, ed448, ed25519, rsa
from cryptography.hazmat.primitives.serialization import Encoding, pkcs7

from toolkit.errors import TrustError
from toolkit.inputs import CERTIFICATE_FILE, read_regular

RSA_BITS, CURVE_BITS = 3072, 256
HASHES = ("sha256", "sha384", "sha512", "sha3-256", "sha3-384", "sha3-512")
AHEAD = dt.timedelta(minutes=5)
"""How far the clock of a signer may be ahead of this one."""

_SUFFIXES = frozenset((".pem", ".crt", ".cer", ".der"))

State = Literal["valid", "invalid", "untrusted"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trust:
    """Certificates that a laboratory trusts, and the revocation lists that it was given."""

    certificates: tuple[x509.Certificate, ...] = ()
    revocations: tuple[x509.CertificateRevocationList, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Whether a signer is trusted; ``path`` from the trusted certificate to the signer's where it holds."""

    state: State
    why: str
    path: tuple[x509.Certificate, ...] = ()


def read_trust(folder: Path) -> Trust:
    """Return what lies in a laboratory's folder ``certificates``: PEM or DER, and lists as ``*.crl``.

    A folder that does not exist trusts nobody.

    Raises
    ------
    TrustError
        ``trust-certificate``: a file holds no certificate, or no revocation list
    """
    certificates: list[x509.Certificate] = []
    revocations: list[x509.CertificateRevocationList] = []
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.suffix.lower() in _SUFFIXES:
            certificates += read_certificates(_content(path), where=path)
        elif path.suffix.lower() == ".crl":
            revocations.append(_revocation_list(_content(path), path))
    return Trust(certificates=tuple(certificates), revocations=tuple(revocations))


def with_files(trust: Trust, files: Iterable[Path]) -> Trust:
    """Return trust that holds the certificates of further files too.

    Raises
    ------
    TrustError
        ``trust-certificate``
    """
    further = [c for path in files for c in read_certificates(_content(path), where=path)]
    return Trust(certificates=(*trust.certificates, *further), revocations=trust.revocations)


def read_certificates(data: bytes, *, where: object) -> tuple[x509.Certificate, ...]:
    """Return the certificates of a file, PEM (several), DER or PKCS #7.

    Raises
    ------
    TrustError
        ``trust-certificate``
    """
    try:
        if b"-----BEGIN CERTIFICATE-----" in data:
            return tuple(x509.load_pem_x509_certificates(data))
        if b"-----BEGIN PKCS7-----" in data:
            return tuple(pkcs7.load_pem_pkcs7_certificates(data))
        return (load_certificate(data),)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise _no_certificate(where, "a certificate", error) from error


def load_certificate(der: bytes) -> x509.Certificate:
    """Return a certificate from DER.

    Raises
    ------
    ValueError
        it is none, or departs from RFC 5280 in what today is only warned of
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            certificate = x509.load_der_x509_certificate(der)
            _ = certificate.subject, certificate.issuer, certificate.serial_number, certificate.extensions
        except Warning as warning:
            raise ValueError(str(warning)) from warning
    return certificate


def judge(
    signer: x509.Certificate,
    intermediates: Sequence[x509.Certificate],
    trust: Trust,
    *,
    at: dt.datetime,
    stamped: bool = False,
    now: dt.datetime | None = None,
) -> Judgement:
    """Return whether a signer is trusted for a seal that was made ``at`` a time.

    Parameters
    ----------
    signer, intermediates : the certificate that verified the seal, and those that came with it
    at : time of the seal; as the signer states it, unless ``stamped``
    stamped : a trusted time stamp proves ``at``
    now : the present time, default the system's
    """
    now = now or dt.datetime.now(dt.UTC)
    if at > now + AHEAD:
        return Judgement(state="untrusted", why=f"sealed in the future, {_stamp(at)}")
    path = _path(signer, intermediates, trust, at)
    if isinstance(path, str):
        # Too weak tells more than unknown: anybody could have made it.
        weakness = weak_certificate(signer)
        return Judgement(state="invalid" if weakness else "untrusted", why=weakness or path)
    for certificate in path:
        if weakness := weak_certificate(certificate, anchor=certificate in trust.certificates):
            return Judgement(state="invalid", why=weakness)
        if reason := _outside(certificate, at) or _revoked(certificate, path, trust, at, stamped=stamped):
            return Judgement(state="untrusted", why=reason)
    if strangers := [_name(c) for c in intermediates if c not in path and c not in trust.certificates]:
        return Judgement(
            state="untrusted", why=f"a certificate that does not belong to its path: {strangers[0]}"
        )
    return Judgement(state="valid", why=f"trusted by {_name(path[0])}", path=path)


def objection(
    signer: x509.Certificate, intermediates: Sequence[x509.Certificate], trust: Trust, *, now: dt.datetime
) -> str:
    """Return why what a signer seals now would not be trusted, else nothing.

    Where no path leads to a trusted certificate the signer's alone is asked: whom others trust, they know.
    """
    found = _path(signer, intermediates, trust, now)
    path = (signer,) if isinstance(found, str) else found
    for certificate in path:
        reason = (
            weak_certificate(certificate, anchor=certificate in trust.certificates)
            or _outside(certificate, now)
            or _revoked(certificate, path, trust, now, stamped=False)
        )
        if reason:
            return reason
    return ""


def weak_certificate(certificate: x509.Certificate, *, anchor: bool = False) -> str:
    """Return why a certificate is too weak, else nothing; nobody uses the self-signature of an ``anchor``."""
    try:
        key = certificate.public_key()
    except (ValueError, UnsupportedAlgorithm) as error:
        return f"the key of {_name(certificate)} is of an unknown kind: {error}"
    if weakness := weak_key(key):
        return f"weak algorithm: {_name(certificate)} has {weakness}"
    try:
        digest = certificate.signature_hash_algorithm
    except UnsupportedAlgorithm as error:
        return f"weak algorithm: {_name(certificate)} is signed by an unknown hash: {error}"
    if not anchor and digest is not None and digest.name not in HASHES:
        return f"weak algorithm: {_name(certificate)} is signed by {digest.name.upper()}"
    return ""


def weak_key(key: object) -> str:
    """Return why a public key is too weak, empty where it is not."""
    if isinstance(key, rsa.RSAPublicKey):
        return "" if key.key_size >= RSA_BITS else f"an RSA key of {key.key_size} bits, under {RSA_BITS}"
    if isinstance(key, ec.EllipticCurvePublicKey):
        short = key.key_size < CURVE_BITS
        return f"a curve of {key.key_size} bits, under {CURVE_BITS}" if short else ""
    if isinstance(key, ed25519.Ed25519PublicKey | ed448.Ed448PublicKey):
        return ""
    return f"a key that is neither RSA nor of an elliptic curve ({type(key).__name__})"


def fingerprint(certificate: x509.Certificate) -> str:
    """Return the SHA-256 of a certificate, in hexadecimal digits, as ``openssl x509 -fingerprint`` has it."""
    from toolkit.files import sha256_bytes

    return sha256_bytes(certificate.public_bytes(Encoding.DER))


def subject(certificate: x509.Certificate) -> str:
    """Return whom a certificate names: common name and organisation."""
    names = []
    for oid in (x509.NameOID.COMMON_NAME, x509.NameOID.ORGANIZATION_NAME):
        names += [str(attribute.value) for attribute in certificate.subject.get_attributes_for_oid(oid)[:1]]
    return ", ".join(dict.fromkeys(names)) or certificate.subject.rfc4514_string() or "a nameless certificate"


def _name(certificate: x509.Certificate) -> str:
    try:
        return subject(certificate)
    except ValueError:
        return "a certificate whose name cannot be read"


def _path(
    signer: x509.Certificate, intermediates: Sequence[x509.Certificate], trust: Trust, at: dt.datetime
) -> tuple[x509.Certificate, ...] | str:
    from asn1crypto import x509 as asn1
    from pyhanko_certvalidator import CertificateValidator, ValidationContext
    from pyhanko_certvalidator.errors import PathError, ValidationError

    if not trust.certificates:
        return f"no certificate is enrolled: {_name(signer)} is unknown here"

    def as_asn1(certificates: Iterable[x509.Certificate]) -> list[asn1.Certificate]:
        return [asn1.Certificate.load(c.public_bytes(Encoding.DER)) for c in certificates]

    if signer in trust.certificates:
        return (signer,)
    reason = _issuer_outside(signer, trust, at)
    try:
        context = ValidationContext(
            trust_roots=as_asn1(trust.certificates),
            moment=at,
            allow_fetching=False,
            revocation_mode="soft-fail",
        )
        validator = CertificateValidator(
            as_asn1([signer])[0], intermediate_certs=as_asn1(intermediates), validation_context=context
        )
        usage = {"digital_signature"} if _may(signer, "digital_signature") else {"non_repudiation"}
        validated = asyncio.run(validator.async_validate_usage(usage))
    except (PathError, ValidationError, ValueError, TypeError, NotImplementedError) as error:
        return reason or f"no trusted path to {_name(signer)}: {_words(error)}"
    members = [part for part in validated if isinstance(part, asn1.Certificate)]
    return tuple(load_certificate(part.dump()) for part in members)


def _issuer_outside(signer: x509.Certificate, trust: Trust, at: dt.datetime) -> str:
    known = any(signer.issuer == certificate.subject for certificate in trust.certificates)
    return _outside(signer, at) if known else ""


def _may(certificate: x509.Certificate, usage: str) -> bool:
    try:
        declared = certificate.extensions.get_extension_for_class(x509.KeyUsage).value
    except (x509.ExtensionNotFound, ValueError):
        return True
    return bool(getattr(declared, usage))


def _outside(certificate: x509.Certificate, at: dt.datetime) -> str:
    if at < certificate.not_valid_before_utc:
        return (
            f"the certificate of {_name(certificate)} was not yet valid at the time of the seal, "
            f"{_stamp(at)}: valid from {_stamp(certificate.not_valid_before_utc)}"
        )
    if at > certificate.not_valid_after_utc:
        return (
            f"the certificate of {_name(certificate)} had expired at the time of the seal, {_stamp(at)}: "
            f"valid until {_stamp(certificate.not_valid_after_utc)}"
        )
    return ""


def _revoked(
    certificate: x509.Certificate,
    path: Sequence[x509.Certificate],
    trust: Trust,
    at: dt.datetime,
    *,
    stamped: bool,
) -> str:
    for listed in trust.revocations:
        if listed.issuer != certificate.issuer:
            continue
        issuers = [c for c in (*path, *trust.certificates) if c.subject == listed.issuer]
        # A list that the laboratory put there itself counts, unless its issuer is known and did not sign it.
        if issuers and not any(_signed(listed, issuer) for issuer in issuers):
            continue
        entry = listed.get_revoked_certificate_by_serial_number(certificate.serial_number)
        if entry is None or (stamped and at < entry.revocation_date_utc):
            continue
        day = entry.revocation_date_utc
        proof = "" if at >= day else ", and no time stamp proves that the seal is older"
        return f"the certificate of {_name(certificate)} was revoked on {_stamp(day)}{proof}"
    return ""


def _signed(listed: x509.CertificateRevocationList, issuer: x509.Certificate) -> bool:
    try:
        return listed.is_signature_valid(issuer.public_key())  # type: ignore[arg-type]
    except (InvalidSignature, ValueError, TypeError, UnsupportedAlgorithm):
        return False


def _revocation_list(data: bytes, path: Path) -> x509.CertificateRevocationList:
    try:
        pem = b"-----BEGIN X509 CRL-----" in data
        return x509.load_pem_x509_crl(data) if pem else x509.load_der_x509_crl(data)
    except (ValueError, UnsupportedAlgorithm) as error:
        raise _no_certificate(path, "a revocation list", error) from error


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, CERTIFICATE_FILE)
    except OSError as error:
        raise _no_certificate(path, "a file", error) from error


def _no_certificate(where: object, expected: str, error: Exception) -> TrustError:
    return TrustError(
        f"{expected} cannot be read",
        where=where,
        got=_words(error),
        expected=f"{expected}, PEM or DER",
        next_step="take the file away, or replace it by what its issuer gave out",
        rule="trust-certificate",
    )


def _words(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__


def _stamp(moment: dt.datetime) -> str:
    return moment.astimezone(dt.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
