"""`toolkit verify` and `toolkit ledger check` of certificates as people issued them, and since.

The ledger of the home is withdrawn from, cut short, rewritten, and forged behind the issue.
"""

from __future__ import annotations

import functools
import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from tests import commands
from tests.calibration.registry.test_signatures import KEYS, RECORD, _found, _registry, _rewrite
from tests.report.template_factory import make, p
from tests.trust.seal.authority import to_pem
from tests.trust.seal.seal_factory import authority, flipped, key, trust
from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.approval import withdraw
from toolkit.calibration.registry.ledger import head_bytes
from toolkit.errors import ToolkitError
from toolkit.lab.home import packaged_home
from toolkit.lab.records.certificate import deliver_certificate
from toolkit.lab.signatures.people import check_against
from toolkit.lab.signatures.proofs import anchor_in, registry_ledger
from toolkit.lab.signatures.sealing import Sealing
from toolkit.lab.signatures.verification import Verdict, verify_file
from toolkit.report.word.package import read_template
from toolkit.trust.people import NAMESPACE
from toolkit.trust.seal.pdf import carried_by, proved_pdf
from toolkit.trust.seal.qr import Place
from toolkit.trust.seal.x509 import Trust

pytestmark = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


@dataclass(frozen=True)
class Issued:
    """A home whose people issued two certificates of a record: ``sealed/`` and ``plain/``."""

    home: Path

    def file(self, kind: str, suffix: str) -> Path:
        """Return a file of an issue by its ending."""
        return next((self.home / kind).glob(f"*{suffix}"))

    def verify(self, path: Path, *, known: Trust | None = None) -> Verdict:
        """Verify a file with the home's own ledger."""
        return verify_file(path, known or trust(), ledger=registry_ledger(lambda: _registry(self.home)))

    def continuity(self, path: Path) -> str:
        """Hold today's ledger against a file."""
        instrument, comparison = check_against(_registry(self.home), None, path)
        assert instrument == "m15-virtual"
        return comparison.continuity


@pytest.fixture(scope="module")
def issued_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("home")
    shutil.copytree(packaged_home() / "calibrations", home / "calibrations")
    shutil.copytree(packaged_home() / "report_templates", home / "report_templates")
    style = home / "report_templates" / "org.toml"
    style.write_text(style.read_text().replace("[laboratory]", '[laboratory]\ncountry = "DE"'))
    _found(home)
    template = read_template(home / "report_templates" / "certificate.docx")
    for kind, sealing in (("sealed", Sealing(key=key())), ("plain", None)):
        deliver_certificate(
            _registry(home, "anna"), RECORD, template, home / kind, issued=date(2026, 6, 1), draft=False,
            replaces=None, amendment=None, dcc=True, sealing=sealing, keep=False, step=lambda _text: None,
        )  # fmt: skip
    return home


@pytest.fixture
def issued(issued_once: Path, tmp_path: Path) -> Issued:
    return Issued(Path(shutil.copytree(issued_once, tmp_path / "home")))


FILES = [(kind, suffix) for kind in ("sealed", "plain") for suffix in (".pdf", ".docx", ".xml")]


@pytest.mark.parametrize(("kind", "suffix"), FILES)
def test_what_was_issued_holds(issued: Issued, kind: str, suffix: str) -> None:
    verdict = issued.verify(issued.file(kind, suffix))
    assert (verdict.ledger, verdict.still_holds) == ("continues", True)
    if (kind, suffix) == ("plain", ".pdf"):
        # Its own bytes stand in no entry: the words of the page may be anybody's.
        assert "nothing proves that what it shows is what was issued" in verdict.line
        assert "; still holds;" not in verdict.line
        assert (verdict.signature, verdict.code) == ("unsigned", 1)
        return
    assert (verdict.signature, verdict.code) == ("valid", 0), verdict.why
    assert verdict.issued_by == ("Tire laboratory" if kind == "sealed" else "Anna")
    assert verdict.issued_at is not None


