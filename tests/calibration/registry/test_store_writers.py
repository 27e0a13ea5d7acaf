"""Two writers lose nothing, and a write that is killed at any point leaves the registry whole."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.registry import settled, store
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RegistryError

FORK = multiprocessing.get_context("fork")
POINTS = ["part", "fsync", "replace", "sync_folder", "unlink"]


def _enter(path: Path, folder: Path) -> None:
    calibrate(path, Registry(folder))


def _killed(path: Path, folder: Path, name: str, at: int) -> None:
    """Calibrate in a process that dies at the n-th call of one step of a write."""
    from toolkit import files

    owner, attribute = {
        "part": (files, "_new_part"),
        "fsync": (os, "fsync"),
        "replace": (Path, "replace"),
        "sync_folder": (files, "sync_folder"),
        "unlink": (Path, "unlink"),
    }[name]
    real, count = getattr(owner, attribute), [0]

    def step(*given: object, **named: object) -> object:
        count[0] += 1
        if count[0] == at:
            os._exit(9)
        return real(*given, **named)

    setattr(owner, attribute, step)
    calibrate(path, Registry(folder))
    os._exit(0)


def test_two_writers_at_once_lose_nothing(tmp_path: Path, make_session: Callable[..., Path]) -> None:
    folder = tmp_path / "cal"
    folder.mkdir()
    sessions = [make_session(hub_data(40, 10 + i), name=f"s{i}") for i in range(4)]
    calibrate(sessions[0], Registry(folder))
    writers = [FORK.Process(target=_enter, args=(path, folder)) for path in (*sessions[1:], sessions[1])]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0] * 4
    registry = Registry(folder)
    # The same session from two writers is one record.
    assert registry.ids("hub") == ("hub-r1", "hub-r2", "hub-r3", "hub-r4")
    assert all(row.ok for row in verify_registry(registry))


REACHED = pytest.mark.campaign(
    "steps that calls of the C library reach as well: test_store_faults.py kills before these in every run"
)


@pytest.mark.parametrize(
    "point",
    [point if point == "replace" else pytest.param(point, marks=REACHED) for point in POINTS],
)
def test_a_killed_write_happened_or_did_not(
    tmp_path: Path, make_session: Callable[..., Path], point: str
) -> None:
    first, second = make_session(hub_data(40, 20), name="a"), make_session(hub_data(40, 21), name="b")
    begun = tmp_path / "begun"
    begun.mkdir()
    calibrate(first, Registry(begun))
    for at in range(1, 40):
        folder = shutil.copytree(begun, tmp_path / f"cal-{at}")
        victim = FORK.Process(target=_killed, args=(second, folder, point, at))
        victim.start()
        victim.join()
        registry = Registry(folder)
        rows = verify_registry(registry)
        assert all(row.ok for row in rows), rows
        assert registry.ids("hub") in (("hub-r1",), ("hub-r1", "hub-r2"))
        made = calibrate(second, registry)
        assert made.record.id == "hub-r2"
        assert len(verify_registry(registry)) == 2
        # A reader removes nothing: the next writer does.
        store.commit(folder / "hub", lambda _ledger: None)
        assert not [p.name for p in (folder / "hub").iterdir() if p.name.startswith(".")]
        if victim.exitcode == 0:
            return
    raise AssertionError("the write never came to its end")


def test_nothing_is_written_onto_a_damaged_ledger(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    ledger = registry.folder / "hub" / "ledger.jsonl"
    ledger.write_bytes(ledger.read_bytes()[:-5])
    before = sorted((p.name, p.read_bytes()) for p in (registry.folder / "hub").iterdir())
    with pytest.raises(RegistryError) as caught:
        calibrate(make_session(hub_data(40, 30), name="more"), registry)
    assert caught.value.rule == "ledger"
    assert sorted((p.name, p.read_bytes()) for p in (registry.folder / "hub").iterdir()) == before


def test_a_journal_that_does_not_fit_its_ledger_is_told(registry: Registry) -> None:
    (registry.folder / "hub" / settled.JOURNAL).write_text("{}")
    assert not any(row.ok for row in verify_registry(registry))
    with pytest.raises(RegistryError):
        store.commit(registry.folder / "hub", lambda _ledger: None)


@pytest.mark.parametrize("name", ["HUB", "Hub"])
def test_a_name_that_differs_by_case_alone_is_refused(
    registry: Registry, make_session: Callable[..., Path], name: str
) -> None:
    session = make_session(hub_data(40, 30), name="more", instrument=f'"{name}"')
    with pytest.raises(RegistryError) as caught:
        calibrate(session, registry)
    assert (caught.value.rule, caught.value.got) == ("instrument-case", name)
    assert registry.instruments() == ("hub",)
    assert not (registry.folder / name).exists()
    # Two that are there already, from a time when nobody asked, are served.
    (registry.folder / name).mkdir()
    assert calibrate(session, registry).record.id == f"{name}-r1"


def test_a_write_that_is_refused_leaves_no_folder(tmp_path: Path) -> None:
    def refuse(_ledger: object) -> None:
        raise RegistryError("no", rule="time")

    with pytest.raises(RegistryError):
        store.commit(tmp_path / "cal" / "hub", refuse)
    assert not (tmp_path / "cal").exists()


@pytest.mark.parametrize(
    "changes",
    [
        {"files": ["hub-r1.json"]},
        {"files": ["../hub-r2.json"]},
        {"files": ["hub-r2/../hub-r1.json"]},
        {"files": ["head.json"]},
        {"before": "0" * 64},
        {"bytes": -1},
        {"line": "{}"},
        {"line": None},
    ],
)
def test_a_journal_of_another_hand_hides_and_removes_nothing(
    registry: Registry, make_session: Callable[..., Path], monkeypatch: pytest.MonkeyPatch, changes: Any
) -> None:
    folder = registry.folder / "hub"
    with monkeypatch.context() as patch:
        # A write that is cut off before it is decided.
        patch.setattr(Path, "replace", _stopping(Path.replace, settled.JOURNAL + ".part"))
        patch.setattr(store, "_tried_to_undo", lambda _folder: False)
        with pytest.raises(KeyboardInterrupt):
            calibrate(make_session(hub_data(40, 30), name="more"), registry)
    assert registry.ids("hub") == ("hub-r1",)
    journal = json.loads((folder / settled.JOURNAL).read_text())
    (folder / settled.JOURNAL).write_text(json.dumps({**journal, **changes}))
    before = sorted((path.name, path.read_bytes()) for path in folder.iterdir())
    assert not any(row.ok for row in verify_registry(registry))
    with pytest.raises(RegistryError) as caught:
        store.commit(folder, lambda _ledger: None)
    assert caught.value.rule == "ledger"
    assert sorted((path.name, path.read_bytes()) for path in folder.iterdir()) == before


def _stopping(real: Callable[..., Path], name: str) -> Callable[..., Path]:
    def replace(path: Path, target: Path) -> Path:
        if target.name == name:
            raise KeyboardInterrupt
        return real(path, target)

    return replace
