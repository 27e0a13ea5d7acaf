"""The recipes of CONTRIBUTING.md: which files they write, which they change, what their commands print."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.house.source import ROOT

PAGE = ROOT / "CONTRIBUTING.md"
COPIED = ("toolkit", "tests", "docs", "calibrations", "report_templates", "pyproject.toml", "CONTRIBUTING.md",
          "README.md", "Makefile")  # fmt: skip
_FENCE = re.compile(
    r"(?P<above>[^\n]*)\n\n```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
_NEW = re.compile(r"new file, `([^`]+)`:$")
_END = re.compile(r"At the end of `([^`]+)`:$")
_BELOW = re.compile(r"In `([^`]+)`, below the line `([^`]+)`:$")


@dataclass(frozen=True)
class Block:
    """A fenced block: the line above it, its language and its text."""

    above: str
    language: str
    text: str


def recipes() -> dict[str, tuple[Block, ...]]:
    """Return the blocks of every recipe by its title."""
    sections = PAGE.read_text(encoding="utf-8").partition("\n# Recipes\n")[2].split("\n## ")[1:]
    return {section.partition("\n")[0]: blocks_of(section) for section in sections}


def blocks_of(text: str) -> tuple[Block, ...]:
    """Return the fenced blocks of a page or a section."""
    return tuple(Block(match["above"], match["language"], match["text"]) for match in _FENCE.finditer(text))


def file_named(block: Block) -> str | None:
    """Return the path of the new file that a block holds, None where it holds none."""
    path = _NEW.search(block.above)
    return path[1] if path else None


def new_files() -> dict[str, dict[str, str]]:
    """Return the files that each recipe writes: recipe, path, text."""
    return {
        title: {path: block.text for block in blocks if (path := file_named(block))}
        for title, blocks in recipes().items()
    }


def file_of(title: str) -> str:
    """Return the text of the first file that a recipe writes, the addition itself."""
    return next(iter(new_files()[title].values()))


def follow(title: str, folder: Path) -> list[tuple[str, str, str]]:
    """Do a recipe in a copy of the checkout; return each command with what it should and did print."""
    for name in COPIED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, folder / name)
    printed = []
    for block in recipes()[title]:
        if block.language == "console":
            printed += [
                (command, expected, _print_of(command, folder)) for command, expected in commands_of(block)
            ]
        else:
            write(block, folder)
    return printed


def write(block: Block, folder: Path) -> Path:
    """Write what a block says into its place below a copy of the checkout; return the file."""
    if path := _NEW.search(block.above):
        assert not (folder / path[1]).exists(), f"{path[1]} is no new file"
        (folder / path[1]).write_text(block.text, encoding="utf-8")
    elif path := _END.search(block.above):
        with (folder / path[1]).open("a", encoding="utf-8") as stream:
            stream.write(block.text)
    else:
        path = _BELOW.search(block.above)
        assert path, f"where does this block go? {block.above}"
        lines = (folder / path[1]).read_text(encoding="utf-8").splitlines(keepends=True)
        place = [line.strip() for line in lines].index(path[2])
        lines.insert(place + 1, block.text)
        (folder / path[1]).write_text("".join(lines), encoding="utf-8")
    return folder / path[1]


def commands_of(block: Block) -> list[tuple[str, str]]:
    """Return each command of a block with what it should print."""
    parts = re.split(r"(?m)^\$ ", block.text)[1:]
    return [(part.partition("\n")[0], part.partition("\n")[2]) for part in parts]


def _print_of(command: str, folder: Path) -> str:
    program, *words = shlex.split(command)
    start = {
        "toolkit": ["-c", "from toolkit.cli.main import run; run()"],
        "python": [],
        "make": ["-m", f"tests.house.{words[0]}"],
    }[program]
    completed = subprocess.run(
        [sys.executable, *start, *(() if program == "make" else words)],
        cwd=folder, capture_output=True, text=True, check=False, env=_environment(folder),
    )  # fmt: skip
    # 1 is a finding: the virtual test's own FY and MZ are wrong on purpose.
    assert completed.returncode in (0, 1), completed.stdout + completed.stderr
    return completed.stdout


def _environment(folder: Path) -> dict[str, str]:
    import os

    return {**os.environ, "PYTHONPATH": str(folder), "COLUMNS": "110", "CI": "1"}