@pytest.mark.skipif(shutil.which("xmlsec1") is None, reason="xmlsec1 is not installed")
def test_other_programs_verify_what_was_issued(issued: Issued) -> None:
    """The seals of both documents, and the entry in the ledger that their issue is."""
    folder = issued.home / "sealed"
    (folder / "root.pem").write_bytes(authority().pem)
    line = json.loads(_registry(issued.home).ledger("m15-virtual").lines[-2])
    assert line["event"] == "issued"
    (signature,) = line["signatures"]
    message = canonical({name: line[name] for name in line if name not in ("signatures", "sha256")}).encode()
    (folder / "line.sig").write_text(signature["sig"])
    (folder / "allowed").write_text(f"anna {KEYS['anna'].public.line}\n")
    ids = ("--id-attr:Id", "SignedProperties", "--id-attr:Id", "KeyInfo")
    pdf, xml = (str(issued.file("sealed", suffix)) for suffix in (".pdf", ".xml"))
    commands = (
        (["pdfsig", "-nocert", pdf], b"Signature is Valid"),
        (
            ["xmlsec1", "--verify", "--trusted-pem", "root.pem", *ids, xml],
            b"3/3",
        ),
        (
            ["ssh-keygen", "-Y", "verify", "-f", "allowed", "-I", "anna", "-n", NAMESPACE, "-s", "line.sig"],
            b"Good",
        ),
    )
    for command, words in commands:
        done = subprocess.run(command, cwd=folder, input=message, capture_output=True, check=False)
        assert done.returncode == 0, done.stderr
        assert words in done.stdout + done.stderr


@pytest.mark.parametrize(("kind", "suffix"), FILES)
def test_a_withdrawal_since_is_told_of_every_file(issued: Issued, kind: str, suffix: str) -> None:
    withdraw(_registry(issued.home, "anna"), RECORD, on=date(2026, 11, 21), reason="sign", by="anna")
    verdict = issued.verify(issued.file(kind, suffix))
    assert (verdict.ledger, verdict.still_holds, verdict.code) == ("continues", False, 1)
    assert "withdrawn since: sign" in verdict.why
    if suffix != ".docx":
        assert issued.continuity(issued.file(kind, suffix)) == "continues"


def _lines(home: Path) -> list[bytes]:
    return (home / "calibrations/m15-virtual/ledger.jsonl").read_bytes().splitlines(keepends=True)


def _rolled_back(home: Path) -> None:
    folder = home / "calibrations/m15-virtual"
    kept = _lines(home)[:2]
    (folder / "ledger.jsonl").write_bytes(b"".join(kept))
    (folder / "head.json").write_bytes(head_bytes(2, json.loads(kept[-1])["sha256"]))


def _rewritten(home: Path) -> None:
    lines = [json.loads(line) for line in _lines(home)]
    _rewrite(home, [lines[0], {**lines[1], "since": "2020-01-01"}, *lines[2:]])


def _changed(home: Path) -> None:
    path = home / "calibrations/m15-virtual/ledger.jsonl"
    path.write_bytes(path.read_bytes().replace(b"virtual checker", b"another checker", 1))


@pytest.mark.parametrize("suffix", [".pdf", ".xml"])
@pytest.mark.parametrize("kind", ["sealed", "plain"])
@pytest.mark.parametrize(
    ("attack", "continuity"), [(_rolled_back, "rolled_back"), (_rewritten, "forked"), (_changed, "forked")]
)
def test_a_ledger_that_became_another_is_told_of_every_document(
    issued: Issued, attack: Callable[[Path], None], continuity: str, kind: str, suffix: str
) -> None:
    attack(issued.home)
    file = issued.file(kind, suffix)
    assert issued.continuity(file) == continuity
    verdict = issued.verify(file)
    assert (verdict.ledger, verdict.code) == (continuity, 1)
    # A ledger that was cut off is sound in itself; but what it lost may have been a withdrawal.
    assert verdict.still_holds is False
    assert verdict.signature == ("valid" if kind == "sealed" else "unsigned")


def test_an_entry_forged_behind_the_issue_does_not_pass_for_a_sound_ledger(issued: Issued) -> None:
    lines = [json.loads(line) for line in _lines(issued.home)]
    _rewrite(issued.home, [*lines, {k: v for k, v in lines[-1].items() if k != "signatures"}])
    verdict = issued.verify(issued.file("plain", ".docx"))
    assert (verdict.ledger, verdict.still_holds, verdict.code) == ("continues", False, 1)
    assert "not signed" in verdict.why
    # Asked for the ledger alone: what does not hold by itself continues nothing.
    assert issued.continuity(issued.file("plain", ".pdf")) == "unknown"


