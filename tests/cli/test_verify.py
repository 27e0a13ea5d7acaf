"""`toolkit verify`: one line a file, the contract's JSON, exit codes 0, 1 and 2."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests import commands
from tests.trust.seal.authority import make_authority
from tests.trust.seal.seal_factory import authority, flipped, key, plain_pdf, sealed_pdf
from toolkit.files import sha256_bytes
from toolkit.lab.signatures.proofs import statements_hash
from toolkit.trust.seal.pdf import seal_pdf
from toolkit.trust.seal.xml import seal_xml

CHECKOUT = Path(__file__).resolve().parents[2]
Run = Callable[..., tuple[int, Any]]
KEYS = {"file", "kind", "issued_by", "issued_at", "signature", "ledger", "still_holds", "why"}


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A home with the records of the checkout that trusts the authority."""
    import shutil

    shutil.copytree(CHECKOUT / "calibrations", tmp_path / "home" / "calibrations")
    (tmp_path / "home" / "trust" / "certificates").mkdir(parents=True)
    (tmp_path / "home" / "trust" / "certificates" / "root.pem").write_bytes(authority().pem)
    return tmp_path / "home"


@pytest.fixture
def run(home: Path) -> Run:
    return lambda *words: commands.answer("verify", *words, "--home", home)


def _issued(
    record: str, sha256: str, files: dict[str, bytes] | None = None, manifest: dict[str, Any] | None = None
) -> bytes:
    listed = [{"name": name, "sha256": sha256_bytes(data)} for name, data in (files or {}).items()]
    proof = {"schema": 1, "document": f"certificate of {record}", "files": listed,
             "records": [{"id": record, "sha256": sha256}]}  # fmt: skip
    proof |= {} if manifest is None else {"manifest": statements_hash(manifest)}
    attachments = {"toolkit.json": json.dumps(proof).encode()}
    return seal_pdf(plain_pdf(), key(), reason="issued", attachments=attachments)


def _sha256(home: Path, record: str) -> str:
    path = next((home / "calibrations").rglob(f"{record}.json"))
    return str(json.loads(path.read_bytes())["sha256"])


