"""What is printed, and where nothing can be."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

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
