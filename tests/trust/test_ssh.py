"""SSH signatures: OpenSSH proves ours, we prove its, and what is weak or of another kind is refused."""

from __future__ import annotations

import base64
import subprocess
from pathlib import Path

import pytest

from toolkit.errors import TrustError
from toolkit.trust.keys import make_key, open_signer
from toolkit.trust.ssh import BadSignatureError, check, parse_public

NAMESPACE = "toolkit-ledger@v1"
MESSAGE = b'{"action":"approve"}'
GOOD = (
    ("ed25519", ()),
    ("rsa", ("-b", "3072")),
    ("ecdsa", ("-b", "256")),
    ("ecdsa", ("-b", "384")),
    ("ecdsa", ("-b", "521")),
)


def _keygen(folder: Path, kind: str, *options: str, passphrase: str = "") -> Path:
    path = folder / f"id_{kind}"
    command = ["ssh-keygen", "-q", "-t", kind, *options, "-N", passphrase, "-C", "anna", "-f", str(path)]
    subprocess.run(command, check=True)
    return path


def _ssh_verifies(
    folder: Path, public: str, signature: str, message: bytes, namespace: str = NAMESPACE
) -> bool:
    (folder / "allowed").write_text(f"anna {public}\n")
    (folder / "sig").write_text(signature)
    command = ["ssh-keygen", "-Y", "verify", "-f", str(folder / "allowed"), "-I", "anna", "-n", namespace]
    command += ["-s", str(folder / "sig")]
    return subprocess.run(command, input=message, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize(
    ("kind", "options"), GOOD, ids=lambda part: "-".join(part) if isinstance(part, tuple) else part
)
def test_openssh_proves_what_we_sign_and_we_prove_what_openssh_signs(
    tmp_path: Path, kind: str, options: tuple[str, ...]
) -> None:
    path = _keygen(tmp_path, kind, *options)
    signer = open_signer(path, lambda: "")
    armour = signer.armour(MESSAGE, NAMESPACE)
    assert _ssh_verifies(tmp_path, signer.public.line, armour, MESSAGE)
    assert not _ssh_verifies(tmp_path, signer.public.line, armour, MESSAGE + b" ")
    assert check(armour, MESSAGE, NAMESPACE) == signer.public

    command = ["ssh-keygen", "-q", "-Y", "sign", "-f", str(path), "-n", NAMESPACE]
    theirs = subprocess.run(command, input=MESSAGE, capture_output=True, check=True).stdout.decode()
    assert check(theirs, MESSAGE, NAMESPACE) == signer.public


def test_the_fingerprint_is_the_one_that_openssh_prints(tmp_path: Path) -> None:
    path = _keygen(tmp_path, "ed25519")
    printed = subprocess.run(
        ["ssh-keygen", "-l", "-f", str(path)], capture_output=True, check=True
    ).stdout.decode()
    assert parse_public(path.with_suffix(".pub").read_text()).fingerprint in printed


def test_a_key_that_we_make_is_encrypted_and_opens_in_openssh(tmp_path: Path) -> None:
    path = tmp_path / "key"
    public = make_key(path, "correct horse", "anna")
    assert path.stat().st_mode & 0o777 == 0o600
    command = ["ssh-keygen", "-y", "-P", "correct horse", "-f", str(path)]
    assert public.line in subprocess.run(command, capture_output=True, check=True).stdout.decode()
    wrong = subprocess.run([*command[:3], "wrong", *command[4:]], capture_output=True, check=False)
    assert wrong.returncode != 0
    with pytest.raises(TrustError, match="signing key"):
        open_signer(path, lambda: "wrong")
    with pytest.raises(TrustError):
        make_key(path, "another", "anna")
    assert open_signer(path, lambda: "correct horse").public == public


@pytest.mark.parametrize(("kind", "options"), [("rsa", ("-b", "2048")), ("rsa", ("-b", "1024"))])
def test_short_keys_are_refused(tmp_path: Path, kind: str, options: tuple[str, ...]) -> None:
    path = _keygen(tmp_path, kind, *options)
    with pytest.raises(TrustError) as refusal:
        parse_public(path.with_suffix(".pub").read_text())
    assert refusal.value.rule == "weak-key"
    with pytest.raises(TrustError):
        open_signer(path, lambda: "")
    command = ["ssh-keygen", "-q", "-Y", "sign", "-f", str(path), "-n", NAMESPACE]
    theirs = subprocess.run(command, input=MESSAGE, capture_output=True, check=True).stdout.decode()
    with pytest.raises(BadSignatureError):
        check(theirs, MESSAGE, NAMESPACE)


@pytest.mark.parametrize(
    "line", ["", "ssh-dss AAAAB3NzaC1kc3M=", "ssh-ed25519", "ssh-ed25519 AAAA", "ssh-ed25519 !!!!", "hello"]
)
def test_what_is_no_key_is_refused(line: str) -> None:
    with pytest.raises(TrustError):
        parse_public(line)


def test_another_message_purpose_or_byte_is_refused(tmp_path: Path) -> None:
    armour = open_signer(_keygen(tmp_path, "ed25519"), lambda: "").armour(MESSAGE, NAMESPACE)
    with pytest.raises(BadSignatureError):
        check(armour, MESSAGE + b"\n", NAMESPACE)
    with pytest.raises(BadSignatureError, match="it was made for"):
        check(armour, MESSAGE, "git")
    head, *lines, end = armour.strip().splitlines()
    blob = base64.b64decode("".join(lines))
    for at in range(len(blob)):
        changed = bytearray(blob)
        changed[at] ^= 1
        text = "\n".join([head, base64.b64encode(changed).decode(), end])
        with pytest.raises(BadSignatureError):
            check(text, MESSAGE, NAMESPACE)
    for size in range(len(blob)):
        with pytest.raises(BadSignatureError):
            check("\n".join([head, base64.b64encode(blob[:size]).decode(), end]), MESSAGE, NAMESPACE)
    with pytest.raises(BadSignatureError):
        check("\n".join([head, base64.b64encode(blob + b"x").decode(), end]), MESSAGE, NAMESPACE)
