"""What a release wrote is read for ever: each archive beside this file has the files of a release.

The press has 2450 N and 118 N·m per mV/V, the cart 100 kg and a drag of 0.4 N/(m/s)^2, as the tutorials
state that made the files; the virtual machine's rack has a zero of -0.3 deg.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import toolkit
from toolkit.cli.main import run

RELEASES = sorted(Path(__file__).parent.glob("*.zip"))


@pytest.fixture(params=RELEASES, ids=lambda path: path.stem)
def release(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    shutil.unpack_archive(request.param, tmp_path)
    return tmp_path


def test_the_releases_are_there() -> None:
    assert [path.stem for path in RELEASES][:2] == ["0.1.0", "1.0.0"]


def test_its_records_are_refitted_and_stand(release: Path) -> None:
    laboratory = toolkit.open_laboratory(release / "home")
    assert laboratory.verify().to_dataframe()[["id", "ok", "verified"]].to_numpy().tolist() == [
        ["m15-virtual-r1", True, True],
        ["press-7-r1", True, True],
    ]
    table = laboratory.record("press-7-r1").to_dataframe().set_index(["load", "term"])
    for load, term, truth in (("FZ", "A", 2450.0), ("MY", "B", 118.0)):
        row = table.loc[(load, term)]
        assert abs(row["coefficient"] - truth) < 4 * row["standard_error"]


def test_loads_that_it_applied_are_computed_again(tmp_path: Path) -> None:
    release = tmp_path  # 0.1.0 had no such command
    shutil.unpack_archive(Path(__file__).with_name("1.0.0.zip"), release)
    record = toolkit.open_laboratory(release / "home").record("press-7-r1")
    written = pd.read_csv(release / "applied.csv", comment="#")
    loads = record.apply(pd.read_csv(release / "data.csv")).to_dataframe()
    for column in ("FZ [N]", "MY [N*m]"):
        np.testing.assert_allclose(loads[column], written[column], rtol=1e-6, atol=1e-6)


def test_its_reduced_test_is_read(release: Path) -> None:
    laboratory = toolkit.open_laboratory(release / "home")
    conditions = laboratory.read_test(release / "test.xlsx").process().to_dataframe()
    assert len(conditions) == 15
    assert set(conditions["calibration_sha256"]) == {laboratory.record("m15-virtual-r1").result.sha256}
    # The rack's zero is -0.3 deg, in the plan and in every measured angle; the sensor repeats to 0.01 deg.
    zero = np.rad2deg(conditions["SA_rad"] - conditions["step_SA_rad"])
    np.testing.assert_allclose(zero, -0.3, atol=0.02)


def test_its_model_of_a_diagnosis_simulates(release: Path) -> None:
    recording = release / "case" / "run01.csv"
    words = [
        "simulate",
        release / "case/answer/model.toml",
        "--inputs",
        recording,
        "--out",
        release / "again",
    ]
    with pytest.raises(SystemExit) as ended:
        run([str(word) for word in words])
    assert ended.value.code == 0
    residual = pd.read_csv(recording)["F"] - pd.read_csv(release / "again" / "run01.csv")["F"]
    # The recording's noise is 3 N in 300 rows: its standard deviation is known to 1 / sqrt(600) of itself.
    assert np.std(residual) == pytest.approx(3.0, rel=4 / np.sqrt(600))
