"""The readers of materials, tanks, cells, carts and vehicles: rows of the publishers' layouts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.recordings.plant_readers import elastic_tape, small_car, tank_with_bottle


def test_a_tape_is_read_until_it_hangs_slack(tmp_path: Path) -> None:
    # Every 0.02 s, up to a newton and down again: the last taut row of 401 is the 199th after the peak.
    force = np.concatenate([np.linspace(0.0, 1.0, 201), np.linspace(0.995, 0.0, 200)])
    lines = ["", "time,way,force", "(s),(mm),(N)"]
    lines += [f'"{0.02 * k:.4f}","{k:.4f}","{F:.4f}"' for k, F in enumerate(force)]
    path = tmp_path / "0d01_2d0.csv"
    path.write_text("\n".join(lines), encoding="latin-1")
    (run,) = elastic_tape({"0d01_2d0.csv": path})
    assert run.table["F"].min() == 0.0
    assert run.table["F"].iloc[-1] > 0.01
    assert run.table["x"].iloc[-1] == pytest.approx(0.397, abs=0.003)


def test_a_tank_is_read_between_its_calibrated_levels(tmp_path: Path) -> None:
    # A reading of 500 + 10 h: the tank is filled to 6 cm, 4 are calibrated, and the jet dies at 2 cm.
    calibration = tmp_path / "level_sensor_calibration.csv"
    calibration.write_text("h,reading\n1,510\n2,520\n3,530\n4,540\n", encoding="utf-8-sig")
    reading = np.concatenate([np.linspace(500, 560, 50), np.linspace(560, 510, 2001)])
    rows = [f"{0.5 * k},{value}" for k, value in enumerate(reading)]
    level = tmp_path / "liq_level_data_w_bottle.csv"
    level.write_text("# file\nTime [s], reading\n" + "\n".join(rows), encoding="utf-8")
    (run,) = tank_with_bottle({path.name: path for path in (calibration, level)})
    assert run.conditions["start"] == pytest.approx(0.04, abs=1e-4)
    assert run.table["level"].iloc[-1] == pytest.approx(0.02, abs=1e-3)
    # Every 20th row of two a second.
    assert run.table["t"].diff().dropna().to_numpy() == pytest.approx(10.0)


def test_the_longest_drive_above_the_publishers_limit_is_read(tmp_path: Path) -> None:
    head = "elapsed time sensors,W (IMU),vel encoder,steering"
    speeds = [0.0, 1.0, 1.0, 0.5, 1.0, 1.0, 1.0, 0.0]
    rows = [f"{100 + 0.1 * k},{k},{v},0.1" for k, v in enumerate(speeds)]
    path = tmp_path / "car_11_40_46.csv"
    path.write_text("\n".join([head, *rows]), encoding="utf-8")
    (run,) = small_car({"car_11_40_46.csv": path})
    assert run.name == "drive_11_40_46"
    assert list(run.table["yaw_rate"]) == [4.0, 5.0, 6.0]
    assert run.table["t"].to_numpy() == pytest.approx([0.0, 0.1, 0.2])
