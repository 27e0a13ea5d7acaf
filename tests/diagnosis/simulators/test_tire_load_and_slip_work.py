"""What acts on the tire: the load behind a lying channel, earlier slip work, forces of no one cell."""

import numpy as np
import pytest

from tests.diagnosis.cases import write_case
from tests.diagnosis.simulators.test_machine_cases import CELLS, REGISTRY, machine, with_cells
from tests.diagnosis.tire_case import SIGNS, SIMULATOR, plain, sweep, toml
from tests.golden.cases import TIRE_FILE
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

SPEED = 7.66 / 3.6  # m/s, of the drum where none is recorded (thesis, 7.66 km/h)


@pytest.mark.parametrize("kind", ["python", "columns"])
def test_wear_goes_on_from_the_runs_before(tmp_path, kind):
    frames = {}
    for i in range(2):
        made = sweep("SAE", seed=i)
        frames[f"r{i}__csv"] = made.assign(FY_sim=plain(made["SA"].to_numpy(), made["FZ"].to_numpy())["FY"])
    if kind == "python":
        text, simulator = toml('kind = "python"\npath = "sim.py"'), SIMULATOR.format(signs=SIGNS["SAE"])
    else:
        one = 'FY = { unit = "N", role = "output" }\n'
        text, simulator = toml('kind = "columns"\nsimulated = { FY = "FY_sim" }', mu="", channels=one), None
    case = read_case(write_case(tmp_path, text, simulator=simulator, **frames))
    first, second = case.runs
    force = plain(first.columns["SA"], first.columns["FZ"])["FY"].to_numpy()
    power = np.abs(force * SPEED * np.sin(np.radians(first.columns["SA"]))) / 1e3
    work = float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(first.t)))
    assert work > 1  # kJ
    setting = model_of(case, None).setting
    assert setting(first).slip_work_before_kJ == 0
    assert setting(second).slip_work_before_kJ == pytest.approx(work, rel=1e-9)


def test_a_load_channel_that_shows_too_much_is_not_what_the_tire_carries(tmp_path):
    shown = []
    for factor in (1.0, 1.05):
        frames = {}
        for i in range(2):
            made = sweep("machine", seed=i)
            frames[f"r{i}__csv"] = made.assign(FZ_CMD=made["FZ"], FZ=factor * made["FZ"])
        channels = (
            'FZ_CMD = { unit = "N", role = "input" }\nFY = { unit = "N", role = "output" }\n'
            'MZ = { unit = "N*m", role = "output" }\n'
        )
        text = toml(
            'kind = "machine"\nmachine = "m15"\ntire = "tire.tir"',
            axes="machine",
            mu="LMUY",
            channels=channels,
        )
        text = text.replace(
            'FZ = { unit = "N", role = "input" }\n', 'FZ = { unit = "N", role = "output" }\n', 1
        )
        folder = tmp_path / f"{factor}"
        case = read_case(write_case(folder, text, simulator=None, tire__tir=TIRE_FILE, **frames))
        model = model_of(case, REGISTRY)
        gain = AppliedEffect(
            effect=effects()["sensitivity_error"], channel="FZ", values={"gain_error": factor - 1}
        )
        shown.append(model.simulate(case.runs[0], {"LMUY": 1.0}, (gain,) if factor > 1 else ()))
    true, lying = shown
    np.testing.assert_allclose(lying["FZ"], 1.05 * true["FZ"], rtol=1e-12)
    np.testing.assert_allclose(lying["FY"], true["FY"], rtol=1e-12)
    np.testing.assert_allclose(lying["MZ"], true["MZ"], rtol=1e-12)


def test_a_force_at_the_tire_has_no_place_on_a_single_cell(tmp_path):
    frames = {
        f"r{i}__csv": with_cells(sweep("machine", seed=i)).assign(TIRE_ANGLE=0.0, DRUM_ANGLE=0.0)
        for i in range(2)
    }
    angles = "".join(
        f'{name} = {{ unit = "deg", role = "covariate" }}\n' for name in ("TIRE_ANGLE", "DRUM_ANGLE")
    )
    case = machine(tmp_path, simulation='calibration = "m15-r2"\n', channels=CELLS + angles, frames=frames)
    model = model_of(case, REGISTRY)
    for name in ("nonuniformity", "drum_runout"):
        assert {channel for channel, _ in model.places(effects()[name])} == {"FY", "MZ"}, name
    assert {"D51", "D52", "E5"} <= {channel for channel, _ in model.places(effects()["hysteresis"])}


@pytest.mark.parametrize(
    ("name", "value", "unit", "load"),
    [
        ("FZ0", 4.0, "kN", 4000.0),
        ("F_nom", 1000.0, "lbf", 4448.22),
        ("FZ0", 4.0, "1", None),
        ("mass0", 4000.0, "N", None),
    ],
)
def test_parameters_count_from_the_nominal_load_that_a_simulator_names(tmp_path, name, value, unit, load):
    frames = {f"r{i}__csv": sweep("SAE", seed=i) for i in range(2)}
    simulator = SIMULATOR.format(signs=SIGNS["SAE"])
    text = toml('kind = "python"\npath = "sim.py"')
    text += f'[simulation.parameters.{name}]\nvalue = {value}\nunit = "{unit}"\n'
    case = read_case(write_case(tmp_path, text, simulator=simulator, **frames))
    if load is None:
        load = float(np.median(np.concatenate([one.columns["FZ"] for one in case.runs])))
    found = model_of(case, None).setting(case.runs[0]).nominal_load_N
    assert found == pytest.approx(load, rel=1e-5)
