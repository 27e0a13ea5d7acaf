"""A pipe or an endless device in a registry's folder is told by `verify`; nobody waits for its end."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RegistryError


def pipe(path: Path) -> None:
    os.mkfifo(path)


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("make", [pipe, endless])
@pytest.mark.parametrize(
    ("name", "rule"), [("hub-r1.json", "missing"), ("hub-r1.loads.csv", "data"), ("ledger.jsonl", "ledger")]
)
def test_what_is_no_file_is_told(
    registry: Registry, name: str, rule: str, make: Callable[[Path], None]
) -> None:
    path = registry.folder / "hub" / name
    path.unlink()
    make(path)
    row = next(row for row in verify_registry(registry) if row.id == "hub-r1")
    assert not row.ok
    assert (row.reason or "").startswith(f"{rule}:")
    assert "not a regular file" in (row.reason or "")


def test_nothing_is_entered_beside_a_ledger_that_is_none(
    registry: Registry, make_session: Callable[..., Path]
) -> None:
    ledger = registry.folder / "hub" / "ledger.jsonl"
    ledger.unlink()
    pipe(ledger)
    with pytest.raises(RegistryError) as caught:
        calibrate(make_session(name="other", operator='"C"'), registry)
    assert caught.value.rule == "ledger"
