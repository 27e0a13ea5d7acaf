"""Keys and witnesses from the command line: what is asked for, and what is refused where nobody answers."""

from __future__ import annotations

import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.test_sign import keygen
from toolkit.calibration.registry.ledger import head_bytes
from toolkit.cli.main import run
from toolkit.lab.home import packaged_home

Call = Callable[..., tuple[object, str]]


@pytest.fixture
def call(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Call:
    """Commands in a home, with what they read from their input; code and what they said."""
    (tmp_path / "keys").mkdir()
    shutil.copytree(packaged_home() / "calibrations", tmp_path / "home/calibrations")
    monkeypatch.chdir(tmp_path / "home")

    def ran(*words: str, given: str = "") -> tuple[object, str]:
        monkeypatch.setattr("sys.stdin", io.StringIO(given))
        with pytest.raises(SystemExit) as ended:
            run(list(words))
        return ended.value.code, "".join(capsys.readouterr())

    return ran


@pytest.mark.parametrize(
    "words",
    [
        "person key ../keys/new",
        "ledger prove m15 --sign ../keys/locked",
        "ledger witness m15 ../north --name north --key ../keys/locked",
        "person enrol anna --name Anna --role head --key ../keys/locked.pub --sign ../keys/locked",
    ],
)
def test_where_nobody_answers_the_passphrase_is_named_and_nothing_is_made(call: Call, words: str) -> None:
    keygen(Path("../keys/locked"), "secret words")
    before = sorted(Path("..").rglob("*"))
    code, said = call(*words.split())
    assert code == 2
    for part in ("passphrase", "the end of the input", "next:", "SSH agent"):
        assert part in said
    assert sorted(Path("..").rglob("*")) == before


def test_the_first_line_of_the_input_is_the_passphrase(call: Call) -> None:
    assert call("person", "key", "../keys/new", given="secret words\n")[0] == 0
    witness = ("ledger", "witness", "m15", "../north", "--name", "north", "--key", "../keys/new")
    assert call(*witness, given="secret words\r\n")[0] == 0
    code, said = call(*witness, given="other words\n")
    assert (code, "damaged key, or another passphrase" in said) == (2, True)


@pytest.mark.parametrize("name", ["m16", "", "..", "../home/calibrations/m15"])
def test_a_ledger_that_is_none_is_neither_witnessed_nor_proved(call: Call, name: str) -> None:
    keygen(Path("../keys/plain"))
    for words in (
        ("ledger", "witness", name, "../north", "--name", "north", "--key", "../keys/plain"),
        ("ledger", "prove", name),
    ):
        code, said = call(*words)
        assert code == 2
        assert "no such instrument" in said
        assert "m15, m15-virtual" in said
    assert not Path("../north").exists()
    assert not Path("trust").exists()


def test_a_witness_of_one_ledger_says_nothing_of_another(call: Call) -> None:
    """m15-virtual-north is no checkpoint of m15, though its file's name begins so."""
    keygen(Path("../keys/plain"))
    for name in ("m15", "m15-virtual"):
        witness = ("ledger", "witness", name, "../north", "--name", "north", "--key", "../keys/plain")
        assert call(*witness)[0] == 0
    for name in ("m15", "m15-virtual"):
        _, said = call("verify", f"calibrations/{name}/ledger.jsonl")
        assert "are those that were issued" in said
        assert "rewritten" not in said
        assert "removed" not in said


def test_the_log_of_people_is_witnessed_as_a_ledger_is(call: Call) -> None:
    """Who removes the newest version of the people gives a revoked key its power back."""
    for name in ("plain", "anna", "ben"):
        keygen(Path("../keys") / name)
    words = ("--name", "Anna", "--role", "head", "--key", "../keys/anna.pub", "--sign", "../keys/anna")
    witness = ("ledger", "witness", "people", "../north", "--name", "north", "--key", "../keys/plain")
    code, said = call(*witness)
    assert (code, "no such instrument" in said) == (2, True), "nobody is enrolled yet"
    assert call("person", "enrol", "anna", *words, "--recovery", "../keys/ben")[0] == 0
    revoke = ("person", "revoke", "recovery", "--from", "2026-01-01T00:00:00Z", "--reason", "lost")
    code, said = call(*revoke, "--sign", "../keys/anna")
    assert code == 0, said
    code, said = call(*witness)
    assert code == 0, said
    code, proof = call("ledger", "prove", "people")
    assert code == 0, proof
    Path("../proof.json").write_text(proof)
    assert call("ledger", "check", "--against", "../proof.json")[0] == 0
    assert "continues" in call("verify", "../proof.json", "--json")[1]
    code, said = call("verify", "people/ledger.jsonl")
    assert (code, "are those that were issued" in said) == (0, True), said
    lines = Path("people/ledger.jsonl").read_bytes().splitlines(keepends=True)
    Path("people/ledger.jsonl").write_bytes(lines[0])
    Path("people/head.json").write_bytes(head_bytes(1, json.loads(lines[0])["sha256"]))
    Path("people/people-2.toml").unlink()
    code, said = call("person", "list")
    assert (code, "people-north.checkpoint" in said) == (2, True), "the log by itself is in order"
    code, said = call("calibration", "verify")
    assert (code, "entries were removed" in said) == (1, True), said
    code, said = call("ledger", "check", "--against", "../proof.json")
    assert (code, said.startswith("rolled_back")) == (1, True), said
    assert call("verify", "../proof.json")[0] == 1
    code, said = call("verify", "people/ledger.jsonl")
    assert (code, "entries were removed" in said) == (1, True), said
    assert call(*witness)[0] == 2


def test_a_key_without_room_for_its_public_half_is_none(call: Call) -> None:
    Path("../keys/new.pub").write_text("another's")
    code, said = call("person", "key", "../keys/new", given="secret words\n")
    assert (code, "FILE.pub" in said) == (2, True)
    assert [path.name for path in Path("../keys").iterdir()] == ["new.pub"]
    assert Path("../keys/new.pub").read_text() == "another's"


def test_a_witness_signs_nothing_that_the_home_cannot_keep(call: Call) -> None:
    keygen(Path("../keys/plain"))
    Path("trust").write_text("no folder")
    code, said = call("ledger", "witness", "m15", "../north", "--name", "north", "--key", "../keys/plain")
    assert (code, "Not a directory" in said) == (2, True), said
    assert not Path("../north").exists()


def test_a_witness_that_forgot_does_not_begin_again(call: Call) -> None:
    keygen(Path("../keys/plain"))
    witness = ("ledger", "witness", "m15", "../north", "--name", "north", "--key", "../keys/plain")
    assert call(*witness)[0] == 0
    for path in Path("../north").iterdir():
        path.unlink()
    code, said = call(*witness)
    assert (code, "has forgotten what it signed" in said) == (2, True), said
    assert list(Path("../north").iterdir()) == []
    assert call("ledger", "witness", "m15", "../south", "--name", "south", "--key", "../keys/plain")[0] == 0


def test_a_witness_is_none_of_the_laboratorys_people_and_what_is_typed_into_their_file_is_told(
    call: Call,
) -> None:
    for name in ("anna", "ben"):
        keygen(Path("../keys") / name)
    words = ("--name", "Anna", "--role", "head", "--key", "../keys/anna.pub", "--sign", "../keys/anna")
    assert call("person", "enrol", "anna", *words, "--recovery", "../keys/ben")[0] == 0
    for key in ("anna", "ben"):
        witness = ("ledger", "witness", "m15", "../north", "--name", "north", "--key", f"../keys/{key}")
        code, said = call(*witness, "--sign", "../keys/anna")
        assert (code, "somebody else" in said) == (2, True), said
    assert call("calibration", "verify")[0] == 0
    Path("people.toml").write_text(
        Path("people.toml").read_text().replace("signatures = 1", "signatures = 0")
    )
    code, said = call("calibration", "verify")
    assert (code, "not the newest version of the log of people" in said) == (1, True), said
