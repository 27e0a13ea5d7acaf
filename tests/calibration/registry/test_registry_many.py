"""What is asked of many records reads the ledger once, and no record that it does not ask for."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.registry.test_candidate_legacy import GOOD
from toolkit.audit.inspection import choose
from toolkit.calibration.registry import candidate, settled
from toolkit.calibration.registry.candidate import calibrate, import_legacy
from toolkit.calibration.registry.ledger import Ledger
from toolkit.calibration.registry.registry import Registry, load_checked
from toolkit.errors import RegistryError
from toolkit.lab.records.registry_answer import listed


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """The folders whose ledgers were read."""
    folders: list[Path] = []
    real = settled.read

    def counted(folder: Path) -> object:
        folders.append(folder)
        return real(folder)

    monkeypatch.setattr(settled, "read", counted)
    return folders


@pytest.mark.parametrize(
    "ask",
    [
        lambda registry: listed(registry, None, known_at=None, everything=True),
        lambda registry: choose(registry, "hub", on=dt.date(2026, 2, 1)),
    ],
    ids=["list", "inspect"],
)
def test_the_ledger_is_not_read_for_each_record(
    registry: Registry,
    make_session: Callable[..., Path],
    reads: list[Path],
    ask: Callable[[Registry], object],
) -> None:
    ask(registry)
    alone = len(reads)
    for seed in (11, 12, 13):
        calibrate(make_session(hub_data(40, seed), name=f"s{seed}"), registry)
    reads.clear()
    ask(registry)
    assert len(reads) == alone


def test_an_import_loads_no_record_of_other_inputs(
    registry: Registry, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "legacy.toml"
    source.write_text(GOOD.replace('"old"', '"hub"'))
    loaded: list[str] = []

    def counted(folder: Path, record_id: str, ledger: Ledger) -> object:
        loaded.append(record_id)
        return load_checked(folder, record_id, ledger)

    monkeypatch.setattr(candidate, "load_checked", counted)
    assert import_legacy(source, registry)[0].id == "hub-r2"
    assert loaded == []
    assert import_legacy(source, registry)[1]
    assert loaded == ["hub-r2"]


def test_a_bad_record_leaves_the_others_usable(registry: Registry, make_session: Callable[..., Path]) -> None:
    for seed in (11, 12):
        calibrate(make_session(hub_data(40, seed), name=f"s{seed}"), registry)
    (registry.folder / "hub" / "hub-r2.loads.csv").write_text("")
    good, bad = registry.usable("hub")
    assert [record.id for record in good] == ["hub-r1", "hub-r3"]
    assert [(refused.id, refused.rule) for refused in bad] == [("hub-r2", "data")]


@pytest.mark.parametrize(
    "name", ["../calibrations/hub", "/dev/null", "/", "..", "", "hub*", "h[u]b", "hub/", "x" * 300, "\0"]
)
def test_a_name_that_is_no_folder_of_the_registry_has_no_records(
    name: str, registry: Registry, make_session: Callable[..., Path]
) -> None:
    """Names come from command lines, test.toml and machine definitions: none is a way out, or a pattern."""
    calibrate(make_session(hub_data(40, 11), name="s11"), registry)
    assert not registry.ledger(name).entries
    assert registry.ledger("hub").entries
    assert registry.digest(name) == registry.digest("another")
    if name:
        with pytest.raises(RegistryError, match="no such instrument"):
            listed(registry, name, known_at=None, everything=True)
