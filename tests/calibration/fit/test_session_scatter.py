"""What a record stores of its scatter is held against its own rows, whatever the method."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.fit.test_row_noise import METHODS, drawn_session
from tests.calibration.fit.test_scatter_findings import renumbered
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.refit import check_reproduces
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.errors import RecordError


@pytest.mark.parametrize("rows", [None, 1], ids=["told", "untold"])
@pytest.mark.parametrize("method", METHODS)
def test_a_scatter_that_is_not_of_the_rows_is_refused(tmp_path: Path, method: str, rows: int | None) -> None:
    path = drawn_session(tmp_path / "s", method, 2, runs=1.0)
    if rows is not None:
        renumbered(path, rows)
    registry = Registry(tmp_path / "calibrations")
    record = registry.load(calibrate(path, registry).record.id)
    table = stored_loads(registry.folder, record)
    assert table is not None
    check_reproduces(record, table)
    (load,) = record.loads
    assert load.scatter is not None
    for part in ("within", "gain"):
        moved = dataclasses.replace(load.scatter, **{part: getattr(load.scatter, part) / 2})
        forged = dataclasses.replace(record, loads=(dataclasses.replace(load, scatter=moved),))
        with pytest.raises(RecordError, match="scatter"):
            check_reproduces(forged, table)


def test_a_record_whose_weights_alone_made_its_covariance_is_read_as_before(tmp_path: Path) -> None:
    path = drawn_session(tmp_path / "s", "wls", 2, runs=0.0)
    registry = Registry(tmp_path / "calibrations")
    record = registry.load(calibrate(path, registry).record.id)
    table = stored_loads(registry.folder, record)
    assert table is not None
    (load,) = record.loads
    # As releases before stored it: (X'WX)^-1, and no scatter.
    X = np.column_stack([table.column("A"), np.ones(table.rows)])
    covariance = np.linalg.inv(X.T @ (X / table.column("u_F")[:, None] ** 2))
    before = dataclasses.replace(load, scatter=None, covariance=tuple(map(tuple, covariance.tolist())))
    check_reproduces(dataclasses.replace(record, loads=(before,)), table)
