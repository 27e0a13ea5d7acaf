"""A table without a time: its answer does not hang on how somebody has sorted its rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import CELL, write_case
from toolkit.diagnosis.case.case import Case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.noise import fit_noise
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.fit.row_order import by_inputs, dealt, seed_of
from toolkit.diagnosis.search.candidates import candidates
from toolkit.diagnosis.simulators.build_simulator import model_of

TABLE = case_text(
    "python", time=None, parameters={"gain": (1.0, "1", 0.05)}, inputs={"L": "N"}, outputs={"F": "N"}
)
LOADS = np.linspace(5.0, 100.0, 36)


def opened(folder: Path, *tables: pd.DataFrame, simulator: str = CELL, case: str = TABLE) -> Case:
    files: dict[str, object] = {"r0__csv": None, "r1__csv": None}
    for k, table in enumerate(tables):
        files[f"r{k}__csv"] = table
        case += f'[[recording.run]]\nfile = "r{k}.csv"\n'
    return read_case(write_case(folder, case, simulator=simulator, **files))


def table(loads: np.ndarray, force: Callable[[np.ndarray], np.ndarray] = lambda L: 1.01 * L) -> pd.DataFrame:
    noise = np.random.default_rng(3).normal(0, 0.05, len(loads))
    return pd.DataFrame({"L": loads, "F": np.round(force(loads) + noise, 3)})


def bent(loads: np.ndarray) -> np.ndarray:
    return np.asarray(loads + 2e-3 * loads**2)


def ways(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return a table sorted, turned round and shuffled."""
    return {
        "sorted": rows,
        "reversed": rows[::-1],
        "shuffled": rows.sample(frac=1, random_state=1),
    }


def test_the_draws_are_those_of_the_readings(tmp_path: Path) -> None:
    seeds = []
    for name, rows in ways(table(LOADS)).items():
        ordered = by_inputs(case := opened(tmp_path / name, rows))
        assert ordered is not None
        (run,), (as_filed,) = ordered[0].runs, case.runs
        assert run.file_rows is not None
        for channel, column in run.columns.items():  # each row is known by where it stands in the file
            assert column == pytest.approx(as_filed.columns[channel][run.file_rows[:, 0]])
        seeds.append(seed_of(ordered[0]))
        assert seed_of(case) == int(case.sha256[:12], 16)  # of rows that have an order
    assert len(set(seeds)) == 1
    changed = by_inputs(opened(tmp_path / "changed", table(LOADS, bent)))
    assert changed is not None
    assert seed_of(changed[0]) not in seeds


@pytest.mark.parametrize("force", [bent, lambda L: 1.01 * L])
def test_the_answer_is_that_of_the_readings(tmp_path: Path, force: Callable[..., np.ndarray]) -> None:
    answers = []
    for name, rows in ways(table(LOADS, force)).items():
        answer = diagnose(opened(tmp_path / name, rows), None).diagnosis
        numbers = [parameter.value for effect in answer.effects for parameter in effect.parameters]
        (errors,) = answer.fit.held_out
        assert errors.noise is not None
        left = [errors.refitted_rmse, errors.augmented_rmse, errors.noise.sensor_sd]
        names = [(effect.name, *effect.equivalent_to) for effect in answer.effects]
        answers.append((answer.verdict, names, [law.formula for law in answer.laws], [*numbers, *left]))
    first = answers[0]
    assert all(answer[:3] == first[:3] for answer in answers)
    assert all(answer[3] == pytest.approx(first[3], rel=1e-6) for answer in answers)
    if force is bent:
        assert "nonlinearity" in first[1][0]
        assert "hysteresis" not in first[1][0]
    else:
        assert first[0] == "nothing"


def test_readings_in_any_order_are_one_case(tmp_path: Path) -> None:
    found = {name: by_inputs(opened(tmp_path / name, rows)) for name, rows in ways(table(LOADS)).items()}
    columns = []
    for readings in found.values():
        assert readings is not None
        assert not readings[0].has_order
        columns.append([readings[0].runs[0].columns[name] for name in ("L", "F")])
    assert np.array_equal(columns[0], columns[1])
    assert np.array_equal(columns[0], columns[2])


