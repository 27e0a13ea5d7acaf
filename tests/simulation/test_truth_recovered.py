"""The whole path on the virtual machine, with all its defaults, judged against the truth beside it."""

import json
from pathlib import Path

import pytest

import toolkit
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.pipeline import process, read_test
from toolkit.recording.folder import read_test_folder
from toolkit.simulation.plan import read_plan
from toolkit.simulation.program import program_from
from toolkit.simulation.run import simulate
from toolkit.simulation.session import simulate_session
from toolkit.simulation.write import write_session, write_test

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    session = write_session(simulate_session(read_plan(EXAMPLES / "session_plan.toml")), folder / "session")
    (folder / "calibrations").mkdir()
    record = calibrate(session[0], Registry(folder / "calibrations")).record
    write_test(simulate(read_plan(EXAMPLES / "test_plan.toml"), program_from(record)), folder / "test")
    test = read_test_folder(folder / "test")
    truth = json.loads((folder / "test" / "truth.json").read_text(encoding="utf-8"))
    return process(test, read_test(test), record), truth


def test_every_condition(judged):
    result, truth = judged
    true = {(b["file"], b["first_row"]): b for b in truth["conditions"]}
    assert len(result.reduced.conditions) == len(true) == 130
    for one in result.reduced.conditions:
        block = true[one.file, one.first_row]
        turn = 1 if block["rotation"] == "forward" else -1
        assert one.rotation == block["rotation"]
        assert one.SA == pytest.approx(block["SA_rad"], abs=3e-5)
        assert one.FZ == pytest.approx(block["FZ_N"], abs=1.5)
        # 0.1 % and 2 N: calibration, noise, and 20 N of run-out that the filter delays by 0.08 rad
        assert one.FY == pytest.approx(turn * block["FY_N"], rel=1e-3, abs=2.0)
        assert one.MZ == pytest.approx(block["MZ_Nm"], rel=1e-3, abs=0.1)


def test_pull(judged):
    result, truth = judged
    rooms = {"conicity": 3.0, "plysteer": 4.0, "CRAT": 0.15, "PRAT": 0.2, "PRAT_at_FY_zero": 0.2}
    for name, room in rooms.items():
        rows = result.characteristics.of(name)
        assert len(rows) == 5
        for row, true in zip(rows, truth["per_load"], strict=True):
            at = true["at_median"]
            assert row.load_N == pytest.approx(at["load_N"], rel=2e-3)
            assert row.estimate.value == pytest.approx(at["pull"][name], abs=room)


def test_stiffness(judged):
    result, truth = judged
    true = {
        (i, s["rotation"]): s
        for i, load in enumerate(truth["per_load"])
        for s in load["at_median"]["stiffness"]
    }
    for name, room in (("slope_cornering", 0.02), ("slope_aligning", 0.03)):
        rows = result.characteristics.of(name)
        assert len({row.load_N for row in rows}) >= 5
        for row in rows:
            step = min(range(5), key=lambda i: abs(truth["per_load"][i]["at_median"]["load_N"] - row.load_N))
            assert row.estimate.value == pytest.approx(true[step, row.rotation][name], rel=room)
