"""What a document may list as a finding is translated: walked through the code that words the findings."""

from __future__ import annotations

import ast
import dataclasses
import functools
from collections.abc import Iterator, Mapping
from itertools import product

import pytest

from tests.report.template_factory import FOLDER
from toolkit.diagnosis.answer import power
from toolkit.diagnosis.search.noise_floor import LARGE, LONG
from toolkit.diagnosis.search.unexplained import BEYOND_REPEATS, TOO_LARGE, Line
from toolkit.report.diagnosis.numbers import over
from toolkit.words.phrasebook import SOURCE, languages, phrasebook

PACKAGE = FOLDER.parent / "toolkit"
# The packages whose findings a table of a document lists: `finding_table`, and the report of a test.
LISTED = ("recording", "reduction", "characteristics", "comparison", "diagnosis", "planning")
HOLE = "7"


def wordings(node: ast.expr | None, named: Mapping[str, ast.expr]) -> list[str]:
    """Return every text that an expression may make, a hole for each value; none where it makes no text."""
    match node:
        case ast.Constant(value=str(text)):
            return [text]
        case ast.JoinedStr(values=parts):
            return joined([wordings(part, named) or [HOLE] for part in parts])
        case ast.FormattedValue(value=ast.IfExp() | ast.Name() as choice):
            return wordings(choice, named) or [HOLE]
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return joined([wordings(left, named) or [HOLE], wordings(right, named) or [HOLE]])
        case ast.IfExp(body=yes, orelse=no):
            return [*wordings(yes, named), *wordings(no, named)]
        case ast.Name(id=name) if name in named:
            return wordings(named[name], {key: value for key, value in named.items() if key != name})
    return []


def joined(parts: list[list[str]]) -> list[str]:
    return ["".join(texts) for texts in product(*parts)]


def messages() -> Iterator[tuple[str, str]]:
    """Yield (module and line, wording) of every finding whose sentence is spelt where it is made."""
    for package in LISTED:
        for path in sorted((PACKAGE / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if "Finding(" not in text:
                continue
            tree = ast.parse(text)
            for function in [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]:
                assigned: dict[str, list[ast.expr]] = {}
                for node in ast.walk(function):
                    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                        assigned.setdefault(node.targets[0].id, []).append(node.value)
                for node in ast.walk(function):
                    if not (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding"):
                        continue
                    message = next((word.value for word in node.keywords if word.arg == "message"), None)
                    # A name is what the assignment right before says.
                    named = {
                        name: max(
                            (v for v in values if v.lineno <= node.lineno),
                            key=lambda v: v.lineno,
                            default=values[0],
                        )
                        for name, values in assigned.items()
                    }
                    for wording in wordings(message, named):
                        yield f"{path.relative_to(PACKAGE)}:{node.lineno}", wording


@functools.cache
def spelt() -> tuple[tuple[str, str], ...]:
    """Return what `messages` yields: once, and not by those who only collect the tests."""
    return tuple(messages())


def test_most_sentences_are_found_where_they_are_spelt() -> None:
    assert len(spelt()) > 50
    assert {place.partition("/")[0] for place, _ in spelt()} == set(LISTED)


@pytest.mark.parametrize("language", [name for name in languages() if name != SOURCE])
def test_every_sentence_of_a_finding_has_a_translation(language: str) -> None:
    book = phrasebook(language)
    parts = [(place, text) for place, text in spelt() if set(text) - set(f"{HOLE}: ;,.")]
    assert [(place, text) for place, text in parts if not book.knows(text)] == []


@pytest.mark.parametrize("language", [name for name in languages() if name != SOURCE])
def test_why_an_effect_or_a_rest_is_told_as_it_is_has_a_translation(language: str) -> None:
    book = phrasebook(language)
    why = [text for name, text in vars(power).items() if name.isupper() and isinstance(text, str)]
    line = Line(frequency=24.0, p_value=0.0, share=0.5, width=0.01)
    left = [over("FY", [], reason) for reason in (LARGE, LONG, TOO_LARGE, BEYOND_REPEATS)]
    left += [
        over("FY", ["time"], reason)
        for reason in (line.reason, "an event in r0.csv from 1 to 2 s", "louder in r0.csv")
    ]
    left.append(over("FY", ["angle"], dataclasses.replace(line, angle="angle").reason))
    assert len(why) >= 12
    assert [text for text in (*why, *left) if not book.knows(text)] == []