def test_a_document_over_a_record_in_force_still_holds(run: Run, home: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.pdf"
    file.write_bytes(_issued("m15-virtual-r1", _sha256(home, "m15-virtual-r1")))
    code, answer = run(file)
    assert code == 0
    assert set(answer) >= KEYS
    assert answer["files"] == [{key: answer[key] for key in answer["files"][0]}]
    assert (answer["kind"], answer["signature"], answer["ledger"]) == ("pdf", "valid", "unknown")
    assert (answer["issued_by"], answer["still_holds"]) == ("Tire laboratory", True)
    code, said, _ = commands.said("verify", file, "--home", home)
    assert code == 0
    assert said.count("\n") == 1
    for words in ("VALID", "by Tire laboratory at 20", "over certificate of m15-virtual-r1", "still holds"):
        assert words in said


def test_a_document_over_a_withdrawn_record_does_not_hold(run: Run, home: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.pdf"
    file.write_bytes(_issued("m15-r1", _sha256(home, "m15-r1")))
    code, answer = run(file)
    assert (code, answer["signature"], answer["still_holds"]) == (1, "valid", False)
    assert "withdrawn" in answer["why"]


def test_a_record_of_another_hash_is_another_record(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "a.pdf"
    file.write_bytes(_issued("m15-virtual-r1", "0" * 64))
    code, answer = run(file)
    assert (code, answer["still_holds"]) == (1, False)


def _sign_turned(text: str) -> str:
    """Return a record with a second content before its own, in which a sign is turned."""
    start = text.index('"content":') + len('"content":')
    content = text[start : text.index('\n },\n "schema"') + len("\n }")]
    turned = re.sub(r'("coefficients": \[\s*)-?', r"\g<1>-", content, count=1)
    assert turned != content
    return text[:start] + turned + ',\n "content":' + text[start:]


ALTERED: dict[str, Callable[[str], str]] = {
    "a second content": _sign_turned,
    "another software": lambda text: text.replace('"numpy": "', '"numpy": "9.', 1),
    "one key more": lambda text: text.replace('{\n "content"', '{\n "approved": true,\n "content"', 1),
    "a space": lambda text: text + " ",
}


@pytest.mark.parametrize("gone", [False, True])
def test_the_home_s_own_file_of_which_a_byte_differs_is_invalid(run: Run, home: Path, gone: bool) -> None:
    path = next((home / "calibrations").rglob("m15-virtual-r1.json"))
    file = path.with_name("copy.json") if gone else path
    changed = path.read_bytes() + b" "
    if gone:
        path.unlink()
    file.write_bytes(changed)
    code, answer = run(file)
    assert (code, answer["signature"]) == (2, "invalid"), answer["why"]
    assert "it is not the file of m15-virtual-r1 that was entered" in answer["why"]


@pytest.mark.parametrize("name", ALTERED)
def test_a_record_of_which_a_byte_differs_is_invalid(run: Run, home: Path, tmp_path: Path, name: str) -> None:
    path = next((home / "calibrations").rglob("m15-virtual-r1.json"))
    file = tmp_path / "m15-virtual-r1.json"
    file.write_text(ALTERED[name](path.read_text()))
    assert file.read_bytes() != path.read_bytes()
    code, answer = run(file)
    assert (code, answer["signature"]) == (2, "invalid"), answer["why"]
    file.write_bytes(path.read_bytes())
    assert run(file)[1]["still_holds"] is True


def test_the_worst_of_several_files_is_the_exit_code(run: Run, tmp_path: Path) -> None:
    stranger = make_authority().issue("Tire laboratory")
    contents = {
        "valid.pdf": (sealed_pdf(), 0, "valid"),
        "unsigned.pdf": (plain_pdf(), 1, "unsigned"),
        "untrusted.pdf": (seal_pdf(plain_pdf(), stranger, reason="issued"), 1, "untrusted"),
        "forged.pdf": (flipped(sealed_pdf(), 600), 2, "invalid"),
        "text.txt": (b"U = 0.1", 2, "invalid"),
    }
    for name, (data, expected, signature) in contents.items():
        (tmp_path / name).write_bytes(data)
        code, answer = run(tmp_path / name)
        assert (code, answer["signature"]) == (expected, signature), name
    code, answer = run(*(tmp_path / name for name in contents), tmp_path / "missing.pdf")
    assert code == 2
    assert [row["signature"] for row in answer["files"]][:3] == ["valid", "unsigned", "untrusted"]
    assert len(answer["files"]) == 6
    code, answer = run(tmp_path / "valid.pdf", tmp_path / "untrusted.pdf")
    assert code == 1


@pytest.mark.parametrize("seal", [plain_pdf, sealed_pdf])
def test_of_a_document_that_names_no_record_no_ledger_is_said_to_know_none(
    run: Run, tmp_path: Path, seal: Callable[[], bytes]
) -> None:
    """An unsigned laboratory's certificate prints its record's hash, and carries none: nothing was asked."""
    (tmp_path / "a.pdf").write_bytes(seal())
    _, answer = run(tmp_path / "a.pdf")
    assert (answer["ledger"], answer["still_holds"]) == ("unknown", None)
    assert "no ledger here knows" not in answer["why"]
    assert "carries no record's hash" in answer["why"]


def test_a_certificate_named_at_the_command_is_trusted_too(run: Run, tmp_path: Path) -> None:
    other = make_authority("Other authority")
    (tmp_path / "root.pem").write_bytes(other.pem)
    (tmp_path / "a.pdf").write_bytes(seal_pdf(plain_pdf(), other.issue("Elsewhere"), reason="issued"))
    assert run(tmp_path / "a.pdf")[0] == 1
    code, answer = run(tmp_path / "a.pdf", "--trust", tmp_path / "root.pem")
    assert (code, answer["issued_by"]) == (0, "Elsewhere")
    assert run(tmp_path / "a.pdf", "--trust", tmp_path / "a.pdf")[0] == 2


def test_a_digital_certificate_names_its_record(run: Run, home: Path, tmp_path: Path) -> None:
    from tests.calibration.dcc.dcc_factory import plain_dcc

    def identification(value: str, name: str) -> str:
        return (
            "<dcc:identification><dcc:issuer>calibrationLaboratory</dcc:issuer>"
            f"<dcc:value>{value}</dcc:value><dcc:name><dcc:content>{name}</dcc:content></dcc:name>"
            "</dcc:identification>"
        )

    named = identification("m15-r1", "Calibration record")
    named += identification(_sha256(home, "m15-r1"), "SHA-256 of the record")
    mark = b"</dcc:uniqueIdentifier>"
    text = f"<dcc:identifications>{named}</dcc:identifications>".encode()
    (tmp_path / "a.xml").write_bytes(seal_xml(plain_dcc().replace(mark, mark + text), key()))
    code, answer = run(tmp_path / "a.xml")
    assert (code, answer["kind"], answer["over"]) == (1, "dcc", "certificate K-2025-17")
    assert (answer["signature"], answer["still_holds"]) == ("valid", False)
    (tmp_path / "b.xml").write_bytes(seal_xml(b"<other/>", key()))
    assert run(tmp_path / "b.xml")[0] == 2


def test_a_word_file_is_proved_by_the_pdf_that_was_issued_with_it(
    run: Run, home: Path, tmp_path: Path
) -> None:
    word = b"PK\x03\x04 a Word file"
    (tmp_path / "a.docx").write_bytes(word)
    assert run(tmp_path / "a.docx")[1]["signature"] == "unsigned"
    (tmp_path / "a.pdf").write_bytes(
        _issued("m15-virtual-r1", _sha256(home, "m15-virtual-r1"), {"a.docx": word})
    )
    code, answer = run(tmp_path / "a.docx")
    assert (code, answer["signature"], answer["still_holds"]) == (0, "valid", True)
    (tmp_path / "a.docx").write_bytes(word + b"!")
    assert run(tmp_path / "a.docx")[0] == 2
    tire = b"[UNITS]\n"
    (tmp_path / "t.tir").write_bytes(tire)
    assert run(tmp_path / "t.tir")[0] == 2
    (tmp_path / "a.pdf").write_bytes(
        _issued("m15-virtual-r1", _sha256(home, "m15-virtual-r1"), {"t.tir": tire})
    )
    assert run(tmp_path / "t.tir")[0] == 0


def test_a_manifest_holds_its_files_and_is_proved_by_their_pdf(run: Run, home: Path, tmp_path: Path) -> None:
    word, pdf = b"PK\x03\x04 a Word file", plain_pdf()

    def write(pdf: bytes) -> Path:
        outputs = [
            {"name": "r.docx", "sha256": sha256_bytes(word)},
            {"name": "r.pdf", "sha256": sha256_bytes(pdf)},
        ]
        (tmp_path / "r.docx").write_bytes(word)
        (tmp_path / "r.pdf").write_bytes(pdf)
        (tmp_path / "manifest.json").write_text(json.dumps({"schema": 1, "outputs": outputs}))
        return tmp_path / "manifest.json"

    said = {"schema": 1}
    assert run(write(pdf))[1]["signature"] == "unsigned"
    of_older_version = _issued("m15-virtual-r1", _sha256(home, "m15-virtual-r1"), {"r.docx": word})
    code, answer = run(write(of_older_version))
    assert (code, answer["signature"]) == (1, "unsigned")
    assert "r.pdf proves the files that it lists, and nothing else that it says" in answer["why"]
    sealed = _issued("m15-virtual-r1", _sha256(home, "m15-virtual-r1"), {"r.docx": word}, said)
    code, answer = run(write(sealed))
    assert (code, answer["kind"], answer["signature"]) == (0, "manifest", "valid")
    assert run(write(_issued("m15-virtual-r1", _sha256(home, "m15-virtual-r1"))))[0] == 1
    write(sealed)
    (tmp_path / "r.docx").write_bytes(word + b"!")
    assert run(tmp_path / "manifest.json")[0] == 2
    for name in ("r.docx", "r.pdf"):  # lost, or of another name: which of them the answer says
        manifest = write(sealed)
        (tmp_path / name).rename(tmp_path / f"copy of {name}")
        code, answer = run(manifest)
        assert (code, answer["kind"]) == (2, "manifest")
        assert answer["why"].startswith(f"{name}, which it lists, cannot be read")
    (tmp_path / "manifest.json").write_text('{"outputs": [{"name": "../x", "sha256": "0"}]}')
    assert run(tmp_path / "manifest.json")[0] == 2


def test_a_record_of_the_registry_is_held_against_its_own_hash(run: Run, home: Path, tmp_path: Path) -> None:
    path = home / "calibrations" / "m15-virtual" / "m15-virtual-r1.json"
    code, answer = run(path)
    assert (code, answer["kind"], answer["signature"]) == (1, "record", "unsigned")
    assert answer["still_holds"] is True
    (tmp_path / "record.json").write_bytes(path.read_bytes().replace(b'"m15-virtual"', b'"m15-virtuak"'))
    assert run(tmp_path / "record.json")[0] == 2
