import functools
import json
from pathlib import Path

import numpy as np
import pytest

from tests import commands
from tests.recording.fig4_4 import ROWS, SYMBOLS
from toolkit.errors import ToolkitError
from toolkit.examples import packaged_fig4_4
from toolkit.machine import load_machine
from toolkit.recording.labview import write_labview


@pytest.fixture
def run():
    return functools.partial(commands.result, "inspect")


def test_figure_4_4_in_an_empty_registry(run, tmp_path):
    found = run(packaged_fig4_4()[1], "--calibrations", tmp_path, "--json", "--prove")
    assert found.return_value == 1
    answer = json.loads(found.stdout)
    assert answer["schema"] == 1
    assert [(c["symbol"], c["unit"]) for c in answer["channels"]] == [
        ("FZ", "lbf"), ("D52", "lbf"), ("D51", "lbf"), ("E5", "lbf"), ("SA", "deg"), ("FY", "lbf"),
        ("MZ", "lbf*ft"),
    ]  # fmt: skip
    assert (answer["rows"], len(answer["blocks"]), answer["simulated"]) == (10, 5, False)
    assert round(answer["slip_angle_deg"], 2) == -0.30
    # the loads of the figure, two rows each
    assert [round(b["load_lbf"]) for b in answer["blocks"]] == [249, 587, 835, 1112, 1376]
    assert answer["calibration"]["grade"] == "unknown"
    assert {(i["load"], i["sign"]) for i in answer["intervals"] if i["name"] == "E5"} == {
        ("FY", -1),
        ("MZ", -1),
    }
    assert answer["files"][0]["sha256"] == answer["sha256"]


def test_text_is_one_screen(run, tmp_path):
    found = run(packaged_fig4_4()[0], "--calibrations", tmp_path)
    lines = found.stdout.splitlines()
    assert len(lines) <= 30
    assert max(map(len, lines)) <= 110
    assert "slip angle -0.30 deg" in found.stdout


def test_several_files(run, tmp_path):
    found = run(*packaged_fig4_4(), "--calibrations", tmp_path, "--json")
    answer = json.loads(found.stdout)
    assert len(answer["files"]) == 2
    assert "sha256" not in answer


def test_without_a_home_the_file_is_still_shown(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("TOOLKIT_HOME", raising=False)
    found = run(packaged_fig4_4()[0], "--json")
    assert found.return_value == 1
    answer = json.loads(found.stdout)
    assert answer["calibration"] is None
    assert [(one["rule"], one["level"]) for one in answer["findings"]] == [
        ("impossible-force", "error"),
        ("no-home", "warning"),
    ]
    # |Fy| of the first block over its load, by hand: (371.3554 + 371.3506) / (248.8146 + 250.0319)
    assert "1.49 of the load at -0.30 deg" in answer["findings"][0]["message"]


def test_quiet_says_nothing(run, tmp_path):
    assert run(packaged_fig4_4()[0], "--calibrations", tmp_path, "--quiet").stdout == ""


@pytest.mark.parametrize("content", [b"", b"not a workbook", b"PK\x03\x04 cut off"])
def test_bad_files_are_errors_with_a_next_step(run, tmp_path, content):
    (tmp_path / "bad").write_bytes(content)
    found = run(tmp_path / "bad", "--calibrations", tmp_path)
    assert isinstance(found.exception, ToolkitError)
    assert found.exception.exit_code == 2
    assert found.exception.next_step


def test_a_registry_that_is_named_must_exist(run, tmp_path):
    found = run(packaged_fig4_4()[0], "--calibrations", tmp_path / "none")
    assert isinstance(found.exception, ToolkitError)


class TestFigure44InThisRegistry:
    """With the project's own records of the machine: what the issue of the accident demands."""

    @pytest.fixture
    def calibrations(self):
        folder = Path(__file__).resolve().parents[2] / "calibrations"
        if not (folder / "m15" / "ledger.jsonl").is_file():
            pytest.skip("the registry of the checkout is not here")
        return folder

    def test_withdrawn_record_is_named_with_its_fault(self, run, calibrations):
        found = run(packaged_fig4_4()[1], "--calibrations", calibrations, "--json")
        answer = json.loads(found.stdout)
        one = answer["calibration"]
        assert (found.return_value, one["grade"], one["record"], one["variant"]) == (
            1,
            "stale",
            "m15-r1",
            None,
        )
        assert one["void_always"] is True
        assert one["against_corrected_by"] == "E5 negative in FY, MZ"
        first = answer["corrected_first_row"]
        assert (round(first["FY_lbf"], 2), round(first["FY_file_lbf"], 2)) == (-1.79, 371.36)
        assert answer["corrected_by"] == "m15-r2"
        assert answer["refused_records"] == []

    def test_in_words(self, run, calibrations):
        text = run(packaged_fig4_4()[0], "--calibrations", calibrations).stdout
        assert "withdrawn calibration: E5 negative in FY, MZ against m15-r2" in text
        assert "first row: Fy -1.79 lbf where the file has 371.36" in text
        assert max(map(len, text.splitlines())) <= 110


def test_a_file_without_a_load_is_refused_unless_it_is_the_tare(run, tmp_path):
    machine = load_machine("m15")
    columns = {c.symbol: np.full(20, 1.0) for c in machine.columns}
    write_labview(tmp_path / "rest.xlsx", machine, columns, simulated=False)
    found = run(tmp_path / "rest.xlsx", "--calibrations", tmp_path)
    assert isinstance(found.exception, ToolkitError)
    assert found.exception.rule == "no-load-block"
    (tmp_path / "test.toml").write_text('schema = 1\nmachine = "m15"\n[tare]\nfile = "rest.xlsx"\n')
    assert run(tmp_path / "rest.xlsx", "--calibrations", tmp_path).exception is None


def test_one_bad_file_of_many_does_not_hide_the_others(run, tmp_path):
    bad = tmp_path / "bad.xlsx"
    bad.write_bytes(b"PK\x03\x04 cut off")
    found = run(packaged_fig4_4()[0], bad, "--calibrations", tmp_path, "--json")
    assert found.return_value == 2
    good, refused = json.loads(found.stdout)["files"]
    assert good["rows"] == 10
    assert refused["error"]["rule"].startswith("zip-")


def test_corrected_values_are_held_against_physics_too(run, tmp_path):
    from toolkit.lab.home import packaged_home

    # Figure 4.4 with E5 as if the cell had been turned: what the good record makes of it is impossible too.
    columns = {s: v.copy() for s, v in zip(SYMBOLS, np.array(ROWS).T, strict=True)}
    columns["E5"] = -columns["E5"]
    write_labview(tmp_path / "x.xlsx", load_machine("m15"), columns, simulated=False)
    found = run(tmp_path / "x.xlsx", "--calibrations", packaged_home() / "calibrations", "--json")
    messages = [f["message"] for f in json.loads(found.stdout)["findings"] if f["rule"] == "impossible-force"]
    assert [message.split(":")[0] for message in messages] == [
        "the stored Fy and Mz are impossible",
        "Fy and Mz by m15-r2 are impossible too",
    ]