def test_readings_of_the_same_load_have_one_order_that_is_not_their_size(tmp_path: Path) -> None:
    """Sorted by what was read, neighbours would be nearer than any noise."""
    rows = table(np.repeat(LOADS[::3], 6))
    readings = [by_inputs(opened(tmp_path / name, each)) for name, each in ways(rows).items()]
    forces = [each[0].runs[0].columns["F"] for each in readings if each is not None]
    assert len(forces) == 3
    assert all(np.array_equal(force, forces[0]) for force in forces)
    steps = np.diff(forces[0].reshape(-1, 6), axis=1)
    assert 0.3 < (steps > 0).mean() < 0.7


@pytest.mark.parametrize(
    "loads",
    [
        np.concatenate([LOADS[::3], LOADS[::-3]]),  # up and down
        np.concatenate([np.repeat(LOADS[::5], 3), np.repeat(LOADS[::-5], 3)]) + 0.01 * np.sin(np.arange(48)),
    ],
)
def test_loads_that_go_up_and_down_have_an_order(tmp_path: Path, loads: np.ndarray) -> None:
    case = opened(tmp_path, table(loads))
    assert by_inputs(case) is None
    assert "hysteresis" in {each.name for each in candidates(problem_of(case, model_of(case, None, None)))}


def test_one_run_up_and_one_down_have_an_order(tmp_path: Path) -> None:
    up, down = table(LOADS[::2]), table(LOADS[::-2])
    assert by_inputs(opened(tmp_path / "both", up, down)) is None
    assert by_inputs(opened(tmp_path / "up", up, table(1.001 * LOADS[::2]))) is not None


def test_a_grid_that_begins_anew_has_no_order(tmp_path: Path) -> None:
    """Ten loads, five times: back to the first in one step is no way down."""
    assert by_inputs(opened(tmp_path, table(np.tile(LOADS[::4], 5)))) is not None


def test_shuffled_loads_hardly_ever_go_up_and_down(tmp_path: Path) -> None:
    case = opened(tmp_path, table(LOADS))
    (run,), taken = case.runs, 0
    for seed in range(300):
        L = np.random.default_rng(seed).permutation(LOADS)
        taken += by_inputs(replace(case, runs=(replace(run, columns={**run.columns, "L": L}),))) is None
    assert taken <= 9  # of a chance of one in a hundred: 3 +- 1.7


def test_a_simulation_that_remembers_its_rows_keeps_their_order(tmp_path: Path) -> None:
    simulator = CELL.replace('inputs["L"]', '(inputs["L"] + 0.01 * inputs["L"].cumsum())')
    loads = np.random.default_rng(2).permutation(LOADS)
    case = opened(tmp_path, table(loads, lambda L: L + 0.01 * np.cumsum(L)), simulator=simulator)
    assert by_inputs(case) is not None  # by its inputs alone it would have none
    result = diagnose(case, None)
    assert result.diagnosis.verdict == "nothing"
    assert result.search is not None
    assert result.search.problem.case.has_order


def test_time_is_an_order(tmp_path: Path) -> None:
    case = TABLE.replace("[recording]\n", '[recording]\ntime = "t"\n')
    case += 't = { unit = "s", role = "time" }\n'
    assert by_inputs(opened(tmp_path, table(LOADS).assign(t=np.arange(36.0)), case=case)) is None


def test_without_an_order_no_reading_foretells_the_next_and_nothing_remembers(tmp_path: Path) -> None:
    readings = by_inputs(opened(tmp_path, table(LOADS)))
    assert readings is not None
    problem = problem_of(readings[0], model_of(readings[0], None, None))
    where = problem.layout("F")
    assert where.n == 36
    smooth = np.sin(LOADS / 20)
    assert fit_noise(smooth, where, floor=1e-9).reflection == ()
    assert not {"hysteresis", "backlash"} & {each.name for each in candidates(problem)}


def test_held_out_groups_lie_between_others() -> None:
    loads = np.repeat(np.arange(40.0), 2)
    parts = dealt(slice(10, 90), [np.concatenate([np.zeros(10), loads])], 5)
    assert np.array_equal(np.sort(np.concatenate(parts)), np.arange(10, 90))
    for part in parts:
        held = loads[part - 10]
        assert sorted(held) == sorted([*set(held)] * 2)  # readings of one load stay together
        inner = [load for load in set(held) if 2 < load < 37]
        others = set(loads) - set(held)
        assert all(any(0 < o - x <= 3 for o in others) and any(0 < x - o <= 3 for o in others) for x in inner)
    # Of few different loads a part is one group.
    assert all(np.all(np.diff(part) == 1) for part in dealt(slice(0, 12), [np.arange(12.0)], 5))
