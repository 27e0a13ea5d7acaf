"""A table of numbers, and a file that holds it read as a recording."""

from __future__ import annotations

import numpy as np
import pytest

from tests.recording.format_checks import M15, ROWS
from tests.recording.format_factory import HEADER
from toolkit.recording import read_recording


@pytest.fixture(scope="module")
def table():
    rng = np.random.default_rng(7)
    scale = {"FZ": 1000.0, "SA": 1.0, "MZ": 30.0}
    return {name: np.round(rng.normal(0, scale.get(name, 300.0), ROWS), 4) for name in HEADER}


@pytest.fixture
def read(tmp_path):
    def made(data: bytes, name="a recording"):
        path = tmp_path / name
        path.write_bytes(data)
        return read_recording(path, M15)

    return made
