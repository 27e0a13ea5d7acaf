"""The recipes of CONTRIBUTING.md do what they promise: each is followed in a copy of the checkout."""

from __future__ import annotations

import doctest
import subprocess
import sys
from pathlib import Path

import pytest

from tests.recipes import follow, new_files, recipes

PROMISED = ("effect", "tire model", "characteristic", "report table", "file format", "rule", "command")
SAME = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def test_there_is_a_recipe_for_each_kind_of_addition() -> None:
    assert tuple(title.partition(" ")[2].partition(" ")[2] for title in recipes()) == PROMISED


@pytest.mark.parametrize("title", recipes())
def test_a_recipe_does_what_it_promises(title: str, tmp_path: Path) -> None:
    printed = follow(title, tmp_path)
    assert printed, "a recipe shows by a command that it worked"
    for command, expected, got in printed:
        assert doctest.OutputChecker().check_output(expected, got, SAME), f"$ {command}\n{got}"
    lint = [sys.executable, "-m", "ruff", "check", "--no-cache", "--quiet", *new_files()[title]]
    linted = subprocess.run(lint, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert linted.returncode == 0, linted.stdout + linted.stderr


@pytest.mark.parametrize("title", recipes())
def test_an_addition_is_one_file_and_its_test(title: str) -> None:
    package = [path for path in new_files()[title] if path.startswith("toolkit/")]
    assert len(package) == 1
