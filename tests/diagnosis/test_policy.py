"""The policy of the verdict: each number once, with its unit and its reason, and none beside it."""

from __future__ import annotations

import ast
import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import toolkit.diagnosis as diagnosis
from toolkit.diagnosis import policy


@dataclass(frozen=True, slots=True, kw_only=True)
class Threshold:
    """One number of the policy."""

    section: str
    name: str
    value: float | tuple[int, ...]
    unit: str
    why: str


def thresholds() -> tuple[Threshold, ...]:
    """Return every number of the policy, section by section."""
    return tuple(
        Threshold(
            section=type(section).__name__.removeprefix("_").lower(),
            name=field.name,
            value=getattr(section, field.name),
            unit=field.metadata["unit"],
            why=field.metadata["why"],
        )
        for section in policy.SECTIONS
        for field in dataclasses.fields(section)
    )


ROOM = Path(diagnosis.__file__).parent
JUDGING = sorted([*(ROOM / "search").glob("*.py"), *(ROOM / "answer").glob("*.py")])
GUARD = 1e-8  # smaller numbers only keep a division or a logarithm from zero
COUNTED = (0, 1, 2, 3)  # none, one, several: of what a rule is about, not how much


@pytest.mark.parametrize("number", thresholds(), ids=lambda one: f"{one.section}.{one.name}")
def test_every_number_has_a_unit_and_a_reason(number: Threshold) -> None:
    assert np.all(np.asarray(number.value) > 0)
    assert number.unit
    assert len(number.why.split()) >= 3


def test_every_number_is_used() -> None:
    text = "".join(
        path.read_text(encoding="utf-8") for path in ROOM.rglob("*.py") if path.name != "policy.py"
    )
    idle = [
        f"{one.section}.{one.name}" for one in thresholds() if f"{one.section.upper()}.{one.name}" not in text
    ]
    assert not idle


def test_the_search_as_a_whole_keeps_its_false_names() -> None:
    # The bar of the proof: at most two in a hundred of clean cases, over every step that a search may take.
    assert 1 - (1 - policy.SCREENING.alpha) ** policy.STEP.most_effects < 0.02
    assert policy.STRUCTURE.alpha < policy.SCREENING.alpha
    assert policy.SCREENING.draws * policy.SCREENING.alpha >= 10


def test_further_off_than_far_a_parameter_may_still_go_before_its_bound() -> None:
    assert policy.PRIORS.far < policy.PRIORS.within
    assert math.erfc(policy.PRIORS.far / math.sqrt(2)) == pytest.approx(1 / 370, rel=0.01)


@pytest.mark.parametrize("path", JUDGING, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_search_and_answer_have_no_threshold_of_their_own(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    own = [
        ast.unparse(node)
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        and node.value is not None
        and list(_numbers(node.value, below=(ast.Tuple, ast.List, ast.UnaryOp, ast.BinOp)))
    ]
    compared = [
        ast.unparse(node)
        for node in ast.walk(tree)
        if isinstance(node, ast.Compare)
        and any(
            abs(number) > GUARD and number not in COUNTED
            for side in (node.left, *node.comparators)
            for number in _numbers(side, below=(ast.BinOp, ast.UnaryOp, ast.Tuple))
        )
    ]
    assert (own, compared) == ([], [])


def _numbers(node: ast.expr, *, below: tuple[type[ast.expr], ...]) -> Iterator[float]:
    """Give the numbers that an expression has in itself, looking into these kinds of expressions only."""
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield node.value
    elif isinstance(node, below):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                yield from _numbers(child, below=below)
