"""A decision that travels: requested in the laboratory, signed on other computers, entered by its answers."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests import commands
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import TrustError
from toolkit.lab.home import packaged_home
from toolkit.report.certificate.collect import collect
from toolkit.report.style import Style
from toolkit.trust.keys import make_key

Run = Callable[..., tuple[int, str, str]]
RIG, RECORD = "m15-virtual", "m15-virtual-r1"
DECISION = (
    "calibration",
    "withdraw",
    RECORD,
    "--on",
    "2026-11-23",
    "--by",
    "anna",
    "--reason",
    "not traceable",
)
PEOPLE = (("anna", "head"), ("ben", "head"), ("carl", "operator"), ("dora", "checker"))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """A laboratory of four people whose keys lie outside of its home; the first words of what it answers."""
    (tmp_path / "keys").mkdir()
    shutil.copytree(packaged_home() / "calibrations", tmp_path / "home/calibrations")
    monkeypatch.chdir(tmp_path / "home")

    call = commands.said

    for name, _ in PEOPLE:
        keygen(tmp_path / "keys" / name)
    root = ("--sign", "../keys/anna", "--recovery", "../keys/ben")
    for name, role in PEOPLE:
        if name == "ben":
            continue
        words = ("--name", f"{name.title()} Example", "--role", role, "--key", f"../keys/{name}.pub")
        code, _, error = call("person", "enrol", name, *words, *(root if name == "anna" else root[:2]))
        assert code == 0, error
    return call


def keygen(path: Path, passphrase: str = "", kind: str = "ed25519") -> None:
    command = ["ssh-keygen", "-q", "-t", kind, "-N", passphrase, "-C", path.name, "-f", str(path)]
    command += ["-b", "3072"] if kind == "rsa" else []
    subprocess.run(command, check=True)


def _entries() -> int:
    return len(Registry(Path("calibrations")).ledger("m15-virtual").entries)


def test_what_is_signed_is_shown_in_words_and_entered_by_the_same_command(run: Run) -> None:
    before = _entries()
    code, out, _ = run(*DECISION, "--request", "../r.json", "--json")
    assert (code, json.loads(out)["takes"]) == (0, "1 of head")
    assert _entries() == before, "a request changes nothing"
    code, out, shown = run("sign", "../r.json", "--key", "../keys/anna", "--yes", "--json")
    assert (code, json.loads(out)["by"]) == (0, "anna")
    request = json.loads(Path("../r.json").read_text())
    for value in json.loads(request["message"]).values():
        for text in value.values() if isinstance(value, dict) else [value]:
            assert str(text) in shown, "whatever is signed is shown"
    assert "m15-virtual-r1" in shown
    assert "not traceable" in shown
    assert run(*DECISION, "--answer", "../r.anna.json")[0] == 0
    assert Registry(Path("calibrations")).status(RECORD).state == "withdrawn"
    assert run("calibration", "verify")[0] == 0


def test_who_wants_quiet_and_consents_beforehand_reads_nothing(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    assert run("sign", "../r.json", "--key", "../keys/anna", "--quiet")[0] == 2
    assert run("sign", "../r.json", "--key", "../keys/anna", "--yes", "--quiet") == (0, "", "")


def test_who_enters_and_who_approves_is_said_at_once(run: Run) -> None:
    plan = packaged_home() / "toolkit/examples/virtual/session_plan.toml"
    assert run("simulate", plan, "--out", "../session", "--seed", "7", "--quiet")[0] == 0
    code, out, error = run("calibrate", "../session/SESSION.toml", "--sign", "../keys/carl")
    entered = "signature: entered by Carl Example on "
    assert (code, entered in out) == (0, True), error
    who = ("--in-force-from", "2026-11-23", "--checked-by", "dora", "--sign", "../keys/dora")
    code, out, error = run("calibration", "approve", "m15-virtual-r2", *who, "--reason", "a new session")
    assert (code, ", approved by Dora Example on " in out) == (0, True), out + error
    assert entered in out
    certificate = collect(Registry(Path("calibrations")), "m15-virtual-r2", Style())
    assert certificate.checked_by == "Dora Example (dora)", "an id alone tells a customer nothing"


@pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
def test_a_certificate_is_issued_by_a_key_elsewhere(run: Run, tmp_path: Path) -> None:
    shutil.copytree(packaged_home() / "report_templates", "report_templates")
    words = ("calibration", "certificate", RECORD, "--out", "../issued", "--known-at", "2026-11-23")
    before = _entries()
    for named in ((), ("--issued-by", "nobody-enrolled")):
        code, _, error = run(*words, "--request", "../r.json", *named)
        assert (code, "the document states the name" in error) == (2, True)
        assert not (tmp_path / "r.json").exists()
    code, _, error = run(*words, "--request", "../r.json", "--issued-by", "dora")
    assert code == 0, error
    (shown,) = (tmp_path / "r.documents").glob("*.docx")
    assert (_entries(), (tmp_path / "issued").exists()) == (before, False), "a request issues nothing"
    code, _, error = run("sign", "../r.json", "--key", "../keys/anna", "--yes")
    assert (code, "it names Dora Example, and anna is another person" in error) == (2, True)
    assert run("sign", "../r.json", "--key", "../keys/dora", "--yes")[0] == 0
    code, _, error = run(*words[:-1], "2026-11-22", "--answer", "../r.dora.json")
    assert (code, "decides something else than what was signed" in error) == (2, True)
    assert (_entries(), (tmp_path / "issued").exists()) == (before, False), "another document is not issued"
    code, out, error = run(*words, "--answer", "../r.dora.json")
    assert (code, "document issued by Dora Example" in out) == (1, True), error
    (issued,) = (tmp_path / "issued").glob("*.docx")
    assert issued.read_bytes() == shown.read_bytes(), "what was read is what was issued"
    code, out, _ = run("verify", issued)
    assert (code, "VALID" in out) == (0, True)
    code, out, _ = run("ledger", "check", "--against", next((tmp_path / "issued").glob("*.pdf")))
    assert (code, out.startswith("continues")) == (0, True)


@pytest.mark.campaign("a second certificate, by an RSA key: one is issued by a key elsewhere in every run")
@pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
def test_whose_key_no_checkpoint_can_bear_issues_too(run: Run) -> None:
    """Tokens hold RSA keys, a checkpoint (C2SP) takes Ed25519: the entry was there and its document not."""
    keygen(Path("../keys/rosa"), kind="rsa")
    words = (
        "--name",
        "Rosa Example",
        "--role",
        "head",
        "--key",
        "../keys/rosa.pub",
        "--sign",
        "../keys/anna",
    )
    assert run("person", "enrol", "rosa", *words)[0] == 0
    shutil.copytree(packaged_home() / "report_templates", "report_templates")
    code, out, error = run(
        "calibration", "certificate", RECORD, "--out", "../issued", "--sign", "../keys/rosa"
    )
    assert (code, "document issued by Rosa Example" in out) == (1, True), error
    assert run("verify", next(Path("../issued").glob("*.docx")))[0] == 0


def test_a_policy_of_two_takes_two_people_from_two_computers(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    for name, words in (("carl", "operator"), ("dora", "checker")):
        code, _, error = run("sign", "../r.json", "--key", f"../keys/{name}", "--yes")
        assert (code, words in error) == (2, True)
    two = (*DECISION[:-1], "of two")
    policy = ("person", "policy", "withdraw", "--role", "head", "--reason", "x", "--sign", "../keys/anna")
    assert run(*policy, "--signatures", "2")[0] == 0
    assert run(*two, "--sign", "../keys/anna")[0] == 2
    # The recovery key is the second head here: first and second signature go one way, or two.
    assert run(*two, "--request", "../two.json")[0] == 0
    assert run("sign", "../two.json", "--key", "../keys/anna", "--yes")[0] == 0
    assert run("sign", "../two.anna.json", "--key", "../keys/anna", "--yes")[0] == 2
    assert run("sign", "../two.anna.json", "--key", "../keys/ben", "--yes")[0] == 0
    assert run("sign", "../two.json", "--key", "../keys/ben", "--yes")[0] == 0
    answers = ("--answer", "../two.anna.json", "--answer", "../two.recovery.json")
    for alone in ("anna", "recovery"):
        assert run(*two, "--answer", f"../two.{alone}.json")[0] == 2
    assert run(*two, *answers)[0] == 0
    signers = [
        row["by"] for row in Registry(Path("calibrations")).ledger("m15-virtual").entries[-1].signatures
    ]
    assert signers == ["anna", "recovery"]


def test_the_first_enrolment_travels_between_two_heads(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "new/calibrations").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "new")
    words = ["person", "enrol", "anna", "--name", "Anna", "--role", "head", "--key", "../keys/anna.pub"]
    words += ["--recovery", "../keys/ben"]
    assert run(*words, "--request", "../first.json")[0] == 2, "a request says who decides"
    assert "takes 2 of head" in run(*words, "--by", "anna", "--request", "../first.json")[1]
    for name in ("anna", "ben"):
        assert run("sign", "../first.json", "--key", f"../keys/{name}", "--yes")[0] == 0
    assert run(*words, "--answer", "../first.anna.json")[0] == 0, "the recovery key is at hand"
    assert "anna" in run("person", "list")[1]


def test_an_answer_is_refused_once_the_ledger_has_moved_on(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    assert run("sign", "../r.json", "--key", "../keys/anna", "--yes")[0] == 0
    other = (*DECISION[:-1], "another reason")
    code, _, error = run(*other, "--answer", "../r.anna.json")
    assert (code, "not traceable" in error) == (2, True)
    again = (
        "approve",
        RECORD,
        "--in-force-from",
        "2026-03-02",
        "--reason",
        "earlier",
        "--checked-by",
        "dora",
    )
    code, out, error = run("calibration", *again, "--sign", "../keys/dora")
    assert code == 0, out + error
    code, _, error = run(*DECISION, "--answer", "../r.anna.json")
    assert (code, "new request" in error, "1 entry later" in error) == (2, True, True)
    assert Registry(Path("calibrations")).status(RECORD).state == "approved"


def test_an_answer_is_refused_once_the_people_have_changed(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    assert run("sign", "../r.json", "--key", "../keys/anna", "--yes")[0] == 0
    time.sleep(1.1)  # the log of people counts seconds
    policy = ("person", "policy", "withdraw", "--role", "head", "--reason", "x", "--sign", "../keys/anna")
    assert run(*policy, "--signatures", "2")[0] == 0
    code, _, error = run(*DECISION, "--answer", "../r.anna.json")
    assert (code, "the people of the laboratory changed" in error) == (2, True), error


def test_a_request_and_its_answer_are_two_steps_of_a_laboratory_with_people(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json", "--answer", "../r.json")[0] == 2
    shutil.rmtree("people")
    code, _, error = run(*DECISION, "--request", "../r.json")
    assert (code, "nobody is enrolled" in error) == (2, True)
    Path("../r.json").write_text("{}")
    assert run("sign", "../r.json", "--key", "../keys/anna", "--yes")[0] == 2


def test_consent_and_a_key_are_asked_for_and_no_answer_is_written_over(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    for words in (
        (),
        ("--key", "../keys/anna", "--agent"),
        ("--key", "../keys/anna"),
        ("--key", "../keys/no"),
    ):
        consent = () if words == ("--key", "../keys/anna") else ("--yes",)
        assert run("sign", "../r.json", *words, *consent)[0] == 2
    assert list(Path("..").glob("r.*.json")) == []
    assert run("sign", "../r.json", "--key", "../keys/anna", "--yes")[0] == 0
    before = Path("../r.anna.json").read_bytes()
    code, _, error = run("sign", "../r.json", "--key", "../keys/anna", "--yes")
    assert (code, "never written over" in error) == (2, True)
    assert Path("../r.anna.json").read_bytes() == before


def test_a_passphrase_comes_by_a_descriptor_and_is_printed_nowhere(run: Run, tmp_path: Path) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    secret = "correct horse battery"  # noqa: S105
    subprocess.run(
        ["ssh-keygen", "-q", "-p", "-P", "", "-N", secret, "-f", "../keys/anna"],
        check=True,
        capture_output=True,
    )
    for phrase, expected in (("wrong", 2), (secret, 0)):
        reader, writer = os.pipe()
        os.write(writer, phrase.encode() + b"\n")
        os.close(writer)
        code, out, error = run(
            "sign", "../r.json", "--key", "../keys/anna", "--passphrase-fd", reader, "--yes"
        )
        os.close(reader)
        assert code == expected
        assert secret not in out + error
    assert run("sign", "../r.json", "--key", "../keys/anna", "--passphrase-fd", "99", "--yes")[0] == 2
    written = b"".join(path.read_bytes() for path in tmp_path.glob("*.json"))
    private = (tmp_path / "keys/anna").read_bytes().splitlines()[1]
    assert secret.encode() not in written
    assert private not in written


def test_a_private_key_in_a_home_is_refused(run: Run) -> None:
    shutil.copy("../keys/anna", "anna")
    code, _, error = run(*DECISION, "--sign", "anna")
    assert (code, "laboratory's home" in error) == (2, True)
    with pytest.raises(TrustError):
        make_key(Path("new"), "correct horse", "anna")
    assert not Path("new").exists()


@pytest.fixture
def agent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An SSH agent of the test's own."""
    place = tmp_path / "agent"
    process = subprocess.Popen(["ssh-agent", "-D", "-a", str(place)], stdout=subprocess.DEVNULL)
    monkeypatch.setenv("SSH_AUTH_SOCK", str(place))
    for _ in range(100):
        if place.exists():
            break
        subprocess.run(["sleep", "0.05"], check=True)
    yield
    process.terminate()
    process.wait()


