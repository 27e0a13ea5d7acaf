"""Tests that draw whole batches draw the light families only: what they ask is not the physics."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from proof import files
from proof.catalogue import CONFOUNDED, FAMILIES
from toolkit.cli.main import run

LIGHT = ("beam-python", "beam-columns", "drive-force")


@pytest.fixture(scope="module")
def light_families() -> Iterator[None]:
    """Leave the families and classes that are drawn and fitted in a fraction of a second."""
    with pytest.MonkeyPatch.context() as patch:
        for name in set(FAMILIES) - set(LIGHT):
            patch.delitem(FAMILIES, name)
        for name in [k for k, group in CONFOUNDED.items() if group.family not in LIGHT]:
            patch.delitem(CONFOUNDED, name)
        yield


@pytest.fixture
def entered_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sessions are entered by the public command's words in this process, without a start of their own."""

    def enter(sessions: list[Path], registry: Path, tool: list[str]) -> Path:
        path = registry
        for session in sessions:
            said = io.StringIO()
            with contextlib.redirect_stdout(said), pytest.raises(SystemExit) as ended:
                run(["calibrate", str(session / "SESSION.toml"), "--json", "--calibrations", str(registry)])
            assert ended.value.code in (0, 1, None)
            path = Path(json.loads(said.getvalue())["record"]["path"])
        return path

    monkeypatch.setattr(files, "enter", enter)
