"""No effect is named outside its own file, and a new effect is one file.

What counts: a text of the code with an effect's name in it, and an import of an effect's module. A name that
is an English word too (``wear``) counts where it is the whole text, or stands as an effect is written
(``wear=``, ``wear.``, ``wear@``). Docstrings and comments may name one as an example.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import toolkit
from toolkit.effects.catalogue import effects

ROOT = Path(toolkit.__file__).parent
CATALOGUE = ROOT / "effects" / "catalogue"
# Words that mean something else in their place, or keys of a format: path -> (names, reason).
PULL = {"conicity", "plysteer"}
OTHER_MEANINGS = {
    "characteristics": (PULL, "characteristics of a tire that a test has as results"),
    "report": (PULL, "characteristics of a tire that a test has as results"),
    "calibration": ({"creep"}, "a statement on a cell in the file of a session, by the word of its standard"),
    "planning": (
        {"conicity", "creep"},
        "what a test is planned for, and what acts on the cells of a session",
    ),
    "lab/plans/plan_session.py": ({"creep"}, "as in the planning"),
    "lab/plans/protocol_plan.py": (PULL, "what a test is planned for"),
    "cli/plan.py": ({"conicity"}, "examples of what a test is planned for"),
    "simulation/plan_file.py": (
        PULL,
        "the tire's own pull, by the keys of [tire], and an example of --effect",
    ),
}


def docstrings(tree: ast.Module) -> set[int]:
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, kinds)]
    return {id(body[0].value) for body in bodies if body and isinstance(body[0], ast.Expr)}


def entry_keys(tree: ast.Module) -> set[int]:
    """Keys that an entry of a declared format has: words of that file."""
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return {
        id(word.value)
        for call in calls
        if isinstance(call.func, ast.Name) and call.func.id == "Entry"
        for word in call.keywords
        if word.arg == "key"
    }


NAMES = "|".join(name for name in effects() if "_" in name)
WORDS = "|".join(name for name in effects() if "_" not in name)
WRITTEN = re.compile(rf"\b({NAMES})\b|\A({WORDS})\Z|\b({WORDS})[.=@](?=\S)")
ANY = re.compile(rf"{NAMES}|{WORDS}")


@functools.cache
def named(path: Path) -> list[tuple[int, str]]:
    """Return the lines of a file that name an effect, with what they name."""
    text = path.read_text(encoding="utf-8")
    return list(_named(ast.parse(text))) if ANY.search(text) else []


def _named(tree: ast.Module) -> Iterator[tuple[int, str]]:
    skipped = docstrings(tree) | entry_keys(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
            for match in WRITTEN.finditer(node.value) if ANY.search(node.value) else ():
                yield node.lineno, str(match[match.lastindex or 0])
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("toolkit.effects.catalogue."):
            yield node.lineno, str(node.module).rsplit(".", 1)[1]


def allowed(path: Path) -> set[str]:
    place = path.relative_to(ROOT).as_posix()
    return {
        name
        for start, (names, _) in OTHER_MEANINGS.items()
        if place == start or place.startswith(f"{start}/")
        for name in names
    }


def test_no_effect_is_named_outside_its_own_file():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in sorted(ROOT.rglob("*.py"))
        for line, name in named(path)
        if name not in allowed(path) and path != CATALOGUE / f"{name}.py"
    ]
    assert found == []


@pytest.mark.parametrize("place", OTHER_MEANINGS)
def test_every_exception_is_still_needed(place):
    path = ROOT / place
    files = path.rglob("*.py") if path.is_dir() else [path]
    assert {name for file in files for _, name in named(file)} >= OTHER_MEANINGS[place][0]
