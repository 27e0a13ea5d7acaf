"""Kind machine: cells and the program's own FY, records by id and by path, the machine's numbers."""

import hashlib

import numpy as np
import pandas as pd
import pytest

from tests.conftest import EXAMPLES
from tests.diagnosis.cases import write_case
from tests.diagnosis.tire_case import sweep, toml
from tests.golden.cases import TIRE_FILE
from toolkit.diagnosis.answer.answer import DiagnosedRecording
from toolkit.diagnosis.answer.case_findings import calibration_findings, case_findings
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects
from toolkit.errors import ConfigError

REGISTRY = EXAMPLES.parents[1] / "calibrations"
LBF = 4.4482216152605
# The published calibration (thesis, section 4.1), lbf and lbf*ft.
FY = np.array([0.99719, 0.99718, 1.0228])
MZ = np.array([-0.15688, 0.16197, 0.0026666])
CELLS = "".join(f'{name} = {{ unit = "lbf", role = "output" }}\n' for name in ("D51", "D52", "E5"))


def machine(folder, *, simulation="", frames=None, **entries):
    frames = frames or {f"r{i}__csv": sweep("machine", seed=i) for i in range(2)}
    text = toml('kind = "machine"\nmachine = "m15"\ntire = "tire.tir"\n' + simulation, axes="machine",
                **{"mu": "LMUY", **entries})  # fmt: skip
    return read_case(write_case(folder, text, simulator=None, tire__tir=TIRE_FILE, **frames))


def with_cells(df):
    rng = np.random.default_rng(1)
    cells = {name: 100 * rng.normal(size=len(df)) for name in ("D51", "D52", "E5")}
    return df.assign(**cells)


@pytest.mark.parametrize("beside", [False, True])
def test_forces_follow_from_the_cells_also_beside_the_programs_own(tmp_path, beside):
    # The program's FY stands beside the cells as a covariate, and is wrong; the cells are what counts.
    more = 'FY = { unit = "lbf", role = "covariate" }\n' if beside else ""
    frames = {f"r{i}__csv": with_cells(sweep("machine", seed=i)) for i in range(2)}
    case = machine(tmp_path, simulation='calibration = "m15-r2"\n', channels=CELLS + more, frames=frames)
    made = model_of(case, REGISTRY).observed(case.runs[0])
    cells = np.stack([case.runs[0].columns[name] for name in ("D51", "D52", "E5")])
    np.testing.assert_allclose(made["FY"], (FY @ cells + 0.6473) * LBF, rtol=1e-12)
    np.testing.assert_allclose(made["MZ"], (MZ @ cells + 0.68759) * LBF * 0.3048, rtol=1e-12)


def test_a_record_by_path_is_the_record_by_id_and_the_answer_says_what_it_is(tmp_path):
    frames = {f"r{i}__csv": with_cells(sweep("machine", seed=i)) for i in range(2)}
    frames["rec__json"] = (REGISTRY / "m15" / "m15-r2.json").read_bytes()
    made, told = [], []
    for i, name in enumerate(("m15-r2", "rec.json")):
        case = machine(
            tmp_path / str(i), simulation=f'calibration = "{name}"\n', channels=CELLS, frames=frames
        )
        made.append(model_of(case, REGISTRY).observed(case.runs[0])["FY"])
        told.append(" ".join(one.message for one in calibration_findings(case, REGISTRY)))
    np.testing.assert_array_equal(made[0], made[1])
    assert "unverified" in told[0]
    assert "beside the case" not in told[0]
    assert "unverified" in told[1]
    assert "beside the case" in told[1]


def test_cells_without_calibration_or_registry_are_told(tmp_path):
    frames = {f"r{i}__csv": with_cells(sweep("machine", seed=i)) for i in range(2)}
    with pytest.raises(ConfigError, match="nothing that the machine simulates"):
        model_of(machine(tmp_path / "a", channels=CELLS, frames=frames), REGISTRY)
    named = machine(tmp_path / "b", simulation='calibration = "m15-r2"\n', channels=CELLS, frames=frames)
    with pytest.raises(ConfigError, match="no registry"):
        model_of(named, None)


def test_a_calibration_beside_direct_forces_is_not_needed(tmp_path):
    case = machine(tmp_path, simulation='calibration = "m15-r2"\n')
    assert {one.name for one in model_of(case, REGISTRY).outputs} == {"FY", "MZ"}


