"""A continuous recording: moves and rests in one file, several slip angles, revolutions counted."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.errors import RecordingError
from toolkit.machine import load_machine
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.recording.labview import write_labview
from toolkit.reduction.blocks import find_rests
from toolkit.reduction.model import ReducedTest

M15 = load_machine("m15")
ANGLES, LOADS = (0.0, 2.0, -2.0), (400.0, 800.0)
PER_TURN = 40
REST, MOVE = 4 * PER_TURN, PER_TURN // 2  # 4 revolutions at rest, half a revolution to the next
PROTOCOL = """
source = "dwells"
slip_angles = { value = [0, 2, -2], unit = "deg" }
loads = { value = [400, 800], unit = "lbf" }
rotations = ["forward"]
slip_angle_tolerance = { value = 0.5, unit = "deg" }
load_tolerance = 0.05
settle_revolutions = 2
average_revolutions = 1
revolutions_of = "drum"
acquisition = "continuous"
"""


def ramps(values: list[float], rest: int = REST) -> np.ndarray:
    """Each value held for ``rest`` rows, with a ramp of MOVE rows between two of them."""
    parts = [np.full(rest, values[0])]
    for before, after in itertools.pairwise(values):
        parts += [np.linspace(before, after, MOVE + 2)[1:-1], np.full(rest, after)]
    return np.concatenate(parts)


def folder(where: Path, *, rest: int = REST, protocol: str = PROTOCOL) -> Path:
    """Write one file with every condition: forces -100 lbf/deg, and relaxing by 50 lbf after each move."""
    where.mkdir()
    (where / "plan.toml").write_text(protocol)
    (where / "test.toml").write_text('machine = "m15"\nprotocol = "plan.toml"\n')
    plan = [(SA, FZ) for FZ in LOADS for SA in ANGLES]
    rng = np.random.default_rng(7)
    SA, FZ = ramps([a for a, _ in plan], rest), ramps([load for _, load in plan], rest)
    since = np.arange(SA.size) % (rest + MOVE)
    force = -100.0 * SA + 50.0 * np.exp(-since / (0.2 * PER_TURN))
    columns = {
        "FZ": FZ + rng.normal(0, 1, SA.size),
        "D51": force / 2,
        "D52": force / 2,
        "E5": np.zeros(SA.size),
        "SA": SA + rng.normal(0, 0.01, SA.size),
        "DRUM_ANGLE [deg]": (np.arange(SA.size) * 360.0 / PER_TURN) % 360,
    }
    write_labview(where / "sweep.xlsx", M15, columns, simulated=False)
    return where


def reduced(where: Path, record: CalibrationRecord) -> ReducedTest:
    test = read_test_folder(where)
    return process(test, read_test(test), record).reduced


def test_every_rest_of_one_file_is_a_condition(tmp_path: Path, published_record: CalibrationRecord) -> None:
    found = reduced(folder(tmp_path / "test"), published_record)
    steps = {
        (round(np.degrees(c.step_SA or 0.0)), round((c.step_FZ or 0.0) / 4.4482216)) for c in found.used()
    }
    assert steps == {(round(SA), round(FZ)) for SA in ANGLES for FZ in LOADS}
    assert len(found.conditions) == 6
    rules = {one.rule for one in found.findings}
    assert not rules & {"missing", "doubled", "slip-angle-tolerance", "load-tolerance", "short-block"}
    assert "the first 2 drum revolutions" in found.averaging


def test_settling_and_averaging_are_counted_in_each_rest(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    """Two revolutions after the n-th arrival, for one revolution; a tenth of one may be ramp."""
    found = reduced(folder(tmp_path / "test"), published_record)
    first_rows = sorted(c.first_row - 1 for c in found.conditions)
    arrivals = [place * (REST + MOVE) for place in range(6)]
    assert first_rows == pytest.approx([row + 2 * PER_TURN for row in arrivals], abs=PER_TURN // 10)
    assert {c.last_row - c.first_row + 1 for c in found.conditions} <= {PER_TURN, PER_TURN + 1}


def test_loads_are_carried_at_one_slip_angle(tmp_path: Path, published_record: CalibrationRecord) -> None:
    """The force of the cells does not know the load here: at each angle nothing is to be carried.

    Blocks of other angles taken for neighbours in load would carry hundreds of newtons.
    """
    found = reduced(folder(tmp_path / "test"), published_record)
    for one in found.used():
        assert one.FY_common == pytest.approx(one.FY, abs=0.5)


def test_a_second_file_of_the_same_conditions_is_named_with_every_angle(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    where = folder(tmp_path / "test")
    (where / "zz.xlsx").write_bytes((where / "sweep.xlsx").read_bytes())
    (told,) = (one for one in reduced(where, published_record).findings if one.rule == "doubled")
    assert told.where == "zz.xlsx"
    assert "slip angle 0, 2, -2 deg" in told.message
    assert "6 block(s)" in told.message


def test_a_sweep_that_never_rests_is_refused(tmp_path: Path, published_record: CalibrationRecord) -> None:
    where = folder(tmp_path / "test", rest=PER_TURN // 2)
    with pytest.raises(RecordingError, match="does not rest") as caught:
        reduced(where, published_record)
    assert caught.value.rule == "no-rest"
    assert "drum revolutions" in str(caught.value.got)


def test_the_same_file_with_after_settling_is_told_to_be_none(
    tmp_path: Path, published_record: CalibrationRecord
) -> None:
    other = PROTOCOL.replace('"continuous"', '"after_settling"')
    found = reduced(folder(tmp_path / "test", protocol=other), published_record)
    assert "missing" in {one.rule for one in found.findings}


@pytest.mark.parametrize("scale", [1.0, 4.4482216])
def test_units_of_the_load_do_not_matter(scale: float) -> None:
    FZ = ramps([400.0, 800.0, 1200.0]) * scale
    rests = find_rests(
        SA=np.zeros(FZ.size), FZ=FZ, turns=np.arange(FZ.size) / PER_TURN, band_SA=0.01, band_FZ=0.1,
        floor_FZ=20.0 * scale, least_turns=1.0,
    )  # fmt: skip
    assert [rest.mean_FZ / scale for rest in rests] == pytest.approx([400.0, 800.0, 1200.0], rel=0.01)
    assert [rest.start for rest in rests] == pytest.approx([0, REST + MOVE, 2 * (REST + MOVE)], abs=3)


def test_a_lifted_wheel_rests_too() -> None:
    noise = np.random.default_rng(1).normal(0, 2.0, 200)
    rests = find_rests(
        SA=np.zeros(200), FZ=noise, turns=np.arange(200) / PER_TURN, band_SA=0.01, band_FZ=0.1,
        floor_FZ=20.0, least_turns=1.0,
    )  # fmt: skip
    assert len(rests) == 1
    assert rests[0].n >= 190
