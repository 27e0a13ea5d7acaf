"""A report is amended where its test can be computed again, and nowhere else."""

from __future__ import annotations

import json
from pathlib import Path

from tests import commands
from tests.audit.test_sides import a_test, exchanged
from toolkit.files import sha256_file

CHECKOUT = Path(__file__).resolve().parents[3]


def test_a_test_whose_cells_disagree_with_its_forces_gets_no_amended_report(tmp_path: Path) -> None:
    """Its right forces are lost to whoever computes them from the changed cells again."""
    archive, reports = tmp_path / "archive", tmp_path / "reports"
    a_test(archive, lambda number, table: exchanged(table) if number == 3 else table)
    manifest = {
        "generator": "toolkit", "schema": 1, "report": "TR-1", "calibrations": [{"id": "m15-r1"}],
        "inputs": [{"name": "a", "sha256": sha256_file(archive / "test" / "run_00.xlsx")}], "outputs": [],
    }  # fmt: skip
    reports.mkdir()
    (reports / "manifest.json").write_text(json.dumps(manifest))
    words = ("audit", archive, "--reports", reports, "--repair", tmp_path / "fixed", "--home", CHECKOUT)
    code, answer = commands.answer(*words)
    assert code == 1
    assert [(report["to_amend"], report["disputed"]) for report in answer["reports"]] == [(True, 1)]
    (amended,) = answer["amended"]
    assert (amended["replaces"], amended["pdf"], amended["docx"]) == ("TR-1", None, None)
    assert amended["error"]["rule"] == "cells-disagree"
    assert "test/run_03.xlsx" in amended["error"]["got"]
    assert not list((tmp_path / "fixed").rglob("*.pdf"))
