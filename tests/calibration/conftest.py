"""A session on disk, and a registry that holds its record."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.calibration.calibration_factory import CELLS, LOADS, UNITS, csv_text, hub_data, session_text
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry


@pytest.fixture
def make_session(tmp_path: Path) -> Callable[..., Path]:
    """Write a hub session: ``values`` replaces its rows, other keywords entries of SESSION.toml."""

    def make(
        values: NDArray[np.float64] | None = None,
        *,
        check_rows: NDArray[np.float64] | None = None,
        tail: str = "",
        name: str = "session",
        digits: int = 7,
        **changes: str,
    ) -> Path:
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        names = [f"{c} [mV/V]" for c in CELLS] + [f"{n} [{UNITS[n]}]" for n in LOADS]
        values = hub_data(60, 1) if values is None else values
        check = hub_data(9, 2) if check_rows is None else check_rows
        (folder / "loads.csv").write_text(csv_text(names, values, runs=True, digits=digits))
        (folder / "check.csv").write_text(csv_text(names, check, runs=False, digits=digits))
        path = folder / "SESSION.toml"
        path.write_text(session_text(**changes) + tail)
        return path

    return make


@pytest.fixture
def registry(tmp_path: Path, make_session: Callable[..., Path]) -> Registry:
    """A registry with one fitted record, hub-r1."""
    made = Registry(tmp_path / "calibrations")
    calibrate(make_session(), made)
    return made
