"""Moves, commands and blocks of a recording; dwell and continuous; the plan's runs."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path

import numpy as np
import pytest

import toolkit
from toolkit.errors import ToolkitError
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording
from toolkit.simulation import timeline
from toolkit.simulation.plan import read_plan
from toolkit.simulation.run import simulate
from toolkit.simulation.steps import RunSteps
from toolkit.simulation.write import write_test

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"


@pytest.fixture(scope="module")
def plan():
    return read_plan(EXAMPLES / "continuous_plan.toml")


def line(plan, **changed):
    run = RunSteps(
        **{"rotation": "forward", "slip_angles_rad": (0.1, -0.1), "loads_N": (2000.0, 5000.0)} | changed
    )
    return timeline.continuous(plan, run, np.random.default_rng(1))


def test_commands_move_at_the_rates_of_rack_and_actuator(plan):
    made = line(plan, steer_rate_rad_s=0.05, load_rate_N_s=1500.0, dwell_s=2.0)
    assert np.abs(np.diff(made.SA_CMD)).max() == pytest.approx(0.05 * made.dt, rel=1e-9)
    assert np.abs(np.diff(made.FZ_CMD)).max() == pytest.approx(1500.0 * made.dt, rel=1e-9)
    assert (made.SA_CMD[0], made.FZ_CMD[0]) == (0.0, 2000.0)
    assert (made.SA_CMD.max(), made.SA_CMD.min(), made.FZ_CMD.max()) == (0.1, -0.1, 5000.0)
    # A dwell of 2 s after each: 0.1 rad at 0.05 rad/s, 3000 N at 1500 N/s, 0.2 rad (the load goes back
    # meanwhile), 3000 N again.
    turn = made.dt * plan.acquisition.rows_per_revolution
    assert made.t[-1] == pytest.approx(turn + 2 * (2.0 + 2.0) + (4.0 + 2.0) + (2.0 + 2.0), abs=made.dt)
    assert np.ptp(np.diff(made.t)) < 1e-9
    assert made.recorded.all()


def test_blocks_are_at_rest_at_their_steps(plan):
    made = line(plan, outer="load", dwell_s=1.5)
    assert [(b.step_SA_rad, b.step_FZ_N) for b in made.blocks] == [
        (0.1, 2000.0), (-0.1, 2000.0), (0.1, 5000.0), (-0.1, 5000.0),
    ]  # fmt: skip
    for block in made.blocks:
        rows = slice(block.start, block.stop)
        np.testing.assert_allclose(made.SA_CMD[rows], block.step_SA_rad, atol=1e-12)
        np.testing.assert_allclose(made.FZ_CMD[rows], block.step_FZ_N, atol=1e-9)
        assert block.stop - block.start == plan.acquisition.rows_per_revolution


def test_another_speed_another_interval(plan):
    slow, fast = line(plan), line(plan, speed_m_s=2 * plan.machine.drum.speed_m_s)
    assert fast.dt == pytest.approx(slow.dt / 2)


def test_a_dwell_file_is_what_it_was_before_the_chain_knew_time(virtual_plan):
    """The digits of a file of 7 significant places, whose making has no effect and no lag in it."""
    short = dataclasses.replace(virtual_plan, slip_angles_rad=(0.0,), rotations=("forward",))
    columns = simulate(short).files[0].columns
    text = ";".join(",".join(f"{v:.6g}" for v in columns[name][::25].tolist()) for name in sorted(columns))
    assert hashlib.sha256(text.encode()).hexdigest() == DWELL


# Of the released machine, before moves were simulated; FM_run_1.xlsx of the packaged plan was the same, byte
# for byte.
DWELL = "665b90999cc0ac80feea7043d793100c57f5ad4421cf69a752456aab635d1d6b"


def test_a_continuous_recording_has_its_columns_in_the_machines_own_file(plan, tmp_path):
    small = dataclasses.replace(plan, runs=plan.runs[4:5], slip_angles_rad=(0.05,))
    test = simulate(small)
    write_test(test, tmp_path / "t")
    back = read_recording(tmp_path / "t" / "FM_run_1.xlsx", load_machine("m15-virtual"))
    signals = test.files[0].signals
    for name in ("t", "SA_CMD", "FZ_CMD", "V", "TIRE_ANGLE", "DRUM_ANGLE", "T_TREAD", "T_AMBIENT", "P_INFL"):
        np.testing.assert_allclose(back[name].si, signals[name], rtol=1e-6, atol=1e-3)
    assert back.simulated
    assert np.all(np.diff(back["t"].values) > 0)
    assert np.allclose(back["V"].values, 15.0)


def test_runs_of_a_plan(plan):
    assert len(plan.recordings) == 8
    assert [run.mounting for run in plan.recordings[-2:]] == ["turned", "turned"]
    assert plan.recordings[0].conditions == {"rotation": "forward", "mounting": "normal"}
    protocol = read_plan(EXAMPLES / "test_plan.toml")
    assert len(protocol.recordings) == 26
    assert all(len(run.steps) == 5 for run in protocol.recordings)


@pytest.mark.parametrize("record", ["dwell", "continuous"])
def test_a_recording_longer_than_a_sheet_is_refused_before_it_is_made(plan, record):
    endless = dataclasses.replace(plan, record=record, runs=(dataclasses.replace(plan.runs[0], dwell_s=1e9),))
    with pytest.raises(ToolkitError, match="too long") as caught:
        simulate(endless)
    assert caught.value.next_step
