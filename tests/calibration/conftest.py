"""A session on disk, and a registry that holds its record."""

from __future__ import annotations

import functools
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


@pytest.fixture
def registry(tmp_path: Path, make_session: Callable[..., Path]) -> Registry:
    """A registry with one fitted record, hub-r1."""
    made = Registry(tmp_path / "calibrations")
    calibrate(make_session(), made)
    return made
