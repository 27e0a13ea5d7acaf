"""From an empty folder, a file of the field to a tire file in one command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.tires.test_field_file import CONDITIONS, belt_test, truth, write_dat
from toolkit.cli.main import run
from toolkit.lab.tire_tests.tires import read_tire


@pytest.mark.campaign(
    "a whole belt test: its file, its sweeps and the fit of its rows are each held in every run (tests/tires)"
)
def test_a_belt_test_becomes_a_tire_file_with_intervals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_dat(Path("run.dat"), belt_test())
    with pytest.raises(SystemExit) as caught:
        run(["fit", "run.dat", "--model", "mf52", "--tir", "tire.tir", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert caught.value.code in (0, 1), told
    assert (told["sweeps"]["axes"], told["sweeps"]["swept"]) == ("SAE", "SA")
    assert sum(c["direction"] == "up" for c in told["sweeps"]["conditions"]) == len(CONDITIONS)
    lateral = next(fit for fit in told["fits"] if fit["channel"] == "FY")
    stiffness = lateral["cornering_stiffness_N_per_rad"]
    at = truth(np.array([-1e-4, 1e-4]), lateral["load_N"] or 1000.0, P=100e3)
    assert 0 < stiffness["standard_error"] < 0.1 * stiffness["value"]
    assert abs(stiffness["value"] - (at[0] - at[1]) / 2e-4) < 3 * stiffness["standard_error"]
    slip, load = np.radians([-6.0, -2.0, 1.0, 4.0]), np.full(4, 1000.0)
    fitted = read_tire("tire.tir").evaluate({"SA [rad]": slip, "FZ [N]": load}, axes="SAE")["FY [N]"]
    # 5.2 has no pressure: it is fitted at one of the test's two, which is said.
    expected = truth(slip, load, P=100e3)
    assert np.max(np.abs(fitted - expected)) < 0.02 * np.max(np.abs(expected))
    (apart,) = (one["message"] for one in told["findings"] if one["rule"] == "other-conditions")
    assert apart.endswith("kept 100 kPa")
    assert {path.name for path in tmp_path.iterdir()} == {"run.dat", "tire.tir"}


def test_a_damaged_belt_test_is_refused_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_dat(tmp_path / "run.dat", belt_test())
    path.write_text(path.read_text().replace("\tdeg\t", "\tblurbs\t", 1))
    with pytest.raises(SystemExit) as caught:
        run(["fit", str(path), "--tir", str(tmp_path / "tire.tir"), "--json"])
    assert caught.value.code == 2
    assert json.loads(capsys.readouterr().out)["error"]["rule"] == "unknown-unit"
    assert not (tmp_path / "tire.tir").exists()
