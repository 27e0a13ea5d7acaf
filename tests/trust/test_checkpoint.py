"""Signed checkpoints and witnesses, held against the published example of the signed note."""

from __future__ import annotations

import base64
import hashlib
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from tests.trust.signatures import signed_by, witnessed_at
from toolkit.errors import TrustError
from toolkit.trust.checkpoint import Checkpoint, countersign, parse_checkpoint, place
from toolkit.trust.keys import Signer
from toolkit.trust.merkle import leaf_hash, root_of
from toolkit.trust.ssh import parse_public, public_of, sign_with

# golang.org/x/mod/sumdb/note, package example: the note, its signature line and its verifier key.
NOTE = "If you think cryptography is the answer to your problem,\nthen you don't know what your problem is.\n"
NAME = "PeterNeumann"
SIGNATURE = "x08go/ZJkuBS9UG/SffcvIAQxVBtiFupLLr8pAcElZInNIuGUgYN1FFYC2pZSNXgKvqfqdngotpRZb6KE6RyyBwJnAM="
VERIFIER = "PeterNeumann+c74f20a3+ARpc2QcUPDhMQegwxbzhKqiBfsVkmqq/LDE4izWy10TW"

LINES = [f"line {number}" for number in range(20)]


def _signer() -> Signer:
    private = Ed25519PrivateKey.generate()
    return Signer(public_of(private), lambda data: sign_with(private, data))


def _checkpoint(lines: list[str]) -> Checkpoint:
    return Checkpoint(
        origin="m15", size=len(lines), root=root_of([leaf_hash(line.encode()) for line in lines])
    )


def test_the_published_note_has_our_key_id_and_signature() -> None:
    blob = base64.b64decode(SIGNATURE)
    name, number, key = VERIFIER.split("+", 2)
    raw = base64.b64decode(key)
    ours = hashlib.sha256(name.encode() + b"\n" + raw).digest()[:4]
    assert blob[:4] == ours == bytes.fromhex(number)
    Ed25519PublicKey.from_public_bytes(raw[1:]).verify(blob[4:], NOTE.encode())


def test_a_signed_checkpoint_reads_back_and_proves_its_signer() -> None:
    anna, ben = _signer(), _signer()
    checkpoint = _checkpoint(LINES).signed("anna", anna)
    again = parse_checkpoint(checkpoint.text)
    assert again == checkpoint
    assert signed_by(again, "anna", anna.public)
    assert not signed_by(again, "ben", anna.public)
    assert not signed_by(again, "anna", ben.public)
    # The signature line is an Ed25519 signature of the three lines of the body, by the key alone.
    line = again.text.split("\n\n")[1].split()[-1]
    key = Ed25519PublicKey.from_public_bytes(anna.public.raw)
    key.verify(base64.b64decode(line)[4:], again.text.split("\n\n")[0].encode() + b"\n")


def test_a_checkpoint_of_another_size_is_not_signed() -> None:
    anna = _signer()
    text = _checkpoint(LINES).signed("anna", anna).text
    assert not signed_by(parse_checkpoint(text.replace("m15\n20\n", "m15\n21\n")), "anna", anna.public)


@pytest.mark.parametrize(
    ("old", "new"), [("\n20\n", "\n020\n"), ("\n20\n", "\n-20\n"), ("\n\n", "\n"), ("m15", ""), ("= ", " ")]
)
def test_what_is_no_checkpoint_is_refused(old: str, new: str) -> None:
    text = _checkpoint(LINES).signed("anna", _signer()).text
    with pytest.raises(TrustError):
        parse_checkpoint(text.replace(old, new, 1) if old in text else text.replace("— ", "- "))


def test_a_witness_signs_growth_and_the_time(tmp_path: Path) -> None:
    witness = _signer()
    first = countersign(tmp_path, "north", witness, _checkpoint(LINES[:5]), LINES, time=1_790_000_000)
    assert first.before == 0
    second = countersign(tmp_path, "north", witness, _checkpoint(LINES), LINES, time=1_790_000_100)
    assert second.before == 5
    assert witnessed_at(second.checkpoint, "north", witness.public) == 1_790_000_100
    assert witnessed_at(second.checkpoint, "south", witness.public) is None
    assert witnessed_at(second.checkpoint, "north", _signer().public) is None


@pytest.mark.parametrize(
    ("lines", "rule"),
    [
        (LINES[:4], "ledger-rollback"),
        (["rewritten", *LINES[1:]], "ledger-fork"),
        ([*LINES[:4], "rewritten", *LINES[5:]], "ledger-fork"),
        ([*LINES[:2], *LINES[3:]], "ledger-fork"),
    ],
)
def test_a_witness_refuses_what_is_no_continuation_and_keeps_its_memory(
    tmp_path: Path, lines: list[str], rule: str
) -> None:
    witness = _signer()
    countersign(tmp_path, "north", witness, _checkpoint(LINES[:5]), LINES, time=1)
    before = place(tmp_path, "m15").read_bytes()
    with pytest.raises(TrustError) as refusal:
        countersign(tmp_path, "north", witness, _checkpoint(lines), lines, time=2)
    assert refusal.value.rule == rule
    assert place(tmp_path, "m15").read_bytes() == before


def test_a_witness_of_a_damaged_memory_does_not_begin_again(tmp_path: Path) -> None:
    place(tmp_path, "m15").write_text("")
    with pytest.raises(TrustError):
        countersign(tmp_path, "north", _signer(), _checkpoint(LINES), LINES, time=1)


def test_a_name_of_a_log_never_leaves_the_witness_folder(tmp_path: Path) -> None:
    assert place(tmp_path, "../../etc/passwd").parent == tmp_path


def test_only_ed25519_signs_checkpoints(tmp_path: Path) -> None:
    from cryptography.hazmat.primitives.asymmetric import ec

    private = ec.generate_private_key(ec.SECP256R1())
    signer = Signer(public_of(private), lambda data: sign_with(private, data))
    assert parse_public(signer.public.line) == signer.public
    with pytest.raises(TrustError):
        _checkpoint(LINES).signed("anna", signer)
