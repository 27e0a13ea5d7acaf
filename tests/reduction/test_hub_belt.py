"""A test on a belt with six loads: truth within U, the gate of physics, the workbook, no hub as before."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.reduction.belt_factory import processed, truth, write_belt
from tests.reduction.hub_factory import record
from toolkit.errors import ColumnError
from toolkit.testfile.read import read_test_file
from toolkit.testfile.write import write_test_file


def test_the_truth_lies_within_the_uncertainty(tmp_path: Path) -> None:
    conditions = processed(write_belt(tmp_path), record(1e-4)).reduced.conditions
    assert len(conditions) == 10
    for condition in conditions:
        expected = truth(round(np.degrees(condition.SA)), condition.FZ)
        for entry in condition.hub:
            assert abs(entry.value - expected[entry.load]) <= 3 * entry.u
            assert entry.u > 0


def test_a_right_handed_overturning_moment_is_possible(tmp_path: Path) -> None:
    reduced = processed(write_belt(tmp_path), record(1e-4)).reduced
    assert reduced.impossible == ()
    assert [f.message for f in reduced.findings if f.rule == "hub-moments"] == [
        "MX and MY about the contact patch, carried there by an arm of 320 mm, u = 2 mm"
    ]


def test_a_turned_cell_of_the_overturning_moment_is_not(tmp_path: Path) -> None:
    reduced = processed(write_belt(tmp_path, turned="cMX"), record(1e-4)).reduced
    assert {finding.rule for finding in reduced.impossible} == {"impossible-cells"}


def test_the_workbook_keeps_the_loads_of_the_hub(tmp_path: Path) -> None:
    result = processed(write_belt(tmp_path), record(1e-4))
    write_test_file(tmp_path / "test.xlsx", result)
    back = read_test_file(tmp_path / "test.xlsx")
    assert [c.hub for c in back.reduced.conditions] == [c.hub for c in result.reduced.conditions]
    table = result.reduced.table()
    assert list(table.columns[-8:]) == [*(f"hub_{x}" for x in ("FX", "FZ", "MX", "MY")),
                                        *(f"u_hub_{x}" for x in ("FX", "FZ", "MX", "MY"))]  # fmt: skip


def test_what_a_hub_measures_beside_them_changes_neither_FY_nor_MZ(tmp_path: Path) -> None:
    with_hub = processed(write_belt(tmp_path / "a"), record(1e-4)).reduced.table()
    without = processed(write_belt(tmp_path / "b", hub=False), record(1e-4)).reduced.table()
    assert not [name for name in without if "hub" in name]
    for name in ("FY", "MZ", "u_FY", "u_MZ", "FY_common", "MZ_common"):
        assert with_hub[name].tolist() == pytest.approx(without[name].tolist(), rel=0, abs=0)


@pytest.mark.parametrize("zero", [0.0, 70.0])
def test_the_hubs_load_serves_where_a_machine_has_no_other(zero: float, tmp_path: Path) -> None:
    """The truth comes back, as with a column of the load; with a tare in each file the cells' zeros too."""
    alone = processed(write_belt(tmp_path / "a", load=False, zero=zero), record(1e-4)).reduced
    beside = processed(write_belt(tmp_path / "b", zero=zero), record(1e-4)).reduced
    assert len(alone.conditions) == 10
    for mine, other in zip(alone.conditions, beside.conditions, strict=True):
        assert (mine.step_SA, mine.step_FZ) == (other.step_SA, other.step_FZ)
        assert mine.FZ == pytest.approx(other.step_FZ, abs=0.3)  # of 40 rows that scatter by 0.2 N each
        assert {entry.load: entry.value for entry in mine.hub}["FZ"] == pytest.approx(mine.FZ, abs=1e-9)
        assert mine.FY == pytest.approx(other.FY, abs=1e-9)
    told = [finding for finding in alone.findings if finding.rule == "hub-load"]
    assert [finding.level for finding in told] == ["note"]
    assert not [finding for finding in beside.findings if finding.rule == "hub-load"]


def test_a_machine_with_no_load_at_all_is_told_so(tmp_path: Path) -> None:
    with pytest.raises(ColumnError, match="no channel FZ"):
        processed(write_belt(tmp_path, hub=False, load=False), record(1e-4))
