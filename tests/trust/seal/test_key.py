"""A key file opens once, outside of the home, with a certificate that holds."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import ed25519, rsa
from cryptography.hazmat.primitives.serialization import Encoding

from tests.trust.seal.authority import make_authority, to_pem, to_pkcs12
from tests.trust.seal.seal_factory import DAY, NOW, authority, key
from toolkit.errors import TrustError
from toolkit.lab.signatures.sealing import open_sealing
from toolkit.trust.seal.key import SealKey, open_key
from toolkit.trust.seal.x509 import Trust


def _never(_key: Path) -> str:
    raise AssertionError("no passphrase is needed")


def _written(folder: Path, data: bytes) -> Path:
    path = folder / "key"
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("encrypt", [to_pem, to_pkcs12])
def test_an_encrypted_key_opens_by_its_passphrase(tmp_path: Path, encrypt: object) -> None:
    path = _written(tmp_path, encrypt(key(), b"correct horse"))  # type: ignore[operator]
    opened = open_key(path, ask=lambda _: "correct horse")
    assert opened.certificate == key().certificate
    assert opened.chain == (key().certificate,)
    assert "private" not in repr(opened)
    for wrong in ("wrong", ""):
        with pytest.raises(TrustError) as caught:
            open_key(path, ask=lambda _, word=wrong: word)  # type: ignore[misc]
        assert caught.value.rule == "seal-key"
        assert "correct horse" not in str(caught.value)


def test_a_plain_key_asks_nothing_and_finds_its_chain_in_the_home(tmp_path: Path) -> None:
    pem = to_pem(key())
    alone = _written(tmp_path, pem[: pem.index(b"-----BEGIN CERTIFICATE-----")])
    chain = tmp_path / "laboratory.pem"
    chain.write_bytes(authority().pem + key().certificate.public_bytes(Encoding.PEM))
    assert open_key(alone, ask=_never, chain=chain).certificate == key().certificate
    with pytest.raises(TrustError) as caught:
        open_key(alone, ask=_never)
    assert caught.value.rule == "seal-certificate"


def test_a_key_in_the_home_is_refused(tmp_path: Path) -> None:
    (tmp_path / "trust").mkdir()
    path = _written(tmp_path / "trust", to_pem(key()))
    link = tmp_path.parent / f"{tmp_path.name}-link"
    link.symlink_to(path)
    for place in (path, link):
        with pytest.raises(TrustError, match="home"):
            open_key(place, ask=_never, home=tmp_path)


@pytest.mark.parametrize(
    ("first", "last"), [(NOW - 20 * DAY, NOW - DAY), (NOW + DAY, NOW + 20 * DAY)], ids=["expired", "early"]
)
def test_a_certificate_that_is_not_valid_today_does_not_seal(
    tmp_path: Path, first: dt.datetime, last: dt.datetime
) -> None:
    path = _written(tmp_path, to_pem(authority().issue("Tire laboratory", first=first, last=last)))
    with pytest.raises(TrustError) as caught:
        open_key(path, ask=_never)
    assert caught.value.rule == "seal-certificate"


def test_a_certificate_that_the_home_knows_to_be_revoked_does_not_seal(tmp_path: Path) -> None:
    signer = authority().issue("Tire laboratory")
    lists = (authority().revoke(signer, on=NOW - DAY),)
    path = _written(tmp_path, to_pem(signer))
    for roots in ((authority().certificate,), ()):  # a list counts beside its issuer, and without
        with pytest.raises(TrustError, match="was revoked on") as caught:
            open_key(path, ask=_never, trust=Trust(certificates=roots, revocations=lists))
        assert caught.value.rule == "seal-certificate"
    assert open_key(path, ask=_never, trust=Trust(certificates=(authority().certificate,)))


def test_a_certificate_below_one_that_was_revoked_does_not_seal(tmp_path: Path) -> None:
    between = make_authority("Between", above=authority())
    signer = between.issue("Tire laboratory")
    lists = (authority().revoke(SealKey(private=None, certificate=between.certificate), on=NOW - DAY),)
    known = Trust(certificates=(authority().certificate,), revocations=lists)
    with pytest.raises(TrustError, match="Between was revoked on"):
        open_key(_written(tmp_path, to_pem(signer)), ask=_never, trust=known)


def test_the_revocation_list_of_a_home_is_asked_before_anything_is_sealed(tmp_path: Path) -> None:
    home = tmp_path / "home"
    (home / "trust" / "certificates").mkdir(parents=True)
    signer = authority().issue("Tire laboratory")
    listed = authority().revoke(signer, on=NOW - DAY).public_bytes(Encoding.PEM)
    (home / "trust" / "certificates" / "lists.crl").write_bytes(listed)
    with pytest.raises(TrustError, match="was revoked on"):
        open_sealing(_written(tmp_path, to_pem(signer)), home, ask=_never)


@pytest.mark.parametrize(
    ("private", "rule"),
    [
        (rsa.generate_private_key(public_exponent=65537, key_size=2048), "seal-certificate"),
        (ed25519.Ed25519PrivateKey.generate(), "seal-key"),
    ],
    ids=["rsa-2048", "ed25519"],
)
def test_a_weak_key_or_one_of_another_kind_does_not_seal(tmp_path: Path, private: object, rule: str) -> None:
    path = _written(tmp_path, to_pem(authority().issue("Tire laboratory", private=private)))
    with pytest.raises(TrustError) as caught:
        open_key(path, ask=_never)
    assert caught.value.rule == rule


@pytest.mark.parametrize("data", [b"", b"\0" * 40, b"-----BEGIN PRIVATE KEY-----\nAAAA\n"])
def test_a_file_that_is_no_key_is_refused(tmp_path: Path, data: bytes) -> None:
    with pytest.raises(TrustError):
        open_key(_written(tmp_path, data), ask=lambda _: "")
    with pytest.raises(TrustError):
        open_key(tmp_path / "missing", ask=_never)


def test_another_keys_certificate_does_not_seal(tmp_path: Path) -> None:
    pem = to_pem(make_authority().issue("Other"))
    start = pem.index(b"-----BEGIN CERTIFICATE-----")
    mixed = pem[:start] + key().certificate.public_bytes(Encoding.PEM)
    with pytest.raises(TrustError) as caught:
        open_key(_written(tmp_path, mixed), ask=_never)
    assert caught.value.rule == "seal-certificate"
