"""Each call that changes the registry fails in turn: what is answered is what every reader then sees."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.registry.test_candidate_legacy import GOOD
from tests.crash.bench import chosen
from tests.faults import KILL, Outcome, Runner
from toolkit.calibration.registry.approval import approve
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.clock import today
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry

UNCONFIRMED = "the disk does not confirm"


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    with Runner() as started:
        yield started


@pytest.fixture
def commands(
    tmp_path: Path, registry: Registry, make_session: Callable[..., Path]
) -> dict[str, list[object]]:
    """Write to a registry with an approved hub-r1 and a candidate hub-r2, or to an empty one."""
    calibrate(make_session(hub_data(40, 5), name="second", date="2026-02-05"), registry)
    assert approve(registry, "hub-r1", in_force_from=date(2026, 2, 1), checked_by="B").done
    legacy = tmp_path / "legacy.toml"
    legacy.write_text(GOOD.replace('"old"', '"hub"'))
    fresh = make_session(hub_data(40, 6), name="third", date="2026-03-05")
    decision = ["--reason", "overloaded", "--by", "C"]
    return {
        "approve": ["calibration", "approve", "hub-r2", "--in-force-from", "2026-02-06", "--checked-by", "B"],
        "withdraw": ["calibration", "withdraw", "hub-r1", "--on", today().isoformat(), *decision],
        "discard": ["calibration", "discard", "hub-r2", *decision],
        "import": ["calibration", "import", legacy],
        "calibrate": ["calibrate", fresh],
        "first": ["calibrate", fresh],
    }


class Bench:
    """A command and the registry that it writes to, copied anew for each fault."""

    def __init__(self, runner: Runner, words: list[object], source: Path, place: Path) -> None:
        self.runner, self.words, self.source, self.place = runner, words, source, place
        self.folder = place / "calibrations"
        self.fresh()
        self.before = self.seen()

    def fresh(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.copytree(self.source, self.folder)

    def run(self, **fault: Any) -> Outcome:
        words = [*self.words, "--calibrations", self.folder, "--json"]
        return self.runner.run(words, root=self.folder, **fault)

    def seen(self) -> tuple[object, ...]:
        """Return what a reader sees, all of it sound."""
        registry = Registry(self.folder)
        rows = verify_registry(registry)
        assert all(row.ok for row in rows), rows
        return rows, [(name, registry.head(name), registry.digest(name)) for name in registry.instruments()]

    def check(self, outcome: Outcome) -> str:
        """Hold a command's end against what is seen; return which of the two states it is."""
        after = self.seen()
        changed = after != self.before
        if outcome.code == 2:
            error = outcome.answer["error"]
            assert (error["rule"], all(error.values())) == ("not-writable", True)
            assert ("nothing was changed" in error["next_step"]) == (not changed), error
            assert changed == (UNCONFIRMED in error["what"])
        elif outcome.code >= 0:
            assert (outcome.code in (0, 1), changed) == (True, True), outcome
        if not changed and list(self.folder.rglob(".*")):
            # With room again, the next writer goes on from there, and leaves nothing of the attempt behind.
            assert self.run().code in (0, 1)
            assert self.seen() != self.before
            assert not list(self.folder.rglob(".*"))
        return "after" if changed else "before"


FAULTS = {
    "full": (errno.ENOSPC, True),
    "eio": (errno.EIO, False),
    "broken": (errno.EIO, True),
    "kill": (KILL, False),
}


LASTS = pytest.mark.campaign(
    "another error of the disk, or one that lasts: that of a full disk does in every run"
)
SAME_WAY = pytest.mark.campaign("decisions and entries that are written in the same way as the others")
EACH_CALL = pytest.mark.campaign(
    "a decision or an entry at each of its calls: where another kind begins holds in every run"
)


@pytest.mark.parametrize(
    ("name", "fault", "most"),
    [
        # The places where another kind of call begins: a call that follows one of its kind is as far.
        *(("approve", fault, 4) for fault in ("full", "kill")),
        pytest.param("approve", "eio", 4, marks=LASTS),
        *(pytest.param("approve", fault, None, marks=EACH_CALL) for fault in ("full", "eio", "kill")),
        pytest.param("approve", "broken", None, marks=LASTS),
        ("first", "kill", 4),
        ("calibrate", "eio", 4),
        pytest.param("first", "kill", None, marks=EACH_CALL),
        pytest.param("calibrate", "eio", None, marks=EACH_CALL),
        *(
            pytest.param(name, "eio", None, marks=SAME_WAY)
            for name in ("first", "withdraw", "discard", "import")
        ),
    ],
)
def test_the_answer_is_what_every_reader_sees(
    runner: Runner,
    registry: Registry,
    commands: dict[str, list[object]],
    tmp_path: Path,
    name: str,
    fault: str,
    most: int | None,
) -> None:
    source, (number, lasting) = registry.folder, FAULTS[fault]
    if name == "first":
        source = tmp_path / "empty"
        source.mkdir()
    bench = Bench(runner, commands[name], source, tmp_path / "bench")
    points = bench.run()
    assert points.code in (0, 1)
    assert bench.check(points) == "after"
    count = len(points.calls)
    states = {}
    for at in range(1, count + 1) if most is None else chosen(points.calls, most):
        bench.fresh()
        outcome = bench.run(at=at, fault=number, lasting=lasting)
        states[at] = bench.check(outcome)
    # It is decided once, and late: what fails before that was never made.
    assert [*states.values()] == sorted(states.values(), reverse=True)
    assert {state for at, state in states.items() if at <= count - 3} == {"before"}


def test_readers_write_nothing_beside_a_journal(
    runner: Runner, registry: Registry, commands: dict[str, list[object]], tmp_path: Path
) -> None:
    bench = Bench(runner, commands["calibrate"], registry.folder, tmp_path / "bench")
    calls = bench.run().calls
    bench.fresh()
    (last,) = [at for at, call in enumerate(calls, start=1) if "rename hub/.pending.json.part" in call]
    # Everything is in its place but for what decides.
    assert bench.run(at=last, fault=KILL).code < 0
    assert (bench.folder / "hub" / "hub-r3.json").exists()
    before = sorted((path.name, path.read_bytes()) for path in (bench.folder / "hub").iterdir())
    where = ["--calibrations", bench.folder, "--json"]
    answers = {}
    for words in (("list", "--all"), ("show", "hub-r1"), ("verify",), ("history", "hub"), ("show", "hub-r3")):
        outcome = runner.run(["calibration", *words, *where], root=bench.folder, at=1, fault=errno.EROFS)
        assert outcome.calls == ()
        answers[" ".join(words)] = outcome
    assert [outcome.code for outcome in answers.values()] == [0, 0, 0, 0, 2]
    assert [row["id"] for row in answers["list --all"].answer["records"]] == ["hub-r1", "hub-r2"]
    assert before == sorted((path.name, path.read_bytes()) for path in (bench.folder / "hub").iterdir())
