"""A small fixed part of the fuzz bench, and every input that ever failed, as its recipe."""

from __future__ import annotations

import json

import pytest

from tests.fuzz.bench import Outcome, drawn, minimal, outcome, target_of
from tests.fuzz.corpus import TARGETS
from tests.fuzz.mutations import MUTATE, Recipe, apply
from tests.fuzz.recipes import RECIPES

SEED, INPUTS = 20, 5
NAMES = [target.name for target in TARGETS]


@pytest.mark.parametrize("name", NAMES)
def test_a_whole_input_is_accepted(name: str) -> None:
    whole = outcome(target_of(name), [])
    assert (whole.code in (0, 1), whole.fault) == (True, ""), whole.text


@pytest.mark.parametrize("name", NAMES)
def test_mutated_inputs_are_read_or_refused(name: str) -> None:
    target = target_of(name)
    for number in range(INPUTS):
        recipe = drawn(target, SEED, number)
        result = outcome(target, recipe)
        assert result.fault == "", f"{json.dumps(minimal(target, recipe, result.fault))}\n{result.text}"


@pytest.mark.parametrize(("name", "recipe"), RECIPES)
def test_what_failed_once_fails_no_more(name: str, recipe: str) -> None:
    result = outcome(target_of(name), json.loads(recipe))
    assert result.fault == "", result.text


@pytest.mark.parametrize("name", NAMES)
def test_a_recipe_is_plain_text_and_makes_the_same_bytes(name: str) -> None:
    target = target_of(name)
    for number in range(20):
        recipe = drawn(target, SEED, number)
        assert json.loads(json.dumps(recipe)) == drawn(target, SEED, number)
        if "encode" not in str(recipe) and target.kind != "zip":  # the hours of a zip's members are today's
            assert apply(target.data(), recipe) == apply(target.data(), json.loads(json.dumps(recipe)))


def test_every_mutation_is_drawn() -> None:
    seen: set[str] = set()
    for name in ("session", "loads", "run.mat", "run.xlsx"):
        for number in range(300):
            for mutation in drawn(target_of(name), SEED, number):
                seen |= {mutation[0]} | ({mutation[2][0]} if mutation[0] == "part" else set())
    assert seen == MUTATE.keys()


def test_the_fewest_mutations_that_still_fail_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_target: object, recipe: Recipe) -> Outcome:
        return Outcome(code=101, fault="bad" if ["cut", 3] in recipe else "")

    monkeypatch.setattr("tests.fuzz.bench.outcome", fails)
    assert minimal(TARGETS[0], [["cut", 1], ["cut", 3], ["cut", 5]], "bad") == [["cut", 3]]