def test_no_load_no_force(tmp_path):
    frames = {f"r{i}__csv": sweep("machine", seed=i) for i in range(2)}
    frames["r0__csv"].loc[3, "FZ"], frames["r0__csv"].loc[4, "FZ"] = 0.0, -50.0
    case = machine(tmp_path, frames=frames)
    made = model_of(case, None).simulate(case.runs[0], {"LMUY": 1.0}, ())
    assert made["FY"][3] == made["FY"][4] == made["MZ"][3] == made["MZ"][4] == 0.0
    assert abs(made["FY"][5]) > 100


def test_a_reversed_drum_turns_FY_and_keeps_MZ(tmp_path):
    forward = sweep("machine", seed=0)
    reverse = forward.assign(FY=-forward["FY"])
    runs = '[[recording.run]]\nfile = "r0.csv"\n[[recording.run]]\nfile = "r1.csv"\nrotation = "reverse"\n'
    case = machine(tmp_path, frames={"r0__csv": forward, "r1__csv": reverse}, runs=runs)
    model = model_of(case, None)
    one, other = (model.simulate(run, {"LMUY": 1.0}, ()) for run in case.runs)
    np.testing.assert_allclose(other["FY"], -one["FY"])
    np.testing.assert_allclose(other["MZ"], one["MZ"])
    # SAE: a positive slip angle gives a negative force at small camber, PKY1 < 0 being ISO-W
    assert np.corrcoef(one["FY"], case.runs[0].columns["SA"])[0, 1] < -0.9


@pytest.mark.parametrize(
    ("name", "unit", "said", "step"),
    [
        ("LMUYY", "1", "no parameter", "did you mean 'LMUY'?"),
        ("drum.sped", "km/h", "no parameter", "did you mean 'drum.speed'?"),
        ("drum.speed", "kg", "unit does not fit", "correct the unit"),
    ],
)
def test_a_parameter_that_neither_tire_nor_machine_has_is_told(tmp_path, name, unit, said, step):
    free = f'[simulation.parameters."{name}"]\nvalue = 1.0\nunit = "{unit}"\n'
    with pytest.raises(ConfigError, match=said) as caught:
        model_of(machine(tmp_path, simulation=free, mu=""), None)
    assert caught.value.next_step == step


def test_the_drums_speed_may_be_freed(tmp_path):
    free = '[simulation.parameters."drum.speed"]\nvalue = 7.66\nunit = "km/h"\nsd = 0.5\n'
    case = machine(tmp_path, simulation=free, mu="")
    model = model_of(case, None)
    assert model.parameters[0].name == "drum.speed"
    made = model.simulate(case.runs[0], {"drum.speed": 8.0}, ())
    np.testing.assert_allclose(made["FY"], model.simulate(case.runs[0], {"drum.speed": 7.66}, ())["FY"])


def test_a_negative_load_is_noted(tmp_path):
    frames = {f"r{i}__csv": sweep("machine", seed=i).assign(FZ=lambda df: -df["FZ"]) for i in range(2)}
    case = machine(tmp_path, frames=frames)
    assert [one.rule for one in case_findings(problem_of(case, model_of(case, None)))] == ["case-load-sign"]


@pytest.mark.parametrize("measured", [True, False])
def test_a_lag_of_the_load_acts_once(tmp_path, measured):
    # Where FZ was measured, it drives the tire as it is, and is itself judged against the command.
    rows = sweep("machine", seed=0)
    rows["FZ_CMD"] = np.where(rows["t"] < 6, 3000.0, 5000.0)
    channels = 'FZ_CMD = { unit = "N", role = "input" }\nFY = { unit = "N", role = "output" }\n'
    text = toml('kind = "machine"\ntire = "tire.tir"', axes="machine", mu="LMUY", channels=channels)
    load = 'FZ = { unit = "N", role = "input" }\n'
    text = text.replace(load, load.replace("input", "output") if measured else "")
    case = read_case(
        write_case(tmp_path, text, simulator=None, tire__tir=TIRE_FILE, r0__csv=rows, r1__csv=rows[1:])
    )
    model = model_of(case, None)
    late = AppliedEffect(effect=effects()["load_lag"], values={"time_constant": 0.5})
    plain, made = (model.simulate(case.runs[0], {"LMUY": 1.0}, one) for one in ((), (late,)))
    step = 60  # the command's row; one row later the lag has come exp(-0.1/0.5) of the way, less the ramp's
    assert (np.abs(made["FY"] - plain["FY"])[step:].max() > 100) is not measured
    if measured:
        np.testing.assert_array_equal(plain["FZ"], rows["FZ_CMD"])
        # linear between rows: 1 - (1 - exp(-0.2))/0.2 of the step at its own row, then exp(-0.2) each row
        left = (1 - np.exp(-0.2)) / 0.2 * np.exp(-0.2 * np.arange(60))
        np.testing.assert_allclose(made["FZ"][step:], 5000 - 2000 * left, rtol=1e-9)


