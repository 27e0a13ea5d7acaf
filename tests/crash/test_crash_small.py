"""A fixed part of the crash bench: the commands that take no time, at a few of their calls."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.crash.bench import Bench, agrees, chosen, passing
from tests.crash.commands import QUICK, SIGNED, quick_folder, signed_folder
from tests.faults import Runner
from toolkit.files import sha256_bytes


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner() as started:
        yield started


@pytest.fixture(scope="module")
def bench(runner: Runner, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(quick_folder, tmp_path_factory.mktemp("crash"), runner)


PLAIN = pytest.mark.campaign(
    "a single file into a folder: commands that write several are killed in every run"
)


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, id=command.name, marks=[PLAIN] * (command.name == "template new"))
        for command in QUICK
    ],
)
def test_nothing_is_lost_or_mixed_and_the_next_run_gives_the_same(bench: Bench, command) -> None:
    # An error of the disk is answered as a full one is: the commands that sign have it.
    count = bench.judge(command, most=3, faults=("kill", "no space"))
    assert (count.lost, count.mixed) == ([], [])
    assert count.recovered == count.points >= 6


@pytest.fixture(scope="module")
def signed(runner: Runner, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(signed_folder, tmp_path_factory.mktemp("crash"), runner)


ALIKE = pytest.mark.campaign(
    "an entry in the list of persons, or in the ledger, is cut off by another command"
)
FURTHER = (
    "person enrol", "person revoke", "calibration withdraw (answered)", "calibration withdraw (requested)",
)  # fmt: skip


@pytest.mark.parametrize(
    "command",
    [pytest.param(command, id=command.name, marks=[ALIKE] * (command.name in FURTHER)) for command in SIGNED],
)
def test_between_signature_and_entry_neither_or_both_are_there(signed: Bench, command) -> None:
    count = signed.judge(command, most=2)
    assert (count.lost, count.mixed) == ([], [])
    assert count.recovered == count.points >= 6


def test_a_bench_that_could_not_see_a_fault_would_prove_nothing() -> None:
    calls = ["1 create a", "2 write a", "3 write a", "4 fsync a", "5 rename a", "6 rename b", "7 unlink c"]
    assert chosen(calls, 9) == [1, 2, 4, 5, 6, 7]
    assert chosen(calls, 2) == [1, 7]
    manifest = b'{"outputs": [{"name": "a", "sha256": "%s"}]}' % sha256_bytes(b"1").encode()
    assert agrees(manifest, Path("out"), {"out/a": b"1"})
    assert not agrees(manifest, Path("out"), {"out/a": b"2"})
    assert not agrees(manifest, Path("out"), {})
    assert [passing(name) for name in ("out/a", "out/.toolkit-results/a", "out/.a.x.part")] == [
        False,
        True,
        True,
    ]
