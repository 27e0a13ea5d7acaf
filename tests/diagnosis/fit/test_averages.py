"""Rows are averaged where inputs carry noise that the recording does not have, and nowhere else."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from tests.diagnosis.cases import HEAD, write_case
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.averages import is_smooth, moved_by_inputs, noisy_inputs, rows_averaged
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.averaged import averaged, smoothed, windows
from toolkit.diagnosis.simulators.build_simulator import model_of

STEP = 0.005


def swept(
    seed: int, *, position_noise: float = 2e-5, coulomb: float = 0.0, mass: float = 95.0, rows: int = 1500
) -> pd.DataFrame:
    """Return a carriage swept from 0.5 to 2 Hz, the noise of its position in velocity and acceleration."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    phase = 2 * np.pi * (0.5 * t + 0.75 * t**2 / t[-1]) + seed
    rate = 2 * np.pi * (0.5 + 1.5 * t / t[-1])  # of the phase
    v = 0.05 * rate * np.cos(phase)
    a = 0.05 * (3 * np.pi / t[-1] * np.cos(phase) - rate**2 * np.sin(phase))
    noise_of_v = np.gradient(rng.normal(0, position_noise, rows), STEP)
    force = mass * a + 200 * v + coulomb * np.sign(v) + rng.normal(0, 2.0, rows)
    return pd.DataFrame({"t": t, "v": v + noise_of_v, "a": a + np.gradient(noise_of_v, STEP), "F": force})


def case_of(folder: Path, *frames: pd.DataFrame, toml: str = HEAD, simulator: str | None = None) -> Case:
    """Return the case of some recordings."""
    runs = "".join(f'[[recording.run]]\nfile = "r{k}.csv"\n' for k in range(len(frames)))
    files: dict[str, object] = {"r1__csv": None} | {f"r{k}__csv": frame for k, frame in enumerate(frames)}
    more = {} if simulator is None else {"simulator": simulator}
    return read_case(write_case(folder, toml + runs, **files, **more))


def rows_of(case: Case) -> int:
    problem = problem_of(case, model_of(case, None))
    return rows_averaged(problem, problem.simulate([parameter.value for parameter in problem.free], ()))


def test_a_velocity_from_a_noisy_position_names_nothing_and_moves_no_parameter(tmp_path: Path) -> None:
    case = case_of(tmp_path, *(swept(seed) for seed in range(3)))
    answer = diagnose(case, None).diagnosis
    assert (answer.verdict, answer.effects) == ("nothing", ())
    for parameter, true in zip(answer.nominal_parameters, (95.0, 200.0), strict=True):
        assert parameter.after == pytest.approx(true, rel=0.01)
    (told,) = [finding for finding in answer.findings if finding.rule == "case-averaged"]
    assert re.search(r"averaged by \d+, over 0\.\d+ s", told.message)