FIGURE = """schema = 1
title = "Figure 4.4"
[simulation]
kind = "machine"
machine = "m15"
calibration = "m15-r2"
[recording.channels]
FZ = { unit = "lbf", role = "input" }
D51 = { unit = "lbf", role = "input" }
D52 = { unit = "lbf", role = "input" }
E5 = { unit = "lbf", role = "input" }
FY = { unit = "N", role = "output" }
MZ = { unit = "lbf*ft", role = "output" }
[[recording.run]]
file = "run.xlsx"
"""


def test_the_machines_own_workbook_names_the_sign_of_E5(tmp_path):
    book = (EXAMPLES / "fig4_4" / "M15_fig4_4.xlsx").read_bytes()
    case = read_case(write_case(tmp_path, FIGURE, simulator=None, run__xlsx=book))
    made = diagnose(case, REGISTRY).diagnosis
    assert made.verdict == "equivalent"
    assert [(one.name, one.channel, one.equivalent_to) for one in made.effects] == [
        ("channel_sign", "E5", ("wrong_calibration",))
    ]
    assert {one.rule for one in made.findings} == {"case-one-run", "case-calibration"}
    assert made.recordings == (
        DiagnosedRecording(name="run.xlsx", sha256=hashlib.sha256(book).hexdigest(), own=True),
    )


def test_a_table_under_the_programs_own_headers_is_that_workbook(tmp_path):
    book = (EXAMPLES / "fig4_4" / "M15_fig4_4.xlsx").read_bytes()
    first = read_case(write_case(tmp_path / "a", FIGURE, simulator=None, run__xlsx=book)).runs[0]
    headers = {"FZ": "FZ load", "D52": "D52 (Filtered)", "D51": "D51 (Filtered)", "E5": "E5 (Filtered)"}
    table = pd.DataFrame({text: first.columns[name] for name, text in headers.items()})
    table["SA (Filtered)"] = -0.3
    table["Fy"] = first.columns["FY"] / LBF  # the file's own unit, which its header does not print
    table["Mz"] = first.columns["MZ"]
    text = FIGURE.replace("run.xlsx", "run.csv")
    again = read_case(write_case(tmp_path / "b", text, simulator=None, run__csv=table)).runs[0]
    for name, values in first.columns.items():
        np.testing.assert_allclose(again.columns[name], values, rtol=1e-12)


def test_a_programs_arithmetic_has_no_free_parameter(tmp_path):
    book = (EXAMPLES / "fig4_4" / "M15_fig4_4.xlsx").read_bytes()
    free = '[simulation.parameters.LMUY]\nvalue = 1.0\nunit = "1"\nsd = 0.1\n[recording.channels]\n'
    text = FIGURE.replace("[recording.channels]\n", free)
    with pytest.raises(ConfigError, match="no free parameter"):
        model_of(read_case(write_case(tmp_path, text, simulator=None, run__xlsx=book)), REGISTRY)


def test_an_effect_on_a_cell_is_predicted_for_inputs_without_cells(tmp_path):
    # cells of least norm that the published calibration turns into the recorded loads
    spread = np.linalg.pinv(np.stack([FY * LBF, MZ * LBF * 0.3048]))
    constant = np.array([0.6473 * LBF, 0.68759 * LBF * 0.3048])

    def cells(frame):
        made = spread @ (np.stack([frame["FY"], frame["MZ"]]) - constant[:, None])
        return dict(zip(("D51", "D52", "E5"), made, strict=True))

    frames = {f"r{i}__csv": (one := sweep("machine", seed=i)).assign(**cells(one)) for i in range(2)}
    frames["more__csv"] = sweep("machine", seed=5)[["t", "SA", "FZ"]]
    runs = "".join(f'[[recording.{key}]]\nfile = "{name}.csv"\n' for key, name in
                   (("run", "r0"), ("run", "r1"), ("predict", "more")))  # fmt: skip
    case = machine(tmp_path, simulation='calibration = "m15-r2"\n', channels=CELLS, frames=frames, runs=runs)
    model = model_of(case, REGISTRY)
    gain = AppliedEffect(effect=effects()["sensitivity_error"], channel="E5", values={"gain_error": 0.1})
    (run,) = case.predict
    plain, more = (model.simulate(run, {"LMUY": 1.0}, active) for active in ((), (gain,)))
    # a cell that shows 1.1 of what it carries adds a part in 11 of what it shows, by its coefficient
    added = FY[2] * LBF * cells(plain)["E5"] / 11
    np.testing.assert_allclose(more["FY"] - plain["FY"], added, rtol=1e-6, atol=1e-6)
