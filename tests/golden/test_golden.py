"""What the code answers today is what was frozen; and the reader tells the smallest difference."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from typing import Any

import pytest

from tests.golden.arithmetic import fingerprint, read_fingerprint
from tests.golden.compare import differences
from tests.golden.entries import FROZEN, Entry, ask, entries, read_frozen
from tests.golden.proof import BATCH
from tests.golden.surface import read_proof
from tests.golden.workplace import Workplace, workplace


@pytest.fixture(scope="module")
def place() -> Iterator[Workplace]:
    with workplace() as found:
        yield found


@pytest.mark.parametrize("entry", entries(quick=True), ids=lambda entry: entry.name)
def test_the_answer_is_the_frozen_one(entry: Entry, place: Workplace) -> None:
    if read_fingerprint(FROZEN) != fingerprint():
        pytest.skip("the arithmetic is not that of the frozen files: python -m tests.golden check tells more")
    frozen = read_frozen(FROZEN, entry.area)
    found = differences(frozen[entry.name], ask(entry, place), entry.area)
    results = [row for row in found if row.kind == "result"]
    assert not results, "\n".join(map(str, results[:20]))


def test_every_entry_is_frozen_and_nothing_else() -> None:
    named = [entry.name for entry in entries()]
    areas = {entry.area for entry in entries()}
    assert sorted(named) == sorted(name for area in areas for name in read_frozen(FROZEN, area))


def test_the_frozen_files_are_small() -> None:
    assert sum(path.stat().st_size for path in FROZEN.iterdir()) <= 3_000_000


def _paths(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[tuple[Any, ...], Any]]:
    if isinstance(value, dict | list):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _paths(inner, (*path, key))
    else:
        yield path, value


def _changed(tree: Any, path: tuple[Any, ...], value: Any) -> Any:
    tree = copy.deepcopy(tree)
    inner = tree
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    return tree


def test_the_last_bit_of_every_frozen_number_is_told() -> None:
    frozen = read_frozen(FROZEN, "tires")["tires/global/brush"]
    numbers = [(path, value) for path, value in _paths(frozen) if isinstance(value, float)]
    assert len(numbers) > 50
    for path, value in numbers:
        today = _changed(frozen, path, math.nextafter(value, math.inf))
        (row,) = differences(frozen, today, "tires")
        assert row.path.endswith(str(path[-1]) if isinstance(path[-1], str) else "]")
        assert row.frozen == repr(value)


def test_a_diagnosis_may_move_by_less_than_a_billionth_of_a_standard_error() -> None:
    frozen = read_frozen(FROZEN, "diagnosis")["diagnosis/ode-drag"]
    (drag,) = frozen["answer"]["effects"][0]["parameters"]
    path = ("answer", "effects", 0, "parameters", 0, "value")
    standard_error = (drag["ci95"][1] - drag["ci95"][0]) / 3.92
    for share, told in ((1e-8, 1), (2e-9, 1), (1e-10, 0)):
        today = _changed(frozen, path, drag["value"] + share * standard_error)
        assert len(differences(frozen, today, "diagnosis")) == told


def test_a_curve_counts_by_its_largest_value() -> None:
    frozen = {"FY": [1000.0, 1.0, 1e-6, -1000.0]}
    for shift, count in ((1e-3, 1), (1e-5, 0)):
        today = {"FY": [1000.0, 1.0, 1e-6 + shift, -1000.0]}
        assert len(differences(frozen, today, "diagnosis")) == count
        assert len(differences(frozen, today, "reduction")) == 1


@pytest.mark.parametrize(
    ("frozen", "today", "kinds"),
    [
        ({"message": "off by 2.5 N"}, {"message": "2.5 N off"}, ["wording"]),
        ({"message": "off by 2.5 N"}, {"message": "off by 2.6 N"}, ["result"]),
        ({"text": "off by 2.5 N"}, {"text": "2.5 N off"}, ["result"]),
        ({"rule": "a"}, {"rule": "b"}, ["result"]),
        ({"n": 1}, {"n": 1.0}, ["result"]),
        ({"n": 0.0}, {"n": -0.0}, ["result"]),
        ({"n": True}, {"n": 1}, ["result"]),
        ({"n": None}, {}, ["result"]),
        ({}, {"n": None}, ["addition"]),
        ({"n": [1.0]}, {"n": [1.0, 2.0]}, ["result"]),
        ({"n": [1.0]}, {"n": [1.0]}, []),
    ],
)
def test_what_differs_and_how(frozen: Any, today: Any, kinds: list[str]) -> None:
    assert [row.kind for row in differences(frozen, today, "calibration")] == kinds


def test_the_fingerprint_is_of_the_arithmetic_alone() -> None:
    assert fingerprint() == fingerprint()
    assert set(fingerprint()) == {"numpy", "scipy", "sha256"}


@pytest.mark.parametrize("name", ["verdict", "names"])
def test_cases_of_the_proof_are_answered_as_when_they_were_opened(name: str) -> None:
    """The batch was answered by older code: numbers moved since, what was named did not.

    A class is one answer, whichever of its members stands at its head.
    """
    _, _, opened = read_proof(BATCH)
    for entry, answer in read_frozen(FROZEN, "proof").items():
        frozen, before = answer["answer"], opened[entry.split("/")[1]]
        if name == "verdict":
            assert (frozen["verdict"], frozen["remaining"]) == (before["verdict"], before["remaining"])
        else:
            assert [_named(row) for row in frozen["effects"]] == [_named(row) for row in before["effects"]]


def _named(effect: dict[str, Any]) -> tuple[frozenset[str], str | None]:
    return frozenset((effect["name"], *effect["equivalent_to"])), effect["channel"]
