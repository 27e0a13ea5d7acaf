"""Keys and witnesses from the command line: what is asked for, and what is refused where nobody answers."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.test_sign import keygen
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
