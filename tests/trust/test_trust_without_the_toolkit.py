"""The commands by which an assessor verifies without the toolkit, as the page has them, are run here."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.trust.forgeries.laboratory import KEYS, RIG, laboratory
from tests.trust.seal.seal_factory import authority, sealed_pdf, sealed_xml
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.signatures.people import anchor_document, checkpoint_of

PAGE = Path(__file__).parents[2] / "docs" / "assessor.md"


def _blocks() -> list[str]:
    _, _, text = PAGE.read_text(encoding="utf-8").partition("## Without the toolkit")
    blocks = re.findall(r"(?:^ {4}.*\n(?:\n(?= {4}))?)+", text, flags=re.MULTILINE)
    return [re.sub(r"^ {4}", "", block, flags=re.MULTILINE) for block in blocks]


def _shell(folder: Path, block: str, entry: int = 1) -> subprocess.CompletedProcess[str]:
    command = ["bash", "-eu", "-o", "pipefail", "-c", block.replace("m15-virtual", RIG).replace("anna", "x")]
    environment = {"PATH": "/usr/local/bin:/usr/bin:/bin", "ENTRY": str(entry)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with laboratory() as home:
        shutil.copytree(home, tmp_path, dirs_exist_ok=True)
        registry = Registry(home / "calibrations", signers=[KEYS["anna"]])
        (tmp_path / "proof.json").write_text(anchor_document(registry, RIG, 3, checkpoint_of(registry, RIG)))
    (tmp_path / "certificate.pdf").write_bytes(sealed_pdf())
    (tmp_path / "certificate.xml").write_bytes(sealed_xml())
    (tmp_path / "root.pem").write_bytes(authority().pem)
    return tmp_path


def test_the_page_has_a_block_for_each_of_them() -> None:
    words = ("ssh-keygen -Y verify", "hashlib.sha256", "xmlsec1 --verify")
    assert [word in block for word, block in zip(words, _blocks(), strict=True)] == [True] * 3


@pytest.mark.parametrize("entry", range(1, 8))
def test_openssh_proves_each_line(folder: Path, entry: int) -> None:
    done = _shell(folder, _blocks()[0], entry)
    assert done.returncode == 0, done.stderr
    assert "Good" in done.stdout
    ledger = folder / f"calibrations/{RIG}/ledger.jsonl"
    ledger.write_text(ledger.read_text().replace('"time":"2026-03-01T12', '"time":"2026-03-01T11'))
    assert _shell(folder, _blocks()[0], entry).returncode != 0


def test_a_line_is_proved_by_hashing_alone(folder: Path) -> None:
    done = _shell(folder, _blocks()[1])
    assert (done.returncode, done.stdout) == (0, "line 3 of 7 is in the ledger of that checkpoint\n"), (
        done.stderr
    )
    proof = folder / "proof.json"
    proof.write_text(proof.read_text().replace("dora", "ben", 1))
    assert _shell(folder, _blocks()[1]).returncode != 0


@pytest.mark.skipif(shutil.which("xmlsec1") is None, reason="xmlsec1 is not installed")
def test_seals_are_verified_by_poppler_and_xmlsec(folder: Path) -> None:
    done = _shell(folder, _blocks()[2])
    assert done.returncode == 0, done.stderr
    assert "Signature Validation: Signature is Valid" in done.stdout
    assert "SignedInfo References (ok/all): 3/3" in done.stderr
    document = folder / "certificate.xml"
    document.write_bytes(document.read_bytes().replace(b"4711", b"0815"))
    assert _shell(folder, _blocks()[2]).returncode != 0
