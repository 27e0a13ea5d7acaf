"""What all rows of a record share: that nobody stated the standard's uncertainty is told wherever U is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.uncertainty.common_errors import reference_findings
from toolkit.reduction.remarks import record_findings

STATED = '[reference.uncertainty]\nFY = { U = 0.8, k = 2, unit = "N" }\n'


@pytest.mark.parametrize("stated", ["", STATED])
def test_loads_whose_standard_has_no_stated_uncertainty_are_named(
    tmp_path: Path, make_session: Callable[..., Path], stated: str
) -> None:
    path = make_session(hub_data(60, 3), name="bare", tail=stated)
    registry = Registry(tmp_path / "calibrations")
    record = calibrate(path, registry).record
    (finding,) = reference_findings(record)
    assert (finding.rule, finding.level, finding.where) == ("reference-unstated", "note", "hub-r1")
    assert f"of {'MZ, MX' if stated else 'FY, MZ, MX'}:" in finding.message
    # Of a test's forces and of the loads of any file alike.
    assert record_findings(record) == [finding]
