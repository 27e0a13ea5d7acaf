"""The demonstrations of the gates, done once for all workers of a run of the tests."""

from __future__ import annotations

import pickle
import socket
import tempfile
from pathlib import Path

import pytest

from tests.built_once import built_once
from toolkit.qualification import run as qualification
from toolkit.qualification.gates import check_gates
from toolkit.qualification.model import Check
from toolkit.qualification.numbers import FOLDER


def demonstrated(factory: pytest.TempPathFactory) -> tuple[list[Check], Path]:
    """Return every check of the gates, and the only folder that the demonstrations had.

    It was their home, held their temporary files and was where they began; a connection was an error.
    """
    folder = built_once(factory, "demonstrated", _demonstrate)
    checks: list[Check] = pickle.loads((folder / "checks").read_bytes())  # noqa: S301  written below
    return checks, folder / "alone"


def as_demonstrated(checks: list[Check], patch: pytest.MonkeyPatch) -> None:
    """Have a qualification take these checks for those of its own packaged gates."""

    def asked(folder: Path) -> list[Check]:
        assert folder == FOLDER
        return checks

    patch.setattr(qualification, "check_gates", asked)


def _demonstrate(folder: Path) -> None:
    def connect(*_: object) -> None:
        raise AssertionError("the qualification opened a connection")

    alone = folder / "alone"
    (alone / "tmp").mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(socket.socket, "connect", connect)
        patch.setattr(tempfile, "tempdir", str(alone / "tmp"))
        patch.chdir(alone)
        patch.setenv("HOME", str(alone))
        checks = list(check_gates(FOLDER))
    (folder / "checks").write_bytes(pickle.dumps(checks))