@pytest.mark.usefixtures("agent")
def test_the_agents_key_is_the_one_that_may_sign(run: Run) -> None:
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    assert run("sign", "../r.json", "--agent", "--yes")[0] == 2
    for name in ("carl", "anna"):
        subprocess.run(["ssh-add", "-q", f"../keys/{name}"], check=True, capture_output=True)
    code, out, error = run("sign", "../r.json", "--agent", "--yes")
    assert (code, "signed by anna" in out) == (0, True), error
    assert run(*DECISION, "--answer", "../r.anna.json")[0] == 0
    subprocess.run(["ssh-add", "-q", "../keys/ben"], check=True, capture_output=True)
    code, _, error = run("sign", "../r.json", "--agent", "--yes", "--out", "../other.json")
    assert (code, "do not say who signs" in error) == (2, True), "two heads: nobody guesses"


@pytest.mark.parametrize("reason", ["a\x1b[2Jb", "b\u202ec", "\udcff", "\x08"])
def test_what_no_document_can_print_is_neither_requested_nor_signed(
    run: Run, tmp_path: Path, reason: str
) -> None:
    code, _, error = run(*DECISION[:-1], reason, "--request", "../r.json")
    assert (code, "no document can print" in error) == (2, True)
    assert run(*DECISION, "--request", "../r.json")[0] == 0
    # The same in a request that no command wrote: as an escape of JSON it is in no word of a command.
    request = next(tmp_path.rglob("r.json"))
    parts = json.loads(request.read_text(encoding="utf-8"))
    body = json.loads(parts["message"]) | {"reason": reason}
    parts["message"] = json.dumps(body, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    request.write_text(json.dumps(parts), encoding="utf-8")
    code, _, shown = run("sign", "../r.json", "--key", "../keys/anna", "--yes")
    assert (code, "no document can print" in shown) == (2, True)
    assert reason not in shown


def test_a_rehearsal_in_a_laboratory_with_people_needs_no_key(run: Run, tmp_path: Path) -> None:
    plan = packaged_home() / "toolkit/examples/virtual/session_plan.toml"
    assert run("simulate", plan, "--out", tmp_path / "session", "--seed", "3")[0] == 0
    session = tmp_path / "session" / "SESSION.toml"
    code, _, error = run("calibrate", session, "--dry-run")
    assert code in (0, 1), error
    assert run("calibrate", session)[0] == 2
    assert run("calibrate", session, "--request", "../enter.json")[0] == 0
    assert run("sign", "../enter.json", "--key", "../keys/carl", "--yes")[0] == 0
    code, _, error = run("calibrate", session, "--answer", "../enter.carl.json")
    assert code in (0, 1), error
    assert Registry(Path("calibrations")).ledger("m15-virtual").entries[-1].signatures[0]["by"] == "carl"


def test_what_nobody_could_read_again_or_change_again_is_never_entered(run: Run) -> None:
    keygen(Path("../keys/emil"))
    before = Path("people/ledger.jsonl").read_bytes()
    enrol = ("person", "enrol", "emil", "--role", "auditor", "--sign", "../keys/anna")
    for words in (
        (*enrol, "--key", "../keys/emil.pub", "--name", "Anna  EXAMPLE"),
        (*enrol, "--key", "../keys/dora.pub", "--name", "Emil"),
        (
            "person",
            "policy",
            "enrol",
            "--role",
            "head",
            "--signatures",
            "9",
            "--reason",
            "x",
            "--sign",
            "../keys/anna",
        ),
        ("person", "policy", "enrol", "--role", "king", "--reason", "x", "--sign", "../keys/anna"),
        ("person", "policy", "sing", "--role", "head", "--reason", "x", "--sign", "../keys/anna"),
    ):
        assert run(*words)[0] == 2, words
        assert Path("people/ledger.jsonl").read_bytes() == before
    assert run(*enrol, "--key", "../keys/emil.pub", "--name", "Emil")[0] == 0


@pytest.mark.parametrize(
    "words", [("m51",), ("m15-virtual", "--entry", "0"), ("m15-virtual", "--entry", "99")]
)
def test_a_proof_of_what_is_not_in_the_ledger_is_refused(run: Run, words: tuple[str, ...]) -> None:
    code, out, error = run("ledger", "prove", *words)
    assert (code, out) == (2, ""), error
    assert "there is no such instrument" in error or "no such entry" in error
