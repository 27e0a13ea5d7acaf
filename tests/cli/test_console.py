"""What is printed, and where nothing can be."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from toolkit.cli.console import answer, print_error, say
from toolkit.errors import ConfigError

FULL = Path("/dev/full")


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