def test_a_changed_file_is_none_of_the_issue(issued: Issued) -> None:
    for suffix in (".docx", ".xml"):
        path = issued.file("plain", suffix)
        data = path.read_bytes()
        path.write_bytes(
            data.replace(b"</dcc:value>", b"0</dcc:value>", 1) if suffix == ".xml" else data + b"!"
        )
        assert path.read_bytes() != data
        assert issued.verify(path).code == 2, suffix
    pdf = issued.file("sealed", ".pdf")
    pdf.write_bytes(flipped(pdf.read_bytes(), 5000))
    assert issued.verify(pdf).code == 2


@functools.cache
def _plain(pdf: bytes) -> bytes:
    """Return a document as it was before its proof was added."""
    return subprocess.run(["pdftocairo", "-pdf", "-", "-"], input=pdf, check=True, capture_output=True).stdout


def _with(pdf: Path, change: Callable[[dict[str, Any]], None]) -> None:
    proof = json.loads(carried_by(pdf.read_bytes())["toolkit.json"])
    change(proof)
    plain = _plain(pdf.read_bytes())
    place = Place(page=0, left=10, top=10, size=100)
    pdf.write_bytes(proved_pdf(plain, {"toolkit.json": json.dumps(proof).encode()}, b"x", place))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda proof: proof["ledger"].update(line=proof["ledger"]["line"] + " "), "proof does not hold"),
        (lambda proof: proof["ledger"].update(index=1), "proof does not hold"),
        (lambda proof: proof["records"][0].update(id="m15-r1"), "another record"),
        (lambda proof: proof["files"][0].update(sha256="0" * 64), "proof is of another"),
        (lambda proof: proof["ledger"].pop("path"), "cannot be read"),
    ],
)
def test_a_proof_that_was_tampered_with_is_no_proof(
    issued: Issued, change: Callable[[dict[str, Any]], None], why: str
) -> None:
    pdf = issued.file("plain", ".pdf")
    _with(pdf, change)
    verdict = issued.verify(pdf)
    assert (verdict.signature, verdict.code) == ("invalid", 2)
    assert why in verdict.why


def test_a_signer_whom_nobody_here_knows_is_untrusted(issued: Issued) -> None:
    """A customer has the files and no ledger."""
    verdict = verify_file(issued.file("plain", ".docx"), Trust())
    assert (verdict.signature, verdict.ledger, verdict.code) == ("untrusted", "unknown", 1)


def test_the_whole_proof_and_the_compact_one_are_of_one_entry(issued: Issued, tmp_path: Path) -> None:
    anchors = [
        anchor_in(issued.file(kind, suffix).read_bytes())
        for kind in ("sealed", "plain")
        for suffix in (".pdf", ".xml")
    ]
    assert all(anchor is not None and anchor.proved for anchor in anchors)
    assert [anchor.index for anchor in anchors if anchor] == [2, 2, 3, 3]
    for number, anchor in enumerate(anchors):
        assert anchor is not None
        (tmp_path / f"{number}.txt").write_bytes(anchor.compact)
        assert issued.continuity(tmp_path / f"{number}.txt") == "continues"
        verdict = issued.verify(tmp_path / f"{number}.txt")
        assert (verdict.kind, verdict.issued_by, verdict.code) == ("proof", "Anna", 0)


def test_a_record_and_its_ledger_are_verified_too(issued: Issued) -> None:
    folder = issued.home / "calibrations/m15-virtual"
    verdict = issued.verify(folder / "ledger.jsonl")
    assert (verdict.kind, verdict.signature, verdict.code) == ("ledger", "valid", 0)
    # It was entered before anybody was enrolled.
    verdict = issued.verify(folder / f"{RECORD}.json")
    assert (verdict.kind, verdict.signature, verdict.still_holds, verdict.code) == (
        "record",
        "unsigned",
        True,
        1,
    )
    _rewritten(issued.home)
    assert issued.verify(folder / "ledger.jsonl").code == 2
    assert issued.verify(issued.home / "people/ledger.jsonl").signature == "valid"


