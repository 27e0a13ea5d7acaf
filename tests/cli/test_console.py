"""What is printed, and where nothing can be."""

from __future__ import annotations

import errno
import io
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import commands
from toolkit.cli.console import answer, print_error, progress, say
from toolkit.errors import ConfigError

FULL = Path("/dev/full")
CHECKOUT = Path(__file__).resolve().parents[2]
HOMED = ("inspect", "process", "verify", "audit", "fit", "report")


@pytest.mark.parametrize(
    "words", [["explain", "time"], ["explain", "time", "--json"], ["explain", "none", "--json"]]
)
def test_an_answer_that_finds_no_space_is_an_error_and_no_bug(words: list[str]) -> None:
    with FULL.open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-c", "from toolkit.cli.main import run; run()", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert ended.returncode == 2
    assert "Traceback" not in ended.stderr
    assert ended.stderr.startswith("error: ")
    assert (os.strerror(errno.ENOSPC) in ended.stderr) == ("none" not in words)


@pytest.mark.parametrize(
    ("hostile", "shown"),
    [
        ("good\x1b[2K\rbad", "good\\x1b[2K\\rbad"),  # wipes its line and writes another
        ("no\x9b31mred", "no\\x9b31mred"),  # the same by one character of eight bits
        ("a\u202eb", "a\\u202eb"),  # read from right to left
        ("line\n\tnext", "line\n\tnext"),
    ],
)
def test_text_of_others_steers_no_terminal(
    capsys: pytest.CaptureFixture[str], hostile: str, shown: str
) -> None:
    say(hostile)
    print_error(ConfigError("a value cannot be used", got=hostile), as_json=False)
    answer({}, hostile, as_json=False, quiet=False)
    printed = capsys.readouterr()
    assert printed.out == f"{shown}\n{shown}\n"
    assert shown.splitlines()[0] in printed.err
    assert "\x1b" not in printed.err


# Each kind of what the parser may find wrong, with what was typed there and what may stand there.
USAGE = {
    "calibrate": ("toolkit calibrate: SESSION", "nothing", "SESSION.toml"),
    "calibration approve x": ("toolkit calibration approve: --in-force-from", "nothing", "irst day"),
    "calibrat": ("toolkit", "calibrat", "calibrate, calibration"),
    "ledger prov": ("toolkit ledger", "prov", "check, prove, witness"),
    "ledger prove m15 more words": ("toolkit ledger prove", "more words", "INSTRUMENT"),
    "inspect --frob": ("toolkit inspect: --frob", "--frob", "--prove"),
    "process x --draft=yes": ("toolkit process: --draft", "yes", "the option alone"),
    "process x --known-at 2026-W14-5": ("toolkit process: --known-at", "2026-W14-5", "YYYY-MM-DD"),
    "process x --reader foo": ("toolkit process: --reader", "foo", "calamine or both"),
    "calibration budget x --digits 7": ("toolkit calibration budget: --digits", "7", "2"),
    "calibration budget x --digits=two": ("toolkit calibration budget: --digits", "two", "integer"),
    "person policy cook --role head --reason x": ("ACTION", "cook", "approve"),
}


@pytest.mark.parametrize("words", USAGE)
def test_what_is_wrong_with_the_words_has_the_parts_of_every_error(
    capsys: pytest.CaptureFixture[str], words: str
) -> None:
    from toolkit.cli.main import run

    where, got, expected = USAGE[words]
    with pytest.raises(SystemExit) as ended:
        run([*words.split(), "--json"])
    assert ended.value.code == 2
    error = json.loads(capsys.readouterr().out)["error"]
    assert error.keys() == {"rule", "what", "where", "got", "expected", "next_step"}
    assert all(error.values())
    assert (where in error["where"], error["rule"]) == (True, "usage")
    assert got in error["got"]
    assert expected in error["expected"]
    with pytest.raises(SystemExit):
        run(words.split())
    text = capsys.readouterr().err
    assert text.startswith("error: ")
    for label, part in (("where:", where), ("got:", got), ("expected:", expected), ("next:", "--help")):
        (line,) = [line for line in text.splitlines() if line.lstrip().startswith(label)]
        assert part in line


def test_an_option_without_its_value_is_named_with_its_command(capsys: pytest.CaptureFixture[str]) -> None:
    from toolkit.cli.main import run

    with pytest.raises(SystemExit):
        run(["calibration", "list", "--known-at"])
    text = capsys.readouterr().err
    assert "where:    toolkit calibration list: --known-at\n  got:      nothing" in text


FORGED = "a\nerror: forged\x1b[2J\r\u202e"


def _forged(printed: str) -> list[str]:
    """Return the lines in which the name of a file would speak for the program, or steer the terminal."""
    lines = printed.split("\n")
    return [line for line in lines if line.startswith("error: forged") or re.search("[\x1b\r\u202e]", line)]


def test_names_and_texts_of_files_write_no_line_of_their_own(tmp_path: Path, virtual_test: Path) -> None:
    folder = tmp_path / FORGED
    shutil.copytree(virtual_test, folder)
    (recording, *_) = sorted(folder.glob("*.xlsx"))
    recording.rename(folder / f"{FORGED}.xlsx")
    (folder / f"{FORGED}.csv").write_text(f'SA [deg],"{FORGED[:-2]} [N]",FY [N]\n1,2,3\n')
    document = tmp_path / f"{FORGED}.pdf"
    document.write_bytes(b"%PDF-1.7\nnothing of the sort\n")
    unknown = tmp_path / f"{FORGED}.json"
    unknown.write_text(json.dumps({"generator": "toolkit", "schema": 1, FORGED: FORGED}))
    both = (folder / f"{FORGED}.xlsx", folder / f"{FORGED}.csv")
    for words in (
        ("inspect", *both), ("inspect", both[1]), ("process", folder), ("process", folder, "--draft"),
        ("verify", document, unknown), ("audit", tmp_path), ("audit", tmp_path, "--reports", tmp_path),
        ("convert", both[1], tmp_path / f"{FORGED}.tdx"), ("fit", both[1]), ("template", "check", document),
        ("report", folder, "--template", document), ("calibrate", unknown), ("diagnose", unknown),
    ):  # fmt: skip
        code, said, told = commands.said(*words, *(("--home", CHECKOUT) if words[0] in HOMED else ()))
        assert code in (0, 1, 2), (words, told)
        assert said + told
        assert _forged(said) + _forged(told) == [], words


def test_a_bar_shows_any_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name in square brackets is no style of the bar's, and one with an escape steers nothing."""
    drawn = io.StringIO()
    drawn.isatty = lambda: True  # type: ignore[method-assign]
    monkeypatch.setattr("sys.stderr", drawn)
    monkeypatch.setenv("TERM", "xterm")
    with progress(2, "audit") as step:
        step("[/bold]\x1b]0;title\x07.xlsx")
    assert "\x1b]0;title" not in drawn.getvalue()
