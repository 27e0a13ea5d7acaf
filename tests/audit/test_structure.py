"""Edits of rows and loads that leave forces and cells in agreement are told by the order of the rows."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np

from tests.audit.archive_made import dated, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.calibration.registry.registry import Registry

REGISTRY = Registry(Path(__file__).resolve().parents[2] / "calibrations")


def findings(tmp_path, changed):
    dated(tmp_path / "test", "2019-06-01")
    for number in range(6):
        table = recording(rows=100, seed=number)
        write(tmp_path / "test" / f"run_{number}.xlsx", changed(table) if number == 2 else table)
    made = audit_archive(tmp_path, REGISTRY, known_at=dt.date(2026, 1, 1))
    assert {file.grade for file in made.files} == {"exact"}
    return [one for one in made.findings if one.where == "test/run_2.xlsx"]


def test_an_untouched_test_says_nothing(tmp_path):
    assert not findings(tmp_path, dict)


def test_a_deleted_row(tmp_path):
    (one,) = findings(tmp_path, lambda t: {name: np.delete(v, 33) for name, v in t.items()})
    assert one.rule == "row-count"
    assert "rows 21 to 39 are 19" in one.message


def test_rows_that_changed_places(tmp_path):
    order = np.arange(100)
    order[[10, 50]] = order[[50, 10]]
    told = findings(tmp_path, lambda t: {name: np.asarray(v)[order] for name, v in t.items()})
    (one,) = [one for one in told if one.rule == "foreign-row"]
    assert "row 11" in one.message
    assert "row 51" in one.message


def test_a_load_that_was_multiplied(tmp_path):
    factor = np.where(np.arange(100) < 20, 1.1, 1.0)
    told = findings(tmp_path, lambda t: t | {"FZ": t["FZ"] * factor})
    assert [one.rule for one in told] == ["load-tolerance"]
    assert "rows 1 to 20" in told[0].message
