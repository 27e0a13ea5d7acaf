"""The recipes of CONTRIBUTING.md do what they promise: each is followed in a copy of the checkout."""

from __future__ import annotations

import doctest
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.recipes import COPIED, ROOT, follow, new_files, recipes, write

PROMISED = ("effect", "tire model", "characteristic", "report table", "file format", "rule", "command")
SAME = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def test_there_is_a_recipe_for_each_kind_of_addition() -> None:
    assert tuple(title.partition(" ")[2].partition(" ")[2] for title in recipes()) == PROMISED


WALKED = ("Add a command",)
"""A file that is found by being there, and another one that names it: the ways that an addition goes."""
OTHER = pytest.mark.campaign("the way of a recipe that every run goes; its files are held in every run")


@pytest.mark.parametrize(
    "title", [pytest.param(title, marks=[OTHER] * (title not in WALKED)) for title in recipes()]
)
def test_a_recipe_does_what_it_promises(title: str, tmp_path: Path) -> None:
    printed = follow(title, tmp_path)
    assert printed, "a recipe shows by a command that it worked"
    for command, expected, got in printed:
        assert doctest.OutputChecker().check_output(expected, got, SAME), f"$ {command}\n{got}"


def test_the_files_of_every_recipe_have_their_place_and_are_clean(tmp_path: Path) -> None:
    """One copy has them all: its tests are collected, which imports each addition."""
    for name in COPIED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, tmp_path / name)
    blocks = [block for each in recipes().values() for block in each if block.language != "console"]
    for block in blocks:
        write(block, tmp_path)
    files = [path for each in new_files().values() for path in each]
    tests = [path for path in files if path.startswith("tests/")]
    for words in (["ruff", "check", "--no-cache", "--quiet", *files], ["pytest", "-q", *tests]):
        done = subprocess.run(
            [sys.executable, "-m", *words], cwd=tmp_path, capture_output=True, text=True, check=False,
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("title", recipes())
def test_an_addition_is_one_file_and_its_test(title: str) -> None:
    package = [path for path in new_files()[title] if path.startswith("toolkit/")]
    assert len(package) == 1
