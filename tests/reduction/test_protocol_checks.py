"""A test held against protocols of its own: repeats, drift, speed, directions, the shaft that is counted."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.machine import load_machine
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.recording.labview import write_labview
from toolkit.reduction.model import ReducedTest

PROTOCOL = """
source = "0 deg at the start and at the end"
slip_angles = {{ value = [0, 2, -2, 0], unit = "deg" }}
loads = {{ value = [400, 800], unit = "lbf" }}
rotations = ["forward"]
slip_angle_tolerance = {{ value = 0.5, unit = "deg" }}
load_tolerance = 0.05
settle_revolutions = 2.5
average_revolutions = 1
acquisition = "after_settling"
{more}
"""
M15 = load_machine("m15")
N_PER_DEG = 100.0  # lbf per degree that the cells of this test show


def folder(
    tmp_path: Path,
    angles: tuple[float, ...],
    *,
    drift: float = 0.0,
    toml: str = "",
    protocol: str = "",
    extra: dict[str, float] | None = None,
) -> Path:
    """One file an angle, two loads in each; the last file's force is off by ``drift`` lbf."""
    where = tmp_path / "test"
    where.mkdir()
    (where / "plan.toml").write_text(PROTOCOL.format(more=protocol))
    (where / "test.toml").write_text(f'machine = "m15"\nprotocol = "plan.toml"\n{toml}')
    rng = np.random.default_rng(3)
    for number, angle in enumerate(angles):
        n = 40
        force = -N_PER_DEG * angle + (drift if number == len(angles) - 1 else 0.0)
        columns = {
            "FZ": np.repeat([400.0, 800.0], n) + rng.normal(0, 0.2, 2 * n),
            "D51": force / 2 + rng.normal(0, 0.5, 2 * n),
            "D52": force / 2 + rng.normal(0, 0.5, 2 * n),
            "E5": rng.normal(0, 0.5, 2 * n),
            "SA": np.full(2 * n, angle) + rng.normal(0, 1e-3, 2 * n),
        } | {name: np.full(2 * n, value) for name, value in (extra or {}).items()}
        write_labview(where / f"run{number}.xlsx", M15, columns, simulated=False)
    return where


def reduced(where: Path, record: CalibrationRecord) -> ReducedTest:
    test = read_test_folder(where)
    return process(test, read_test(test), record).reduced


def rules(found: ReducedTest) -> set[str]:
    return {one.rule for one in found.findings}


def test_a_step_that_stands_twice_is_used_twice(tmp_path: Path, published_record: CalibrationRecord) -> None:
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.05)), published_record)
    assert found.protocol == "0 deg at the start and at the end"
    assert sum(c.step_SA == 0.0 for c in found.used()) == 4  # two files, two loads
    assert not rules(found) & {"doubled", "missing", "missing-repeat", "repeat-drift"}


def test_a_third_time_is_one_too_many(tmp_path: Path, published_record: CalibrationRecord) -> None:
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.0, 0.0)), published_record)
    assert "doubled" in rules(found)
    assert {c.file for c in found.conditions if not c.used} == {"run4.xlsx"}


def test_a_repeat_that_is_not_there_is_told(tmp_path: Path, published_record: CalibrationRecord) -> None:
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0)), published_record)
    (one,) = [f for f in found.findings if f.rule == "missing-repeat"]
    assert "1 of 2 declared repeats at load 400, 800 lbf" in one.message


# The largest force is 200 lbf; 3 % of it are 6 lbf.
@pytest.mark.parametrize(("drift", "told"), [(4.0, False), (-9.0, True), (9.0, True)])
def test_drift_between_repeats(
    drift: float, told: bool, tmp_path: Path, published_record: CalibrationRecord
) -> None:
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.0), drift=drift), published_record)
    assert ("repeat-drift" in rules(found)) is told


def test_a_finding_serves_reports_in_either_system(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.0), drift=9.0), published_record)
    drifts = {f.message[:2]: f.message for f in found.findings if f.rule == "repeat-drift"}
    for channel, si, pounds, factor in (("FY", "N", "lbf", 4.4482216), ("MZ", "N·m", "lbf·ft", 1.3558179)):
        if channel in drifts:
            drift, same = re.search(rf"by (\S+) {si} \((\S+) {pounds}\);", drifts[channel]).groups()
            assert float(drift) == pytest.approx(float(same) * factor, rel=0.01)
    # The cells are off by 9 lbf together; 400 lbf are 400 x 4.4482 N.
    assert "FY" in drifts
    assert re.search(r"and [48]00 lbf \((1779|3559) N\)", drifts["FY"])