def test_dry_friction_beside_noisy_inputs_is_named_with_its_size(tmp_path: Path) -> None:
    answer = diagnose(case_of(tmp_path, *(swept(seed, coulomb=20.0) for seed in range(2))), None).diagnosis
    assert [effect.name for effect in answer.effects] == ["coulomb_friction"]
    size = next(p for p in answer.effects[0].parameters if p.name == "coulomb")
    assert size.value == pytest.approx(20.0, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_inputs_without_noise_keep_every_row(tmp_path: Path, seed: int) -> None:
    assert (
        rows_of(case_of(tmp_path, swept(seed, position_noise=0.0), swept(seed + 9, position_noise=0.0))) == 1
    )


@pytest.mark.parametrize("change", ["sign", "lag", "delay", "half", "clipped"])
def test_a_defect_of_the_output_is_no_noise_of_the_inputs(tmp_path: Path, change: str) -> None:
    """A rich input, every frequency in it: what the output has lost of it is what is looked for."""
    rng = np.random.default_rng(4)
    frames = []
    for _ in range(2):
        t = np.arange(1500) * STEP
        v, a = 0.2 * rng.normal(size=1500), 0.3 * rng.normal(size=1500)
        force = 95 * a + 200 * v
        force = {
            "sign": -force, "half": force / 2, "clipped": np.clip(force, -30, 30),
            "lag": lfilter([0.2], [1, -0.8], force), "delay": np.concatenate([np.zeros(3), force[:-3]]),
        }[change]  # fmt: skip
        frames.append(pd.DataFrame({"t": t, "v": v, "a": a, "F": force + rng.normal(0, 1.0, 1500)}))
    assert rows_of(case_of(tmp_path, *frames)) == 1


def test_an_unsigned_output_is_no_noise_of_the_inputs(tmp_path: Path) -> None:
    frames = [swept(seed, position_noise=0.0) for seed in range(2)]
    assert rows_of(case_of(tmp_path, *(frame.assign(F=frame["F"].abs()) for frame in frames))) == 1


def test_a_limit_of_the_output_is_no_noise_of_the_inputs(tmp_path: Path) -> None:
    """A turbine's power ends where its text-book cube goes on, and most of the cube's changes with it."""
    frames = []
    for seed in range(2):
        rng = np.random.default_rng(seed)
        wind = 9 + 4 * lfilter([0.3], [1, -0.95], rng.normal(size=900))
        cube = 2.5 * np.clip(wind, 3, None) ** 3
        power = np.minimum(cube, 1500) + rng.normal(0, 20, 900)
        frames.append(pd.DataFrame({"t": np.arange(900) * STEP, "v": wind, "a": 0 * wind, "F": power}))
    assert rows_of(case_of(tmp_path, *frames, simulator=TURBINE)) == 1


TURBINE = """
import numpy as np, pandas as pd
def simulate(inputs, p):
    return pd.DataFrame({"F": 2.5 * np.clip(inputs["v"], 3, None) ** 3})
"""

CIRCUIT = """
import numpy as np, pandas as pd
def simulate(inputs, p):
    e, y = inputs["v"].to_numpy(), np.zeros(len(inputs))
    for i in range(1, len(e)):
        y[i] = e[i] + (y[i - 1] - e[i]) * np.exp(-0.005 / p["c"])
    return pd.DataFrame({"F": y + 0 * p["mass"] * inputs["a"]})
"""


@pytest.mark.parametrize("noise_of_input", [0.0, 1e-3])
def test_an_input_that_moves_by_steps_has_no_noise_whatever_is_missing(
    tmp_path: Path, noise_of_input: float
) -> None:
    """A rectified answer follows the simulation by half: the steps of the input are known to every row."""
    frames = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        e = np.repeat(rng.normal(0, 2.0, 60), 12)
        y = np.zeros(len(e))
        for i in range(1, len(e)):
            y[i] = e[i] + (y[i - 1] - e[i]) * np.exp(-0.005 / 0.026)
        t, F = STEP * np.arange(len(e)), np.abs(y) + rng.normal(0, 0.1, len(e))
        frames.append(
            pd.DataFrame({"t": t, "v": e + rng.normal(0, noise_of_input, len(e)), "a": 0 * e, "F": F})
        )
    toml = HEAD.replace("value = 210.0", "value = 0.025")
    assert rows_of(case_of(tmp_path, *frames, toml=toml, simulator=CIRCUIT)) == 1


def test_quick_changes_that_stay_without_an_inputs_noise_are_not_its(tmp_path: Path) -> None:
    """Smooth inputs move a simulation by what the recording lacks: that is physics, which no mean shows."""
    case = case_of(tmp_path, *(swept(seed) for seed in range(2)))
    even = smoothed(case, 16, noisy_inputs(case))
    problem, smooth = (problem_of(each, model_of(each, None)) for each in (case, even))
    values = [parameter.value for parameter in problem.free]
    recorded, without_noise = problem.simulate(values, ()), smooth.simulate(values, ())
    assert moved_by_inputs(problem, recorded, without_noise, 16)
    ripple = 40 * np.sin(2 * np.pi * 60 * np.arange(problem.rows) * STEP)
    other = {name: column + ripple for name, column in without_noise.items()}
    assert not moved_by_inputs(problem, other, without_noise | {"F": other["F"]}, 16)


def test_a_case_without_inputs_has_no_noise_of_inputs(tmp_path: Path) -> None:
    frames = [swept(seed).rename(columns={"a": "S"}).drop(columns="v") for seed in range(2)]
    toml = """schema = 1
[simulation]
kind = "columns"
simulated = { F = "S" }
[recording]
time = "t"
[recording.channels]
t = { unit = "s", role = "time" }
F = { unit = "N", role = "output" }
"""
    assert rows_of(case_of(tmp_path, *frames, toml=toml)) == 1


def test_an_angle_that_wraps_is_never_averaged(tmp_path: Path) -> None:
    toml = HEAD.replace("F = {", 'turn = { unit = "deg", role = "covariate" }\nF = {')
    frames = [frame.assign(turn=(400 * frame["t"]) % 360) for frame in (swept(0), swept(1))]
    assert rows_of(case_of(tmp_path, *frames, toml=toml)) == 1
    grows = [frame.assign(turn=400 * frame["t"]) for frame in frames]
    assert rows_of(case_of(tmp_path / "grows", *grows, toml=toml)) > 1


def test_rows_without_a_clock_are_never_averaged(tmp_path: Path) -> None:
    toml = HEAD.replace('time = "t"\n', "").replace('t = { unit = "s", role = "time" }\n', "")
    assert rows_of(case_of(tmp_path, swept(0), swept(1), toml=toml)) == 1
    rng = np.random.default_rng(0)
    uneven = [frame.assign(t=np.sort(rng.uniform(0, 7.5, len(frame)))) for frame in (swept(0), swept(1))]
    assert rows_of(case_of(tmp_path / "uneven", *uneven)) == 1


@pytest.mark.campaign(
    "whole diagnoses by a gear that is looked up: what steps is never averaged in every run"
)
@pytest.mark.parametrize("shifts", ["once", "all the time"])
def test_a_simulator_that_takes_its_inputs_for_numbers_is_given_them(tmp_path: Path, shifts: str) -> None:
    """A gear that is looked up has no mean: where it has no noise it is none of what is smoothed.

    One that looks like noise is smoothed, and the simulation does not take it: then the rows stay.
    """
    looked_up = """
import pandas as pd
def simulate(inputs, p):
    ratio = inputs["gear"].map({1.0: 1.0, 2.0: 0.5})
    return pd.DataFrame({"F": ratio * (p["mass"] * inputs["a"] + p["c"] * inputs["v"])})
"""
    toml = HEAD.replace("F = {", 'gear = { unit = "1", role = "input" }\nF = {')
    frames = []
    rng = np.random.default_rng(1)
    for frame in (swept(0), swept(1)):
        gear = np.where(frame["t"] < 4, 1.0, 2.0)
        if shifts == "all the time":
            gear = rng.integers(1, 3, len(frame)).astype(float)
        frames.append(frame.assign(gear=gear, F=frame["F"] * np.where(gear == 1.0, 1.0, 0.5)))
    case = case_of(tmp_path, *frames, toml=toml, simulator=looked_up)
    assert rows_of(case) > 1
    told = {one.rule for one in diagnose(case, None, budget_s=30).diagnosis.findings}
    assert ("case-averaged" in told) is (shifts == "once")


def test_a_simulation_that_bends_within_a_mean_is_not_that_of_means(tmp_path: Path) -> None:
    bending = """
import numpy as np, pandas as pd
def simulate(inputs, p):
    force = p["mass"] * inputs["a"] + p["c"] * inputs["v"]
    return pd.DataFrame({"F": 60 * np.tanh(force / 20)})
"""
    frames = [frame.assign(F=60 * np.tanh(frame["F"] / 20)) for frame in (swept(0), swept(1))]
    case = case_of(tmp_path, *frames, simulator=bending)
    problem = problem_of(case, model_of(case, None))
    values = [parameter.value for parameter in problem.free]
    simulated = problem.simulate(values, ())
    even = smoothed(case, 16, ("v", "a"))
    smooth = problem_of(even, model_of(even, None))
    assert not is_smooth(problem, simulated, smooth.simulate(values, ()), 16)


def test_means_hold_no_gap_and_skip_missing_samples(tmp_path: Path) -> None:
    """A straight line is its own mean, wherever rows are missing; a window never spans a gap."""
    t = np.concatenate([np.arange(200), 1000 + np.arange(200)]) * STEP
    frame = pd.DataFrame({"t": t, "v": 3 * t + 1, "a": 0 * t, "F": 2 - t})
    frame.loc[50:52, "F"] = np.nan
    frame.loc[300:340, "F"] = np.nan
    toml = HEAD.replace(
        'F = { unit = "N", role = "output" }', 'F = { unit = "N", role = "output", sd = 8.0 }'
    )
    case = averaged(case_of(tmp_path, frame, toml=toml), 4)
    (run,) = case.runs
    # By hand: inputs are smoothed by (2 x 4 + 4.6) / 3.2 = 4 rows to each side, which are left at both ends;
    # of 192 rows in windows of 8, one every 4, there are 47 in each half.
    assert run.rows == 94
    assert run.columns["v"] == pytest.approx(3 * run.t + 1)
    assert run.t[0] == pytest.approx((4 + 3.5) * STEP)
    assert np.diff(run.t)[46] > 4.0
    assert np.delete(np.diff(run.t), 46) == pytest.approx(4 * STEP)
    there = np.isfinite(run.columns["F"])
    assert 70 < there.sum() < 94
    assert (run.columns["F"] - (2 - run.t))[there] == pytest.approx(0.0, abs=2 * STEP)
    # The stated noise of a mean is that of white noise in the window, drawn.
    rows = read_case(tmp_path / "CASE.toml")
    white = np.random.default_rng(1).normal(0, 8.0, (400, 4000))
    assert case.channel("F").sd == pytest.approx(windows(rows, rows.runs[0], 4).mean(white).std(), rel=0.01)


BETWEEN = pytest.mark.campaign("a number of rows between the least and the most that are held in every run")


@pytest.mark.parametrize("rows", [1, pytest.param(5, marks=BETWEEN), pytest.param(12, marks=BETWEEN), 40])
def test_a_run_too_short_for_means_is_left_out_and_told(tmp_path: Path, rows: int) -> None:
    answer = diagnose(case_of(tmp_path, swept(0), swept(1), swept(2).iloc[:rows]), None).diagnosis
    assert answer.verdict == "nothing"
    told = [finding for finding in answer.findings if finding.rule == "case-averaged"]
    assert [finding.where for finding in told] == ["CASE.toml", "r2.csv"]


LONGER = pytest.mark.campaign("longer runs: the shortest, of which least is left, hold in every run")


@pytest.mark.parametrize("rows", [70, *(pytest.param(rows, marks=LONGER) for rows in (120, 200))])
def test_many_short_runs_are_averaged_over_fewer_rows(tmp_path: Path, rows: int) -> None:
    runs = [swept(seed).iloc[k : k + rows] for seed in range(3) for k in range(0, 1200 - rows, 300)]
    answer = diagnose(case_of(tmp_path, *runs), None).diagnosis
    assert not answer.effects
    assert "case-averaged" in {finding.rule for finding in answer.findings}


def test_a_value_far_off_is_in_no_mean(tmp_path: Path) -> None:
    frames = [swept(0), swept(1)]
    frames[1].loc[700, "F"] = 1e6
    (answer, clean) = (
        diagnose(case_of(tmp_path / name, *each), None).diagnosis
        for name, each in (("far", frames), ("clean", (swept(0), swept(1))))
    )
    assert "case-averaged" in {finding.rule for finding in answer.findings}
    assert answer.verdict == clean.verdict == "nothing"
    assert answer.fit.held_out[0].refitted_rmse == pytest.approx(
        clean.fit.held_out[0].refitted_rmse, rel=0.05
    )


def test_a_run_that_was_recorded_more_slowly_is_averaged_over_fewer_rows(tmp_path: Path) -> None:
    slow = swept(1).iloc[::2]
    quick, slower = averaged(case_of(tmp_path, swept(0), slow), 8).runs
    assert np.diff(quick.t) == pytest.approx(8 * STEP)
    assert quick.file_rows is not None  # a mean lies in the middle of its rows
    assert quick.file_rows.mean(axis=1) * STEP == pytest.approx(quick.t - swept(0)["t"].iloc[0])
    assert np.diff(slower.t) == pytest.approx(8 * STEP)
