"""Killed, full, read-only, or one byte changed: the registry is whole, or `verify` says what is not."""

from __future__ import annotations

import multiprocessing
import os
import shutil
from collections.abc import Callable
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.registry.test_candidate_legacy import GOOD
from toolkit import files
from toolkit.calibration.registry import store
from toolkit.calibration.registry import verify as module
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate, import_legacy
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import OutputError, RegistryError

FORK = multiprocessing.get_context("fork")
POINTS = {
    "part": (files, "_new_part"),
    "write": (Path, "write_bytes"),
    "fsync": (os, "fsync"),
    "replace": (Path, "replace"),
    "sync_folder": (files, "sync_folder"),
    "unlink": (Path, "unlink"),
}
DAY = date(2026, 2, 1)
Step = Callable[[Registry], object]


def steps(source: Path) -> dict[str, Step]:
    """Return what writes to a registry that holds hub-r1, each with its own event in the ledger."""
    return {
        "import": lambda registry: import_legacy(source, registry),
        "approve": lambda registry: approve(registry, "hub-r1", in_force_from=DAY, checked_by="B"),
        "withdraw": lambda registry: withdraw(registry, "hub-r1", on=DAY, reason="overloaded", by="B"),
    }


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A legacy file of the hub, for a folder that has a record."""
    path = tmp_path / "legacy.toml"
    path.write_text(GOOD.replace('"old"', '"hub"'))
    return path


def dying(step: Step, folder: Path, point: str, at: int) -> None:
    owner, attribute = POINTS[point]
    real, count = getattr(owner, attribute), [0]

    def counted(*given: object, **named: object) -> object:
        count[0] += 1
        if count[0] == at:
            os._exit(9)
        return real(*given, **named)

    setattr(owner, attribute, counted)
    step(Registry(folder))
    os._exit(0)


ALIKE = pytest.mark.campaign(
    "an entry that is written as an approval is, which is killed at each kind of call"
)


@pytest.mark.parametrize(
    ("name", "point"),
    [
        pytest.param(
            name, point, marks=[ALIKE] * (point != "replace" and (name, point) != ("approve", "write"))
        )
        for name in ("import", "approve", "withdraw")
        for point in sorted(POINTS)
    ],
)
def test_a_killed_decision_was_made_or_was_not(
    registry: Registry, source: Path, tmp_path: Path, name: str, point: str
) -> None:
    step = steps(source)[name]
    for at in range(1, 30):
        folder = tmp_path / f"cal-{at}"
        shutil.copytree(registry.folder, folder)
        before = len(Registry(folder).ledger("hub").entries)
        victim = FORK.Process(target=dying, args=(step, folder, point, at))
        victim.start()
        victim.join()
        again = Registry(folder)
        rows = verify_registry(again)
        assert all(row.ok for row in rows), rows
        made = len(again.ledger("hub").entries) - before
        assert made in (0, 1)
        if not made:
            step(again)
        assert len(again.ledger("hub").entries) == before + 1
        assert all(row.ok for row in verify_registry(again))
        # A reader removes nothing: the next writer does.
        store.commit(folder / "hub", lambda _ledger: None)
        assert not [path.name for path in (folder / "hub").iterdir() if path.name.startswith(".")]
        if victim.exitcode == 0:
            return
    raise AssertionError("the write never came to its end")


def test_a_folder_that_went_away_writes_nothing(registry: Registry, source: Path) -> None:
    shutil.rmtree(registry.folder)
    for name in ("approve", "withdraw"):
        with pytest.raises(Exception, match=r"no such record|has no record") as caught:
            steps(source)[name](registry)
        assert getattr(caught.value, "exit_code", None) == 2
    assert not registry.folder.exists()


def test_a_folder_that_goes_away_between_reading_and_writing(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = registry.load("hub-r1")
    check = (registry.folder / "hub" / "hub-r1.check.csv").read_bytes()
    shutil.rmtree(registry.folder / "hub")
    (registry.folder / "hub").mkdir()
    (registry.folder / "hub" / "hub-r1.check.csv").write_bytes(check)
    monkeypatch.setattr(registry, "load", lambda _id: record)
    with pytest.raises(RegistryError) as caught:
        approve(registry, "hub-r1", in_force_from=DAY, checked_by="B")
    assert (caught.value.rule, caught.value.exit_code) == ("missing", 2)
    assert not (registry.folder / "hub" / "ledger.jsonl").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes to a folder without write permission")
def test_a_read_only_folder_is_told(registry: Registry, source: Path) -> None:
    folder = registry.folder / "hub"
    folder.chmod(0o555)
    try:
        for step in steps(source).values():
            with pytest.raises(OutputError):
                step(registry)
        assert all(row.ok for row in verify_registry(registry))
    finally:
        folder.chmod(0o755)


def test_a_file_where_the_instruments_folder_should_be(tmp_path: Path, source: Path) -> None:
    (tmp_path / "cal").mkdir()
    (tmp_path / "cal" / "hub").write_text("")
    with pytest.raises(OutputError) as caught:
        import_legacy(source, Registry(tmp_path / "cal"))
    assert all(caught.value.as_dict().values())


def deciding(folder: Path, step: Step) -> None:
    step(Registry(folder))


def test_deciders_and_writers_at_once_lose_nothing(
    registry: Registry, source: Path, make_session: Callable[..., Path]
) -> None:
    for seed in (11, 12):
        calibrate(make_session(hub_data(40, seed), name=f"s{seed}"), registry)
    fresh = make_session(hub_data(40, 13), name="fresh")
    work: list[Step] = [
        lambda r: approve(r, "hub-r1", in_force_from=date(2026, 2, 1), checked_by="B"),
        lambda r: approve(r, "hub-r2", in_force_from=date(2026, 3, 1), checked_by="C"),
        lambda r: withdraw(r, "hub-r3", on=DAY, reason="overloaded", by="B"),
        lambda r: import_legacy(source, r),
        lambda r: calibrate(fresh, r),
    ]
    before = len(registry.ledger("hub").entries)
    writers = [FORK.Process(target=deciding, args=(registry.folder, step)) for step in work]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0] * len(work)
    assert len(registry.ledger("hub").entries) == before + len(work)
    states = [registry.status(f"hub-r{number}").state for number in (1, 2, 3)]
    assert states == ["approved", "approved", "withdrawn"]
    assert len(registry.ids("hub")) == 5
    assert all(row.ok for row in verify_registry(registry))


def test_of_two_who_approve_one_record_one_is_told(registry: Registry) -> None:
    step: Step = lambda r: approve(r, "hub-r1", in_force_from=DAY, checked_by="B")  # noqa: E731
    writers = [FORK.Process(target=refused_quietly, args=(registry.folder, step)) for _ in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert sorted(writer.exitcode or 0 for writer in writers) == [0, 2, 2, 2]
    assert [e.event for e in registry.ledger("hub").entries] == ["entered", "approved"]


def refused_quietly(folder: Path, step: Step) -> None:
    try:
        step(Registry(folder))
    except RegistryError as error:
        os._exit(error.exit_code)
    os._exit(0)


NAMES = (
    "hub-r1.json", "hub-r1.loads.csv", "hub-r1.check.csv", "hub-r1.session.toml",
    "hub-r2.json", "hub-r2.source.toml", "ledger.jsonl", "head.json",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_any_byte_of_any_file_is_found_and_named(registry: Registry, source: Path, name: str) -> None:
    import_legacy(source, registry)
    path = registry.folder / "hub" / name
    whole = path.read_bytes()
    rng = np.random.default_rng(NAMES.index(name))
    for at in rng.choice(len(whole), min(40, len(whole)), replace=False).tolist():
        other = (whole[at] + int(rng.integers(1, 256))) % 256
        path.write_bytes(whole[:at] + bytes([other]) + whole[at + 1 :])
        rows = {row.id: row for row in verify_registry(registry)}
        if name in ("ledger.jsonl", "head.json"):
            assert not any(row.ok for row in rows.values()), (at, other)
            assert all(
                "ledger" in (row.reason or "") or "head" in (row.reason or "") for row in rows.values()
            )
        else:
            record = name.split(".", maxsplit=1)[0]
            assert [row.id for row in rows.values() if not row.ok] == [record], (at, other)
            assert name.endswith(".json") or name in (rows[record].reason or "")
    path.write_bytes(whole)
    assert all(row.ok for row in verify_registry(registry))


@pytest.mark.parametrize("cut", ["drop", "double", "truncate", "empty"])
@pytest.mark.parametrize("name", NAMES)
def test_a_file_that_lost_or_gained_bytes(registry: Registry, source: Path, name: str, cut: str) -> None:
    import_legacy(source, registry)
    path = registry.folder / "hub" / name
    whole = path.read_bytes()
    path.write_bytes(
        {"drop": whole[1:], "double": whole + whole[-1:], "truncate": whole[: len(whole) // 2], "empty": b""}[
            cut
        ]
    )
    assert not all(row.ok for row in verify_registry(registry))


def test_many_records_are_judged_in_processes_as_one_by_one(
    registry: Registry, source: Path, make_session: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in (11, 12):
        calibrate(make_session(hub_data(40, seed), name=f"s{seed}"), registry)
    import_legacy(source, registry)
    (registry.folder / "hub" / "hub-r2.loads.csv").write_text("")
    (registry.folder / "hub" / "stray.txt").write_text("")
    (registry.folder / "hub" / "below").mkdir()
    (registry.folder / "hub" / "below" / "stray.txt").write_text("")
    alone = verify_registry(registry)
    assert [(row.id, row.ok) for row in alone] == [
        ("hub-r1", True), ("hub-r2", False), ("hub-r3", True), ("hub-r4", True),
        ("below/stray.txt", False), ("stray.txt", False),
    ]  # fmt: skip
    monkeypatch.setattr(module, "_SHARED_FROM", 1)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _pid: {0, 1})
    assert verify_registry(registry) == alone
