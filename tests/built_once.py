"""Folders that take long to build: one for all workers of a run of the tests."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable
from pathlib import Path

import pytest


def built_once(factory: pytest.TempPathFactory, name: str, build: Callable[[Path], object]) -> Path:
    """Return a folder that the first who asks has built, to read or to copy; others wait for it meanwhile.

    A folder whose building failed is not there: the next who asks builds it again, and sees the failure.
    """
    common = common_folder(factory)
    folder = common / f"{name}-built"
    with (common / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.is_dir():
            attempt = factory.mktemp(name)
            build(attempt)
            attempt.rename(folder)
    return folder


def common_folder(factory: pytest.TempPathFactory) -> Path:
    """Return the folder that all workers of a run have in common."""
    base = factory.getbasetemp()
    return base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base