def test_a_manifest_that_was_not_issued_still_names_its_records(issued: Issued, tmp_path: Path) -> None:
    sha256 = _registry(issued.home).load(RECORD).sha256
    manifest = tmp_path / "manifest.json"
    manifest.write_text(
        json.dumps(
            {"outputs": [], "calibrations": [{"id": RECORD, "sha256": sha256}], "tested": "2026-06-01"}
        )
    )
    assert issued.verify(manifest).still_holds is True
    withdraw(_registry(issued.home, "anna"), RECORD, on=date(2026, 11, 21), reason="sign", by="anna")
    verdict = issued.verify(manifest)
    assert (verdict.signature, verdict.still_holds, verdict.code) == ("unsigned", False, 1)


def test_an_issued_report_says_the_day_of_its_test_to_whoever_verifies_it(
    virtual_test: Path, tmp_path: Path
) -> None:
    home = tmp_path / "home"
    shutil.copytree(packaged_home(), home)
    (home / "trust" / "certificates").mkdir(parents=True)
    (home / "trust" / "certificates" / "root.pem").write_bytes(authority().pem)
    (tmp_path / "key.pem").write_bytes(to_pem(key()))
    words = ("--template", make(tmp_path, p("{{tk:test.name}}")), "--seal", tmp_path / "key.pem")
    code, answer = commands.answer("report", virtual_test, "--out", tmp_path / "out", "--home", home, *words)
    assert code < 2, answer
    (line,) = [entry for entry in map(json.loads, _lines(home)) if entry["event"] == "issued"]
    assert line["document"]["tested"] == "2026-03-17"
    for name in ("report.pdf", "report.docx", "manifest.json"):
        code, verdict = commands.answer("verify", tmp_path / "out" / name, "--home", home)
        assert (code, verdict["signature"], verdict["still_holds"]) == (0, "valid", True), verdict
        assert "in force on 2026-03-17, the day of the test" in verdict["why"]
    manifest = tmp_path / "out" / "manifest.json"
    stated = json.loads(manifest.read_text())
    changes = {"simulated": False, "inputs": [], "tested": "2026-04-17", "calibrations": [], "ledger": None}
    outputs = [{**output, "bytes": output["bytes"] + 1} for output in stated["outputs"]]
    for name, value in {**changes, "outputs": outputs, "approved": "yes"}.items():
        manifest.write_text(json.dumps({**stated, name: value}))
        code, verdict = commands.answer("verify", manifest, "--home", home)
        assert (code, verdict["signature"]) == (2, "invalid"), (name, verdict)
    manifest.write_text(json.dumps(stated))  # other white space says the same
    assert commands.answer("verify", manifest, "--home", home)[0] == 0


def test_who_may_not_issue_leaves_nothing(issued: Issued) -> None:
    before = _lines(issued.home)
    template = read_template(issued.home / "report_templates" / "certificate.docx")
    for signers in ((), ("carl",), ("mallory",)):
        with pytest.raises(ToolkitError) as refusal:
            deliver_certificate(
                _registry(issued.home, *signers), RECORD, template, issued.home / "new", issued=None,
                draft=False, replaces=None, amendment=None, dcc=False, keep=False, step=lambda _text: None,
            )  # fmt: skip
        assert refusal.value.rule in ("not-signed", "not-allowed")
    assert _lines(issued.home) == before
    assert not (issued.home / "new").exists()


def test_the_last_page_shows_the_signatures_and_the_code(issued: Issued) -> None:
    pdf = issued.file("sealed", ".pdf")
    text = subprocess.run(["pdftotext", "-layout", str(pdf), "-"], check=True, capture_output=True, text=True)
    last = text.stdout.rstrip("\f\n").split("\f")[-1]
    assert "Signature: record unsigned; document issued by Anna" in last
    assert "entry of the laboratory's ledger" in last
    assert last.index("Signature:") < last.index("End of certificate")
    listed = subprocess.run(
        ["pdfimages", "-list", str(pdf)], check=True, capture_output=True, text=True
    ).stdout
    assert listed.splitlines()[-1].split()[:3] == [
        str(text.stdout.count("\f")),
        *listed.splitlines()[-1].split()[1:3],
    ]
