"""A session on disk, and a registry that holds its record."""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import write_session
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry


@pytest.fixture
def make_session(tmp_path: Path) -> Callable[..., Path]:
    """Write a hub session: ``values`` replaces its rows, other keywords entries of SESSION.toml."""

    return functools.partial(write_session, tmp_path)


@pytest.fixture(scope="session")
def entered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session and the registry that it was entered in; nobody writes into it."""
    folder = tmp_path_factory.mktemp("entered")
    calibrate(write_session(folder), Registry(folder / "calibrations"))
    return folder


@pytest.fixture
def registry(tmp_path: Path, entered: Path) -> Registry:
    """A registry with one fitted record, hub-r1, and its session beside it."""
    shutil.copytree(entered, tmp_path, dirs_exist_ok=True)
    return Registry(tmp_path / "calibrations")