def test_repeats_at_unlike_angles_are_compared_at_one(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    """0.3 deg apart: 30 lbf of the tire, and no drift."""
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.3)), published_record)
    assert "repeat-drift" not in rules(found)


def test_the_tolerance_of_repeats_is_the_protocol_s(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    where = folder(tmp_path, (0.0, 2.0, -2.0, 0.0), drift=9.0, protocol="repeat_tolerance = 0.05")
    assert "repeat-drift" not in rules(reduced(where, published_record))


@pytest.mark.parametrize(("speed", "told"), [(8.66, False), (8.67, True), (6.66, False), (6.6, True)])
def test_a_declared_speed_within_one_kilometre_an_hour(
    speed: float, told: bool, tmp_path: Path, published_record: CalibrationRecord
) -> None:
    toml = f'speed = {{ value = {speed}, unit = "km/h" }}'
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.0), toml=toml), published_record)
    assert ("speed" in rules(found)) is told


def test_a_measured_speed_is_checked_and_the_protocol_s_own_wins(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    own = 'speed = { value = 20, unit = "km/h" }'
    for place, (protocol, measured, told) in enumerate(
        (("", 7.7, False), ("", 9.0, True), (own, 7.7, True), (own, 19.5, False))
    ):
        (tmp_path / str(place)).mkdir()
        where = folder(
            tmp_path / str(place), (0.0, 2.0, -2.0, 0.0), protocol=protocol, extra={"V [km/h]": measured}
        )
        assert ("speed" in rules(reduced(where, published_record))) is told


def test_the_directions_are_the_protocol_s(tmp_path: Path, published_record: CalibrationRecord) -> None:
    found = reduced(folder(tmp_path, (0.0, 2.0, -2.0, 0.0)), published_record)
    assert "missing" not in rules(found)  # the machine can reverse; this protocol does not ask for it
    (tmp_path / "b").mkdir()
    protocol = PROTOCOL.format(more="").replace('["forward"]', '["forward", "reverse"]')
    where = folder(tmp_path / "b", (0.0, 2.0, -2.0, 0.0))
    (where / "plan.toml").write_text(protocol)
    assert "missing" in rules(reduced(where, published_record))


def test_a_drum_revolution_is_longer_than_a_tire_s(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    """8.5 m against 2 pi 0.97 x 0.31595 m: with the drum's turns counted, 4.414 times as many rows."""
    rows = {}
    for shaft in ("tire", "drum"):
        where = tmp_path / shaft
        where.mkdir()
        (where / "plan.toml").write_text(PROTOCOL.format(more=f'revolutions_of = "{shaft}"'))
        (where / "test.toml").write_text(
            'machine = "m15"\nprotocol = "plan.toml"\n[tire]\nsize = "205/55R16"'
        )
        n = 2000
        columns = {name: np.zeros(2 * n) for name in ("D51", "D52", "E5", "SA")}
        columns |= {
            "FZ": np.repeat([400.0, 800.0], n),
            "DRUM_ANGLE [deg]": np.tile(np.arange(n) * 1.0, 2),
        }
        write_labview(where / "x.xlsx", M15, columns, simulated=False)
        found = reduced(where, published_record)
        first = found.conditions[0]
        rows[shaft] = (first.first_row - 1, first.last_row - first.first_row + 1)
        assert f"{shaft} revolutions" in found.averaging
    ratio = 8.5 / (2 * math.pi * 0.97 * 0.31595)
    assert rows["drum"] == pytest.approx((2.5 * 360, 360), abs=1)
    assert rows["tire"] == pytest.approx((2.5 * 360 / ratio, 360 / ratio), abs=1)


def test_a_tire_turned_on_the_hub_keeps_the_signs_of_the_cells(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    """With the drum reversed FY of the cells changes sign in SAE axes; with the tire turned it does not."""
    forces = {}
    for reversal in ("drum", "tire"):
        (tmp_path / reversal).mkdir()
        toml = f'rotation = "reverse"\nreversal = "{reversal}"'
        found = reduced(folder(tmp_path / reversal, (0.0, 2.0, -2.0, 0.0), toml=toml), published_record)
        forces[reversal] = np.array([c.FY for c in found.conditions])
        assert {c.rotation for c in found.conditions} == {"reverse"}
    assert forces["drum"] == pytest.approx(-forces["tire"])
