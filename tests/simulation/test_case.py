"""A case made of a virtual test: it reads back, says nothing of effects, and its null is one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import toolkit
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.errors import ConfigError
from toolkit.simulation.case import write_case, write_runs
from toolkit.simulation.cells import CELLS
from toolkit.simulation.plan import read_plan, with_effects
from toolkit.simulation.plan_file import CaseParameter, CasePlan
from toolkit.simulation.run import simulate

EXAMPLES = Path(toolkit.__file__).parent / "examples" / "virtual"
CALIBRATIONS = Path(toolkit.__file__).parents[1] / "calibrations"


def quiet(plan):
    cells = {name: dataclasses.replace(getattr(plan.cells, name), noise_V_V=0.0) for name in CELLS}
    return dataclasses.replace(
        plan,
        cells=dataclasses.replace(plan.cells, **cells),
        acquisition=dataclasses.replace(plan.acquisition, FZ_noise_N=0.0, SA_noise_rad=0.0, negated=()),
    )


@pytest.fixture(scope="module")
def plan():
    read = quiet(read_plan(EXAMPLES / "continuous_plan.toml"))
    runs = tuple(
        dataclasses.replace(run, slip_angles_rad=(0.05, -0.1), extra=(("order", str(i)),))
        for i, run in enumerate((*read.runs[:2], *read.runs[6:]), start=1)
    )
    return dataclasses.replace(read, runs=runs)


def residuals(case, calibrations=None):
    """Outputs as recorded less the case's own simulation, with nothing switched on."""
    model = model_of(case, calibrations)
    p = {one.name: one.value for one in model.parameters}
    found = {}
    for run in case.runs:
        made, seen = model.simulate(run, p, ()), model.observed(run)
        for name, values in made.items():
            found.setdefault(name, []).append(seen[name] - values)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def test_a_machine_case_is_its_own_null(plan, tmp_path):
    """Without noise and effects the case's simulation gives the recording within the digits of the CSV."""
    case = read_case(write_case(simulate(plan), tmp_path)[0])
    left = residuals(case)
    # SA in 1e-6 deg at up to 65 kN/rad: 6e-4 N; FZ in 1e-4 N; cells of 7 digits go nowhere in the CSV
    assert np.abs(left["FY"]).max() < 2e-3
    assert np.abs(left["MZ"]).max() < 1e-4
    assert [run.conditions["rotation"] for run in case.runs] == ["forward", "reverse", "forward", "reverse"]
    assert [run.conditions["mounting"] for run in case.runs] == ["normal", "normal", "turned", "turned"]
    assert [run.conditions["order"] for run in case.runs] == ["1", "2", "3", "4"]
    starts = [run.t[0] for run in case.runs]
    assert starts == sorted(starts)


def test_a_case_of_cells_is_its_own_null_by_the_record(plan, tmp_path):
    """m15-virtual-r1 was fitted from reference loads known to 0.4 N: parts in 1e4 of its forces."""
    cells = dataclasses.replace(plan, case=CasePlan(outputs="cells"))
    case = read_case(write_case(simulate(cells), tmp_path, record="m15-virtual-r1")[0])
    assert case.runs[0].conditions["phase"] == "tare"
    left = residuals(case, CALIBRATIONS)
    assert np.abs(left["FY"]).max() < 3.0
    assert np.abs(left["MZ"]).max() < 0.1


def test_a_published_tire_makes_a_case_of_columns(virtual_plan, tmp_path):
    short = dataclasses.replace(quiet(virtual_plan), slip_angles_rad=(0.0, 0.05, -0.1))
    path = write_case(simulate(short), tmp_path)[0]
    case = read_case(path)
    assert case.simulation.kind == "columns"
    left = residuals(case)
    # Cells pass a filter of 0.05 s, the load does not: run-out of 20 N at 1.57 rad/s, 5 N at twice that
    assert np.abs(left["FY"]).max() < (20.0 * 1.573 + 5.0 * 3.15) * 0.05 + 0.5
    assert not (tmp_path / "tire.tir").exists()


def test_no_word_of_an_effect(plan, tmp_path):
    """The effect is in the recording, and neither its name nor its size is anywhere in the folder."""
    test = simulate(with_effects(plan, ["relaxation=0.4137m", "zero_offset.D51=0.0123mV/V"]))
    text = "".join(path.read_text() for path in write_case(test, tmp_path))
    for word in ("relaxation", "offset", "0.4137", "0.0123", "effect"):
        assert word not in text.lower()
    assert not list(tmp_path.rglob("truth*"))


def test_parameters_and_columns_of_the_plan(plan, tmp_path):
    free = CaseParameter(name="LMUY", value=1.0, unit="1", sd=0.02, bounds=(0.8, 1.2))
    wanted = dataclasses.replace(
        plan, case=CasePlan(columns=("DRUM_ANGLE",), load="judged", parameters=(free,))
    )
    case = read_case(write_case(simulate(wanted), tmp_path)[0])
    assert {one.name: one.role for one in case.channels} == {
        "t": "time", "SA": "input", "FZ_CMD": "input", "DRUM_ANGLE": "covariate", "FZ": "output",
        "FY": "output", "MZ": "output",
    }  # fmt: skip
    assert [(one.name, one.sd, one.bounds) for one in case.parameters] == [("LMUY", 0.02, (0.8, 1.2))]


def test_columns_that_never_vary_are_left_out(plan, tmp_path):
    case = read_case(write_case(simulate(plan), tmp_path)[0])
    assert {one.name for one in case.channels} == {
        "t", "SA", "FZ", "TIRE_ANGLE", "DRUM_ANGLE", "T_TREAD", "FY", "MZ",
    }  # fmt: skip


@pytest.mark.parametrize(
    "case",
    [CasePlan(outputs="cells"), CasePlan(load="commanded"),
     CasePlan(parameters=(CaseParameter(name="LMUY", value=1.0, unit="1", sd=None, bounds=None),))],
)  # fmt: skip
def test_what_a_published_tire_cannot_be(virtual_plan, tmp_path, case):
    short = dataclasses.replace(virtual_plan, slip_angles_rad=(0.0,), case=case)
    with pytest.raises(ConfigError, match="no case can be made") as caught:
        write_case(simulate(short), tmp_path / "case")
    assert caught.value.next_step
    assert not (tmp_path / "case").exists()


def test_cells_need_a_record(plan, tmp_path):
    cells = dataclasses.replace(plan, case=CasePlan(outputs="cells"))
    with pytest.raises(ConfigError, match="no case can be made"):
        write_case(simulate(cells), tmp_path / "case")


def test_all_columns_as_csv(plan, tmp_path):
    test = simulate(plan)
    paths = write_runs(test, tmp_path)
    header = paths[0].read_text().splitlines()[0].split(",")
    assert header[:8] == ["t", "SA", "FZ", "D51", "D52", "E5", "FY", "MZ"]
    data = np.loadtxt(paths[0], delimiter=",", skiprows=1)
    np.testing.assert_allclose(np.radians(data[:, 1]), test.files[0].signals["SA"], atol=1e-8)
    assert len(paths) == 4


def test_titles_with_quotes_are_still_toml(plan, tmp_path):
    odd = dataclasses.replace(plan, title='a "tire" \\ on 1\u00b0 \u2603')
    case = read_case(write_case(simulate(odd), tmp_path)[0])
    assert case.title == odd.title
